"""The keys of `case.toml`, their types and bounds; what keys mean to each other is in `checks`.

Every description says what is expected there: it is the text of the error messages.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, InstanceOf, PlainValidator
from pydantic_core import PydanticCustomError

from femubench.core.case.case import BEAM_SHARE, LARGEST_TOLERANCE, SCATTER, TOLERANCE
from femubench.core.fem.frame import MADE, BeamTheory, BendingMass, Made, Place, Plane
from femubench.core.modal.frf import Motion

T = TypeVar("T")
LengthUnit = Literal["m", "cm", "mm", "in", "ft"]
LARGEST, SMALLEST = 1e30, 1e-30
# What a terminal obeys or what turns the direction of writing: no name and no title has it.
_CONTROL = r"\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069"
ID = rf"^[^\s{_CONTROL}@/:](?:[^{_CONTROL}@/:]*[^\s{_CONTROL}@/:])?$"
AT = 'a joint "A", a point "member@0.25" or {member = "name", s = 0.25}'
_CASE = rf"^[^\s{_CONTROL}](?:[^{_CONTROL}]*[^\s{_CONTROL}])?$"
_LINE = rf"^[^{_CONTROL}]*$"
_DIRECTION = r"^[+-]?(x|y|z|rx|ry|rz)$"


def misfit(what: str, expected: str) -> PydanticCustomError:
    """Return the error of a value that is not what its key needs."""
    return PydanticCustomError("misfit", "{what}", {"what": what, "expected": expected})


def _place(value: object) -> Place:
    if isinstance(value, str) and value:
        member, found, station = value.rpartition("@")
        if not found:
            return Place(joint=value)
        try:
            s = float(station)
        except ValueError:
            raise misfit(f"{station[:20]!r} is not a station", AT) from None
        return _station(member, s)
    if isinstance(value, dict) and set(value) == {"member", "s"}:
        member, s = value["member"], value["s"]
        if isinstance(member, str) and isinstance(s, (int, float)) and not isinstance(s, bool):
            return _station(member, s)
    raise misfit("not a place", AT)


def _station(member: str, s: float) -> Place:
    if not 0 <= s <= 1:
        raise misfit("the station lies outside 0..1", AT)
    return Place(member=member, s=float(s))


def _dof_name(value: object) -> int | str:
    if isinstance(value, (int, str)) and not isinstance(value, bool):
        return value
    raise misfit("not a degree of freedom", 'a row number, "node" or "node:direction"')


Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, ge=SMALLEST, le=LARGEST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
Name = Annotated[str, Field(strict=True, pattern=ID, max_length=80)]
CaseName = Annotated[str, Field(strict=True, pattern=_CASE, max_length=80)]
Text = Annotated[str, Field(strict=True, pattern=_LINE, max_length=2000)]
FileName = Annotated[str, Field(strict=True, pattern=_LINE, min_length=1, max_length=255)]
Direction = Annotated[str, Field(strict=True, pattern=_DIRECTION)]
At = Annotated[InstanceOf[Place], BeforeValidator(_place)]
DofName = Annotated[int | str, PlainValidator(_dof_name)]
Vector = tuple[Number, Number, Number]
Many = tuple[T, ...]
Bands = Annotated[Many[tuple[Positive, Positive]], Field(max_length=1000)]
DIRECTIONS = "one of x, y, z, rx, ry, rz, with an optional sign"
NAME = "a name without @, / and :, in quotes"
BAND = "[low, high] in Hz with low < high"
XYZ = "[x, y, z] in m, finite numbers"


class TomlTable(BaseModel):
    """A table of `case.toml`; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


_SHARE = "true, false or a multiple of rho I, a number >= 0"
_PLACES = '"all", the name of a member, "member/k" for its element k, or a list of these'
_MEMBER = "the name of a member"


def _share(value: object) -> bool | float:
    if isinstance(value, bool):
        return value
    if isinstance(value, (int, float)) and 0 <= value <= LARGEST:
        return float(value)
    raise misfit("not a share of the rotary inertia", _SHARE)


def _places(value: object) -> tuple[str, ...]:
    found = [value] if isinstance(value, str) else value
    if isinstance(found, (list, tuple)) and found and all(isinstance(v, str) for v in found):
        return tuple(found)
    raise misfit("not a list of places", _PLACES)


Share = Annotated[bool | float, PlainValidator(_share)]
Quantity = Literal[
    "EA", "EI", "GJ", "bending ry", "bending rz", "E", "rhoA", "rhoJp", "density", "shear", "rotary"
]  # fmt: skip


class FactorSpec(TomlTable):
    """`[[model.factors]]`."""

    quantity: Quantity = Field(description=f"one of {', '.join(get_args(Quantity))}")
    at: Annotated[tuple[str, ...], PlainValidator(_places)] = Field(description=_PLACES)
    factor: NotNegative = Field(description="a number > 0")


class PreloadSpec(TomlTable):
    """`[[model.preloads]]`."""

    member: Name = Field(description=_MEMBER)
    force: Number = Field(description="a number in N, tension positive")


class EccentricitySpec(TomlTable):
    """`[[model.eccentricities]]`."""

    member: Name = Field(description=_MEMBER)
    y: Number = Field(0.0, description="a number in m, along local y")
    z: Number = Field(0.0, description="a number in m, along local z")


class CouplingSpec(TomlTable):
    """`[[model.couplings]]`."""

    member: Name = Field(description=_MEMBER)
    coefficient: Annotated[float, Field(strict=True, gt=-1, lt=1, allow_inf_nan=False)] = Field(
        description="a number > -1 and < 1"
    )


class BraceSpec(TomlTable):
    """`[[model.braces]]`."""

    ends: tuple[Name, Name] = Field(description="the names of two joints")
    stiffness: NotNegative = Field(description="a number >= 0 in N/m")
    direction: Literal["", "x", "y", "z"] = Field("", description="x, y or z")


class OscillatorSpec(TomlTable):
    """`[[model.oscillators]]`."""

    at: At = Field(description=AT)
    direction: Direction = Field(description="a translation x, y or z, with an optional sign")
    mass: Positive = Field(description="a number > 0 in kg")
    frequency: Positive = Field(description="a number > 0 in Hz")
    crosswise: bool = Field(True, strict=True, description="true or false")


_MOST = 20_000  # entries of a list each of which costs time of its own
MOST_ELEMENTS = 1_000_000  # of a frame, which then takes 2 GB before any mode is sought


def _tables(key: str, max_length: int | None = None) -> Any:  # noqa: ANN401 - as `Field` has it
    return Field((), max_length=max_length, description=f"tables [[{key}]]")


class CaseInfo(TomlTable):
    """`[case]`."""

    name: CaseName = Field(description="a name without blanks at its ends, in quotes")
    title: Text = Field("", description="one line of text")
    source: Text = Field("", description="one line: where the numbers come from")
    structure: CaseName = Field("", description="a name without blanks at its ends, in quotes")


class MaterialSpec(TomlTable):
    """`[model.materials.NAME]`."""

    E: Positive = Field(description="Young's modulus, a number > 0 in Pa")
    nu: Annotated[float, Field(strict=True, gt=-1, lt=0.5, allow_inf_nan=False)] = Field(
        description="Poisson's ratio, a number > -1 and < 0.5"
    )
    rho: Positive = Field(description="density, a number > 0 in kg/m3")


class SectionSpec(TomlTable):
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


class JointSpec(TomlTable):
    """`[[model.joints]]`."""

    name: Name = Field(description=NAME)
    xyz: Vector = Field(description=XYZ)
    type: str = Field("", strict=True, pattern=rf"^$|{ID}", max_length=80, description=NAME)


class MemberSpec(TomlTable):
    """`[[model.members]]`."""

    name: Name = Field(description=NAME)
    ends: tuple[Name, Name] = Field(description="the names of two joints")
    elements: Count = Field(1, description="a whole number from 1 to 1000000")
    section: Name = Field(description="the name of a section")
    material: Name = Field(description="the name of a material")
    up: Vector | None = Field(None, description="a vector in the local x-z plane, 3d only")


class MassSpec(TomlTable):
    """`[[model.masses]]`."""

    at: At = Field(description=AT)
    mass: NotNegative = Field(description="a number >= 0 in kg")
    offset: Vector = Field((0.0, 0.0, 0.0), description=XYZ)


class SpringSpec(TomlTable):
    """`[[model.springs]]`."""

    at: At = Field(description=AT)
    direction: Direction = Field(description=DIRECTIONS)
    stiffness: NotNegative = Field(description="a number >= 0 in N/m or N m/rad")


class SupportSpec(TomlTable):
    """`[[model.supports]]`."""

    at: At = Field(description=AT)
    fixed: Many[Direction] = Field(min_length=1, max_length=6, description="a list of directions")


class JointSpringSpec(TomlTable):
    """`[[model.joint_springs]]`."""

    joint: Name = Field(description="the name of a joint")
    member: Name = Field(description="the name of a member that ends at the joint")
    stiffness: Annotated[dict[str, NotNegative], Field(min_length=1)] = Field(
        description="local directions with numbers >= 0 in N/m or N m/rad, e.g. {ry = 3e5}"
    )
    arm: NotNegative = Field(0.0, description="a length >= 0 in m")
    arm_factor: Positive | None = Field(None, description="a number > 0")


class RigidEndSpec(TomlTable):
    """`[[model.rigid_ends]]`."""

    joint: Name = Field(description="the name of a joint")
    member: Name = Field(description="the name of a member that ends at the joint")
    stiffness_length: Number = Field(description="a length in m, may be negative")
    mass_length: Number = Field(0.0, description="a length in m")


class LinkSpec(TomlTable):
    """`[[model.links]]`."""

    leads: Name = Field(description="the name of a joint")
    follows: Many[Name] = Field(
        min_length=1, max_length=20_000, description="a list of names of joints"
    )
    motions: Many[Direction] = Field((), max_length=6, description="a list of directions")


class SetSpec(TomlTable):
    """`[[model.sets]]`: members that belong together."""

    name: Name = Field(description=NAME)
    members: Many[Name] = Field(min_length=1, description="a list of names of members")


class JointKindSpec(TomlTable):
    """`[[model.joint_kinds]]`: how the joints of a type are made."""

    type: Name = Field(description="a type of [[model.joints]]")
    made: Made = Field(description=f"one of {', '.join(MADE)}")


class DampingSpec(TomlTable):
    """`[model.damping]`."""

    alpha: NotNegative = Field(0.0, description="a number >= 0 in 1/s, of the mass")
    beta: NotNegative = Field(0.0, description="a number >= 0 in s, of the stiffness")
    eta: NotNegative = Field(0.0, description="a number >= 0, the loss factor")


class FrameSpec(TomlTable):
    """`[model]` with ``kind = "frame"``."""

    kind: Literal["frame"] = Field(description="'frame', 'matrices' or 'file'")
    plane: Plane = Field(description="'in-plane', 'out-of-plane' or '3d'")
    beam: BeamTheory = Field("euler-bernoulli", description="'euler-bernoulli' or 'timoshenko'")
    rotary_inertia: Share | None = Field(None, description=_SHARE)
    bending_mass: BendingMass = Field(
        "shear-consistent", description="'cubic' or 'shear-consistent'"
    )
    gravity: NotNegative = Field(0.0, description="a multiple of the own weight, a number >= 0")
    free: bool = Field(False, strict=True, description="true or false")
    damping: DampingSpec | None = Field(None, description="{alpha, beta, eta}")
    materials: dict[Name, MaterialSpec] = Field(description="tables [model.materials.NAME]")
    sections: dict[Name, SectionSpec] = Field(description="tables [model.sections.NAME]")
    joints: Annotated[Many[JointSpec], Field(min_length=2, max_length=MOST_ELEMENTS)] = Field(
        description="tables [[model.joints]], two at least, or the name of a CSV file with them"
    )
    members: Annotated[Many[MemberSpec], Field(min_length=1, max_length=MOST_ELEMENTS)] = Field(
        description="tables [[model.members]], one at least, or the name of a CSV file with them"
    )
    masses: Many[MassSpec] = _tables("model.masses", max_length=_MOST)
    springs: Many[SpringSpec] = _tables("model.springs", max_length=_MOST)
    supports: Many[SupportSpec] = _tables("model.supports", max_length=_MOST)
    joint_springs: Many[JointSpringSpec] = _tables("model.joint_springs")
    rigid_ends: Many[RigidEndSpec] = _tables("model.rigid_ends")
    links: Many[LinkSpec] = _tables("model.links", max_length=_MOST)
    factors: Many[FactorSpec] = _tables("model.factors")
    preloads: Many[PreloadSpec] = _tables("model.preloads")
    eccentricities: Many[EccentricitySpec] = _tables("model.eccentricities")
    couplings: Many[CouplingSpec] = _tables("model.couplings")
    braces: Many[BraceSpec] = _tables("model.braces")
    oscillators: Many[OscillatorSpec] = _tables("model.oscillators")
    sets: Many[SetSpec] = _tables("model.sets")
    joint_kinds: Many[JointKindSpec] = _tables("model.joint_kinds")


class GroupSpec(TomlTable):
    """`[[model.groups]]`: a named part of the stiffness, of the mass, or of both."""

    name: Name = Field(description=NAME)
    stiffness: FileName | None = Field(None, description="a matrix file in the case folder")
    mass: FileName | None = Field(None, description="a matrix file in the case folder")
    dofs: Annotated[Many[DofName], Field(min_length=1)] | None = Field(
        None, description='a list of row numbers, "node" or "node:direction"'
    )
    prior: Annotated[float, Field(strict=True, gt=1, le=1e6, allow_inf_nan=False)] | None = Field(
        None, description="a number > 1: a factor of so much up or down is as likely as not"
    )
    kind: Literal["part", "joint", "support", "preload"] | None = Field(
        None, description="'part', 'joint', 'support' or 'preload': what is known of it"
    )


class GroupSetSpec(TomlTable):
    """`[[model.sets]]` of matrices: groups that belong together."""

    name: Name = Field(description=NAME)
    groups: Many[Name] = Field(min_length=1, description="a list of names of groups")


class GroupedSpec(TomlTable):
    """What `[model]` of both kinds without members may state."""

    free: bool = Field(False, strict=True, description="true or false")
    damping: DampingSpec | None = Field(None, description="{alpha, beta, eta}")
    groups: Many[GroupSpec] = Field(
        (), max_length=1000, description="tables [[model.groups]], 1000 at most"
    )
    sets: Many[GroupSetSpec] = _tables("model.sets")


class MatricesSpec(GroupedSpec):
    """`[model]` with ``kind = "matrices"``."""

    kind: Literal["matrices"] = Field(description="'frame', 'matrices' or 'file'")
    mass: FileName = Field(description="a matrix file in the case folder")
    stiffness: FileName = Field(description="a matrix file in the case folder")
    dofs: FileName = Field(description="a CSV file: row,node,direction,x,y,z")


class FileSpec(GroupedSpec):
    """`[model]` with ``kind = "file"``."""

    kind: Literal["file"] = Field(description="'frame', 'matrices' or 'file'")
    file: FileName = Field(description="a file with a model, or with its stiffness, in quotes")
    mass: FileName | None = Field(None, description="a matrix file in the case folder")
    dofs: FileName | None = Field(
        None, description="a CSV file row,node,direction,x,y,z or node,x,y,z, or a file with nodes"
    )
    unit: LengthUnit = Field("m", description=f"one of {', '.join(get_args(LengthUnit))}")


class WeightSpec(TomlTable):
    """`mass` in `[measurement]`."""

    value: Positive = Field(description="a number > 0 in kg")
    std: Positive = Field(description="a number > 0 in kg")


class ScatterSpec(TomlTable):
    """`scatter` in `[measurement]`."""

    frequencies: NotNegative = Field(SCATTER[0], description="a number >= 0, of the frequency")
    shapes: NotNegative = Field(SCATTER[1], description="a number >= 0, of the largest reading")


class ResponsesSpec(TomlTable):
    """`responses` in `[measurement]`."""

    used: Annotated[Bands, Field(min_length=1)] = Field(
        description="a list of bands [low, high] in Hz, one at least"
    )
    held_out: Bands = Field((), description="a list of bands [low, high] in Hz")
    held_out_sensors: Many[Text] = Field(
        (), max_length=1000, description="a list of labels of sensors"
    )
    std: Positive | None = Field(None, description="a number > 0, of the magnitude of a line")
    floor: NotNegative = Field(0.0, description="a number >= 0, in the unit of the responses")
    quantity: Motion | None = Field(None, description=f"one of {', '.join(get_args(Motion))}")
    factor: Positive = Field(1.0, description="a number > 0 that brings them to SI units")


class MeasurementSpec(TomlTable):
    """`[measurement]`."""

    sensors: FileName | None = Field(None, description="a file in the case folder")
    modes: FileName = Field(description="a file in the case folder")
    shape_std: Positive = Field(0.015, description="a number > 0, of the largest component")
    used: Many[Count] = Field(min_length=1, description="a list of mode numbers, one at least")
    held_out: Many[Count] = Field((), description="a list of mode numbers")
    band: tuple[NotNegative, Positive] | None = Field(None, description=BAND)
    mass: WeightSpec | None = Field(None, description="{value, std} in kg")
    unit: LengthUnit | None = Field(
        None, description=f"one of {', '.join(get_args(LengthUnit))}, of sensors' coordinates"
    )
    frame: Annotated[str, Field(strict=True, max_length=40)] | None = Field(
        None, description='the axes of the model in those of the test, e.g. "x,z,-y"'
    )
    directions: Annotated[str, Field(strict=True, max_length=40)] | None = Field(
        None, description="the same of the directions of the sensors alone"
    )
    tolerance: Annotated[float, Field(strict=True, ge=0, le=1, allow_inf_nan=False)] | None = Field(
        None, description="a number >= 0 and <= 1, of the size of the structure"
    )
    origin: Vector = Field((0.0, 0.0, 0.0), description=XYZ)
    without: Many[Text] = Field((), max_length=1000, description="a list of labels of sensors")
    scatter: ScatterSpec | None = Field(None, description="{frequencies, shapes}")
    repeats: FileName | None = Field(None, description="a CSV file in the case folder")
    covariance: FileName | None = Field(None, description="a CSV file in the case folder")
    variables: dict[Name, Text] = Field(
        {}, description='names of variables, e.g. {frequencies = "f_exp", shapes = "Psi"}'
    )
    frfs: FileName | None = Field(None, description="a file in the case folder")
    responses: ResponsesSpec | None = Field(None, description="{used, held_out, std} with bands")


class ReferenceSpec(TomlTable):
    """`[reference]`."""

    modes: FileName = Field(description="a file in the case folder")
    sensors: FileName | None = Field(None, description="a file in the case folder")
    used: Annotated[Many[Count], Field(min_length=1)] | None = Field(
        None, description="a list of mode numbers, one at least"
    )
    mass: WeightSpec | None = Field(None, description="{value, std} in kg")
    frfs: FileName | None = Field(None, description="a file in the case folder")


class RemovalSpec(TomlTable):
    """An entry of `remove` in `[[modification]]`: one of these keys."""

    member: Name | None = Field(None, description=_MEMBER)
    support: At | None = Field(None, description=AT)
    mass: At | None = Field(None, description=AT)
    spring: At | None = Field(None, description=AT)


class ExchangeSpec(TomlTable):
    """An entry of `set` in `[[modification]]`: a member or a set, and what it becomes."""

    member: Name | None = Field(None, description=_MEMBER)
    set: Name | None = Field(None, description="the name of a set of [[model.sets]]")
    section: Name | None = Field(None, description="the name of a section")
    material: Name | None = Field(None, description="the name of a material")


class ModificationSpec(TomlTable):
    """`[[modification]]`."""

    name: Text = Field(description="one line of text")
    masses: Many[MassSpec] = Field((), max_length=_MOST, description="a list of {at, mass, offset}")
    springs: Many[SpringSpec] = Field(
        (), max_length=_MOST, description="a list of {at, direction, stiffness}"
    )
    supports: Many[SupportSpec] = Field(
        (), max_length=_MOST, description="a list of {at, fixed = [...]}"
    )
    remove: Many[RemovalSpec] = Field(
        (), max_length=_MOST, description="a list of {member}, {support}, {mass} or {spring}"
    )
    set: Many[ExchangeSpec] = Field(
        (), max_length=_MOST, description="a list of {member, section} or {member, material}"
    )
    modes: FileName = Field(description="a file in the case folder")


class DiagnosisSpec(TomlTable):
    """`[diagnosis]`."""

    tolerance: Annotated[
        float, Field(strict=True, ge=0, le=LARGEST_TOLERANCE, allow_inf_nan=False)
    ] = Field(
        default=TOLERANCE,
        description=f"a number >= 0 and <= {LARGEST_TOLERANCE}, the relative scatter of every "
        "element",
    )
    model_error: Annotated[float, Field(strict=True, ge=0, le=10, allow_inf_nan=False)] | None = (
        Field(
            default=None,
            description="a number >= 0 and <= 10, a factor on the widths of the model error",
        )
    )
    beam_share: Annotated[float, Field(strict=True, gt=0, lt=1, allow_inf_nan=False)] = Field(
        default=BEAM_SHARE,
        description="a number > 0 and < 1, how likely the structure is but a beam model",
    )


class DrawingSpec(TomlTable):
    """The whole of a file with another drawing of the structure of a case."""

    model: Annotated[FrameSpec | MatricesSpec | FileSpec, Field(discriminator="kind")] = Field(
        description="the table [model]"
    )


class CaseSpec(DrawingSpec):
    """The whole of `case.toml`."""

    case: CaseInfo = Field(description="the table [case]")
    measurement: MeasurementSpec = Field(description="the table [measurement]")
    reference: ReferenceSpec | None = Field(None, description="the table [reference]")
    modification: Many[ModificationSpec] = Field(
        (), max_length=200, description="tables [[modification]], 200 at most"
    )
    diagnosis: DiagnosisSpec = Field(DiagnosisSpec(), description="the table [diagnosis]")


def parse_spec(data: Mapping[str, Any]) -> CaseSpec:
    """Return the content of `case.toml` as typed tables; raises pydantic's ValidationError."""
    return CaseSpec.model_validate(data)
