"""The keys of `case.toml`, their types and bounds; what keys mean to each other is in `checks`.

Every description says what is expected there: it is the text of the error messages.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, InstanceOf, PlainValidator
from pydantic_core import PydanticCustomError

from femubench.core.fem.frame import BeamTheory, BendingMass, Place, Plane

T = TypeVar("T")

LARGEST, SMALLEST = 1e30, 1e-30
_ID = r"^[^\s\x00-\x1f\x7f@/:](?:[^\x00-\x1f\x7f@/:]*[^\s\x00-\x1f\x7f@/:])?$"
_AT = 'a joint "A", a point "member@0.25" or {member = "name", s = 0.25}'
_CASE = r"^[^\s\x00-\x1f\x7f](?:[^\x00-\x1f\x7f]*[^\s\x00-\x1f\x7f])?$"
_LINE = r"^[^\x00-\x1f\x7f]*$"
_DIRECTION = r"^[+-]?(x|y|z|rx|ry|rz)$"


def _misfit(what: str, expected: str) -> PydanticCustomError:
    return PydanticCustomError("misfit", "{what}", {"what": what, "expected": expected})


def _place(value: object) -> Place:
    if isinstance(value, str) and value:
        member, found, station = value.rpartition("@")
        if not found:
            return Place(joint=value)
        try:
            s = float(station)
        except ValueError:
            raise _misfit(f"{station[:20]!r} is not a station", _AT) from None
        return _station(member, s)
    if isinstance(value, dict) and set(value) == {"member", "s"}:
        member, s = value["member"], value["s"]
        if isinstance(member, str) and isinstance(s, (int, float)) and not isinstance(s, bool):
            return _station(member, s)
    raise _misfit("not a place", _AT)


def _station(member: str, s: float) -> Place:
    if not 0 <= s <= 1:
        raise _misfit("the station lies outside 0..1", _AT)
    return Place(member=member, s=float(s))


def _dof_name(value: object) -> int | str:
    if isinstance(value, (int, str)) and not isinstance(value, bool):
        return value
    raise _misfit("not a degree of freedom", 'a row number, "node" or "node:direction"')


Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, ge=SMALLEST, le=LARGEST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
Flag = Annotated[bool, Field(strict=True)]
Name = Annotated[str, Field(strict=True, pattern=_ID, max_length=80)]
CaseName = Annotated[str, Field(strict=True, pattern=_CASE, max_length=80)]
Text = Annotated[str, Field(strict=True, pattern=_LINE, max_length=2000)]
FileName = Annotated[str, Field(strict=True, pattern=_LINE, min_length=1, max_length=255)]
Direction = Annotated[str, Field(strict=True, pattern=_DIRECTION)]
At = Annotated[InstanceOf[Place], BeforeValidator(_place)]
DofName = Annotated[int | str, PlainValidator(_dof_name)]
Vector = tuple[Number, Number, Number]
Many = tuple[T, ...]

_DIRECTIONS = "one of x, y, z, rx, ry, rz, with an optional sign"
_NAME = "a name without @, / and :, in quotes"
_XYZ = "[x, y, z] in m, finite numbers"


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class CaseInfo(_Table):
    """`[case]`."""

    name: CaseName = Field(description="a name without blanks at its ends, in quotes")
    title: Text = Field("", description="one line of text")
    source: Text = Field("", description="one line: where the numbers come from")


class MaterialSpec(_Table):
    """`[model.materials.NAME]`."""

    E: Positive = Field(description="Young's modulus, a number > 0 in Pa")
    nu: Annotated[float, Field(strict=True, gt=-1, lt=0.5, allow_inf_nan=False)] = Field(
        description="Poisson's ratio, a number > -1 and < 0.5"
    )
    rho: Positive = Field(description="density, a number > 0 in kg/m3")


class SectionSpec(_Table):
    """`[model.sections.NAME]`: a shape with its sizes, or numbers."""

    shape: Annotated[str, Field(strict=True)] | None = Field(None, description="name of a shape")
    width: Positive | None = Field(None, description="outer size along local y, > 0 in m")
    height: Positive | None = Field(None, description="outer size along local z, > 0 in m")
    diameter: Positive | None = Field(None, description="outer diameter, > 0 in m")
    wall: Positive | None = Field(None, description="wall thickness, > 0 in m")
    A: Positive | None = Field(None, description="area, a number > 0 in m2")
    Iy: Positive | None = Field(None, description="integral of z^2, a number > 0 in m4")
    Iz: Positive | None = Field(None, description="integral of y^2, a number > 0 in m4")
    J: Positive | None = Field(None, description="torsion constant, a number > 0 in m4")
    Jp: Positive | None = Field(None, description="polar second moment, a number > 0 in m4")
    kappa: Positive | None = Field(None, description="shear coefficient, a number > 0")


class JointSpec(_Table):
    """`[[model.joints]]`."""

    name: Name = Field(description=_NAME)
    xyz: Vector = Field(description=_XYZ)
    type: Annotated[str, Field(strict=True, pattern=rf"^$|{_ID}", max_length=80)] = Field(
        "", description=_NAME
    )


class MemberSpec(_Table):
    """`[[model.members]]`."""

    name: Name = Field(description=_NAME)
    ends: tuple[Name, Name] = Field(description="the names of two joints")
    elements: Count = Field(1, description="a whole number >= 1")
    section: Name = Field(description="the name of a section")
    material: Name = Field(description="the name of a material")
    up: Vector | None = Field(None, description="a vector in the local x-z plane, 3d only")


class MassSpec(_Table):
    """`[[model.masses]]`."""

    at: At = Field(description=_AT)
    mass: NotNegative = Field(description="a number >= 0 in kg")
    offset: Vector = Field((0.0, 0.0, 0.0), description=_XYZ)


class SpringSpec(_Table):
    """`[[model.springs]]`."""

    at: At = Field(description=_AT)
    direction: Direction = Field(description=_DIRECTIONS)
    stiffness: NotNegative = Field(description="a number >= 0 in N/m or N m/rad")


class SupportSpec(_Table):
    """`[[model.supports]]`."""

    at: At = Field(description=_AT)
    fixed: Annotated[Many[Direction], Field(min_length=1, max_length=6)] = Field(
        description="a list of directions"
    )


class JointSpringSpec(_Table):
    """`[[model.joint_springs]]`."""

    joint: Name = Field(description="the name of a joint")
    member: Name = Field(description="the name of a member that ends at the joint")
    stiffness: Annotated[dict[str, NotNegative], Field(min_length=1)] = Field(
        description="local directions with numbers >= 0 in N/m or N m/rad, e.g. {ry = 3e5}"
    )
    arm: NotNegative = Field(0.0, description="a length >= 0 in m")
    arm_factor: Positive | None = Field(None, description="a number > 0")


class RigidEndSpec(_Table):
    """`[[model.rigid_ends]]`."""

    joint: Name = Field(description="the name of a joint")
    member: Name = Field(description="the name of a member that ends at the joint")
    stiffness_length: Number = Field(description="a length in m, may be negative")
    mass_length: Number = Field(0.0, description="a length in m")


class FrameSpec(_Table):
    """`[model]` with ``kind = "frame"``."""

    kind: Literal["frame"] = Field(description="'frame' or 'matrices'")
    plane: Plane = Field(description="'in-plane', 'out-of-plane' or '3d'")
    beam: BeamTheory = Field("euler-bernoulli", description="'euler-bernoulli' or 'timoshenko'")
    rotary_inertia: Flag | None = Field(None, description="true or false")
    bending_mass: BendingMass = Field("cubic", description="'cubic' or 'shear-consistent'")
    materials: dict[Name, MaterialSpec] = Field(description="tables [model.materials.NAME]")
    sections: dict[Name, SectionSpec] = Field(description="tables [model.sections.NAME]")
    joints: Annotated[Many[JointSpec], Field(min_length=2, max_length=20_000)] = Field(
        description="tables [[model.joints]], two at least"
    )
    members: Annotated[Many[MemberSpec], Field(min_length=1, max_length=20_000)] = Field(
        description="tables [[model.members]], one at least"
    )
    masses: Many[MassSpec] = Field((), description="tables [[model.masses]]")
    springs: Many[SpringSpec] = Field((), description="tables [[model.springs]]")
    supports: Many[SupportSpec] = Field((), description="tables [[model.supports]]")
    joint_springs: Many[JointSpringSpec] = Field((), description="tables [[model.joint_springs]]")
    rigid_ends: Many[RigidEndSpec] = Field((), description="tables [[model.rigid_ends]]")


class GroupSpec(_Table):
    """`[[model.groups]]`: a named part of the stiffness."""

    name: Name = Field(description=_NAME)
    stiffness: FileName | None = Field(None, description="a matrix file in the case folder")
    dofs: Annotated[Many[DofName], Field(min_length=1)] | None = Field(
        None, description='a list of row numbers, "node" or "node:direction"'
    )


class MatricesSpec(_Table):
    """`[model]` with ``kind = "matrices"``."""

    kind: Literal["matrices"] = Field(description="'frame' or 'matrices'")
    mass: FileName = Field(description="a matrix file in the case folder")
    stiffness: FileName = Field(description="a matrix file in the case folder")
    dofs: FileName = Field(description="a CSV file: row,node,direction,x,y,z")
    groups: Many[GroupSpec] = Field((), description="tables [[model.groups]]")


class WeightSpec(_Table):
    """`mass` in `[measurement]`."""

    value: Positive = Field(description="a number > 0 in kg")
    std: Positive = Field(description="a number > 0 in kg")


class MeasurementSpec(_Table):
    """`[measurement]`."""

    sensors: FileName | None = Field(None, description="a file in the case folder")
    modes: FileName = Field(description="a file in the case folder")
    shape_std: Positive = Field(0.015, description="a number > 0, of the largest component")
    used: Annotated[Many[Count], Field(min_length=1)] = Field(
        description="a list of mode numbers, one at least"
    )
    held_out: Many[Count] = Field((), description="a list of mode numbers")
    band: tuple[NotNegative, Positive] | None = Field(
        None, description="[low, high] in Hz with low < high"
    )
    mass: WeightSpec | None = Field(None, description="{value, std} in kg")


class ModificationSpec(_Table):
    """`[[modification]]`."""

    name: Text = Field(description="one line of text")
    masses: Many[MassSpec] = Field((), description="a list of {at, mass, offset}")
    springs: Many[SpringSpec] = Field((), description="a list of {at, direction, stiffness}")
    modes: FileName = Field(description="a file in the case folder")


class CaseSpec(_Table):
    """The whole of `case.toml`."""

    case: CaseInfo = Field(description="the table [case]")
    model: Annotated[FrameSpec | MatricesSpec, Field(discriminator="kind")] = Field(
        description="the table [model]"
    )
    measurement: MeasurementSpec = Field(description="the table [measurement]")
    modification: Many[ModificationSpec] = Field((), description="tables [[modification]]")


def parse_spec(data: Mapping[str, Any]) -> CaseSpec:
    """Return the content of `case.toml` as typed tables; raises pydantic's ValidationError."""
    return CaseSpec.model_validate(data)
