"""Make a `Frame` of the tables of `case.toml`, and find sensors and attachments on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias

import numpy as np

from femubench.core.case.checks import check_frame
from femubench.core.case.faults import BadKey, Misfit, WrongDirection, at_key
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.case.schema import FrameSpec, SectionSpec, TomlTable
from femubench.core.errors import ModelError
from femubench.core.fem.frame import (
    ACTIVE,
    BeamTheory,
    Brace,
    Coupling,
    Eccentricity,
    Factor,
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Link,
    Material,
    Member,
    MemberSet,
    Oscillator,
    Place,
    Plane,
    PointMass,
    Preload,
    RigidEnd,
    Support,
    Vector,
)
from femubench.core.fem.mesh import locate, nearest_place, place_xyz
from femubench.core.fem.sections import SHAPES, Section, constant_kappa
from femubench.core.fem.sensors import moved_names
from femubench.core.typing import FloatArray

_SIZES = ("width", "height", "diameter", "wall")
CONSTANTS = ("A", "Iy", "Iz", "J", "Jp")
_NEEDED: dict[Plane, tuple[str, ...]] = {
    "in-plane": ("A", "Iy"),
    "out-of-plane": ("A", "Iy", "J", "Jp"),
    "3d": CONSTANTS,
}


def section_of(spec: SectionSpec, plane: Plane, beam: BeamTheory) -> Section:
    """Return the section of a table, numbers given with a shape taking the place of the shape's.

    Raises:
        BadKey: where a size or a constant is missing or does not belong there.
    """
    shape = spec.shape
    section = _from_numbers(spec, plane) if shape is None else _from_shape(spec, shape)
    if spec.kappa is not None:
        section = replace(section, kappa=constant_kappa(spec.kappa))
    if beam == "timoshenko" and section.kappa is None:
        raise BadKey(("kappa",), "missing key", "the shear coefficient of a timoshenko beam, > 0")
    return section


def _from_shape(spec: SectionSpec, shape: str) -> Section:
    if shape not in SHAPES:
        raise BadKey(("shape",), f"unknown shape {shape[:40]!r}", f"one of {', '.join(SHAPES)}")
    make, keys = SHAPES[shape]
    sizes: dict[str, float] = {}
    for key in _SIZES:
        value = getattr(spec, key)
        if key in keys and value is None:
            raise BadKey((key,), "missing key", f"{', '.join(keys)}, each > 0 in m")
        if key not in keys and value is not None:
            raise BadKey((key,), f"not a size of a {shape}", f"{', '.join(keys)}")
        if value is not None:
            sizes[key] = value
    wall = sizes.get("wall", 0.0)
    smallest = min(value for key, value in sizes.items() if key != "wall")
    if wall >= smallest / 2:
        raise BadKey(("wall",), f"wall {wall:g}", f"a number < {smallest / 2:g}, half of the size")
    return replace(make(**sizes), **_constants(spec))


def _constants(spec: SectionSpec) -> dict[str, Any]:
    return {key: getattr(spec, key) for key in CONSTANTS if getattr(spec, key) is not None}


def _from_numbers(spec: SectionSpec, plane: Plane) -> Section:
    for key in _SIZES:
        if getattr(spec, key) is not None:
            raise BadKey((key,), "a size without a shape", f"shape = one of {', '.join(SHAPES)}")
    given = _constants(spec)
    if "Iy" in given and "Iz" in given:
        given.setdefault("Jp", given["Iy"] + given["Iz"])
    for key in _NEEDED[plane]:
        if key not in given:
            expected = f"{', '.join(_NEEDED[plane])}, which plane {plane!r} needs"
            raise BadKey((key,), "missing key", expected)
    return Section(**dict.fromkeys(CONSTANTS, 0.0) | given)


@dataclass(frozen=True)
class FrameSite:
    """The site of a frame: joints, and stations of members; checks raise Misfit."""

    frame: Frame

    def point(self, place: Place) -> Vector:
        """Return where a place lies in m."""
        try:
            x, y, z = (float(v) for v in place_xyz(self.frame, place))
        except ModelError as error:
            raise Misfit(str(error), "a joint or member@station") from None
        return x, y, z

    def check_direction(self, place: Place, direction: str) -> None:
        """Check that the plane has a direction."""
        allowed = ACTIVE[self.frame.plane]
        if not set(moved_names(direction)) <= set(allowed):
            expected = f"{', '.join(allowed)}, the directions of plane {self.frame.plane!r}"
            raise WrongDirection(f"direction {direction!r} is not there", expected)

    def check_sensor(self, xyz: Vector, direction: str) -> None:
        """Check that a point lies on a member and that the plane has the direction."""
        try:
            place = locate(self.frame, np.array(xyz))
        except ModelError as error:
            raise Misfit(str(error), "a point within 1e-6 m of a member") from None
        self.check_direction(place, direction)

    @property
    def points(self) -> FloatArray:
        """Return the corners in m, (k, 3)."""
        return np.asarray(self.frame.corners)

    def nearest(self, xyz: FloatArray) -> list[tuple[str, FloatArray]]:
        """Return the joint or station of a member nearest to every point, and where it is in m.

        Arguments:
            xyz: in m, (k, 3).
        """
        return [nearest_place(self.frame, point) for point in xyz]


# A structure on which places and directions can be checked.
Site: TypeAlias = FrameSite | MatrixGeometry
# The tables of `[model]` bear the names of the frame's lists, their keys those of its fields.
_PARTS: dict[str, type] = {
    "joints": Joint,
    "joint_springs": JointSpring,
    "rigid_ends": RigidEnd,
    "links": Link,
    "factors": Factor,
    "preloads": Preload,
    "eccentricities": Eccentricity,
    "couplings": Coupling,
    "braces": Brace,
    "sets": MemberSet,
}
_ATTACHED: dict[str, type] = {
    "masses": PointMass,
    "springs": GroundSpring,
    "supports": Support,
    "oscillators": Oscillator,
}


def frame_of(model: FrameSpec) -> Frame:
    """Return the frame that `[model]` describes; raises BadKey with a path below `model`."""
    check_frame(model)
    sections = {}
    for name, spec in model.sections.items():
        with at_key("sections", name):
            made = section_of(spec, model.plane, model.beam)
            sections[name] = replace(made, name=name)
    materials = {n: Material(m.E, m.nu, m.rho, n) for n, m in model.materials.items()}
    own = ("plane", "beam", "rotary_inertia", "bending_mass", "gravity", "free")
    parts: dict[str, Any] = {key: getattr(model, key) for key in own}
    for key, kind in _PARTS.items():
        parts[key] = tuple(_made(kind, spec) for spec in getattr(model, key))
    members = tuple(
        Member(m.name, m.ends, m.elements, sections[m.section], materials[m.material], m.up)
        for m in model.members
    )
    families: dict[str, list[str]] = {}  # the members of every section and of every material
    for word in ("section", "material"):
        for member in model.members:
            families.setdefault(f"{word}:{getattr(member, word)}", []).append(member.name)
    parts["families"] = tuple(MemberSet(word, tuple(names)) for word, names in families.items())
    site = FrameSite(Frame(**parts, members=members))
    attached: dict[str, Any] = {
        key: attachments(key, getattr(model, key), site) for key in _ATTACHED
    }
    return replace(site.frame, **attached)


def _made(kind: Any, spec: TomlTable) -> Any:  # noqa: ANN401 - a part of a frame
    return kind(**{f.name: getattr(spec, f.name) for f in fields(kind)})


def attachments(key: str, specs: Sequence[TomlTable], site: Site) -> tuple[Any, ...]:
    """Return what is attached at places of a structure.

    Arguments:
        key: ``masses``, ``springs``, ``supports`` or ``oscillators``.
        specs: the tables of that list.
        site: the structure.

    Raises:
        BadKey: with a path from the key on.
    """
    parts = [_made(_ATTACHED[key], spec) for spec in specs]
    for i, part in enumerate(parts):
        with at_key(key, i, "at"):
            site.point(part.at)
        with at_key(key, i, "direction"):
            if isinstance(part, GroundSpring | Oscillator):
                site.check_direction(part.at, part.direction)
            if isinstance(part, Oscillator) and "r" in part.direction:
                raise Misfit(f"{part.direction!r} is a rotation", "a translation")
    return tuple(parts)
