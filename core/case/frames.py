"""Make a `Frame` of the tables of `case.toml`, and find sensors and attachments on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import chain
from typing import Any, TypeAlias

import numpy as np

from femubench.core.case.checks import check_frame, check_unique
from femubench.core.case.faults import BadKey, KeyPath, Misfit, WrongDirection, at_key
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.case.schema import (
    DampingSpec,
    ExchangeSpec,
    FrameSpec,
    GroupedSpec,
    ModificationSpec,
    RemovalSpec,
    SectionSpec,
    TomlTable,
)
from femubench.core.errors import ModelError
from femubench.core.fem.alteration import Alteration, Exchange, Removable
from femubench.core.fem.damping import Damping
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
    JointKind,
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
from femubench.core.fem.mesh import ON_MEMBER, locate, nearest_place, place_xyz
from femubench.core.fem.model import Model
from femubench.core.fem.sections import SHAPES, Section
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
        section = replace(section, kappa=Section.constant_kappa(spec.kappa))
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


def site_of(model: Model) -> Site:
    """Return the structure of a model, with its joints and members or with its nodes."""
    held = model.geometry
    return held if isinstance(held, MatrixGeometry) else FrameSite(model.frame_structure.frame)


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
    "joint_kinds": JointKind,
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
    parts["damping"] = damping_of(model.damping)
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


def damping_of(spec: DampingSpec | None) -> Damping | None:
    """Return what `[model.damping]` states; None for nothing."""
    return None if spec is None else Damping(spec.alpha, spec.beta, spec.eta)


def _made(kind: Any, spec: TomlTable) -> Any:  # noqa: ANN401 - a part of a frame
    return kind(**{f.name: getattr(spec, f.name) for f in fields(kind)})


def attachments(key: str, specs: Sequence[TomlTable], site: Site) -> tuple[Any, ...]:
    """Return what is attached at places of a structure.

    Arguments:
        key: ``masses``, ``springs``, ``supports`` or ``oscillators``.

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


def alteration_of(spec: ModificationSpec, site: Site, model: FrameSpec | GroupedSpec) -> Alteration:
    """Return what a modification changes apart from further masses and springs.

    Arguments:
        model: the table of the model, whose sections and materials may be named.

    Raises:
        BadKey: with a path below the modification.
    """
    supports = attachments("supports", spec.supports, site)
    for i, support in enumerate(supports):
        with at_key("supports", i, "fixed"):
            for direction in support.fixed:
                site.check_direction(support.at, direction)
    if not isinstance(site, FrameSite) or not isinstance(model, FrameSpec):
        for key in ("remove", "set"):
            if getattr(spec, key):
                what = "a model of matrices has no parts that could be changed"
                raise BadKey((key,), what, "masses, springs or supports")
        return Alteration(supports)
    removed = [_removed(i, entry, site) for i, entry in enumerate(spec.remove)]
    exchanged = [_exchanged(i, entry, site, model) for i, entry in enumerate(spec.set)]
    names = [(("set", i), e.member) for i, own in enumerate(exchanged) for e in own]
    check_unique(names)
    parts = tuple(chain.from_iterable(removed))
    return Alteration(supports, parts, tuple(chain.from_iterable(exchanged)))


def _one_of(path: KeyPath, spec: TomlTable, keys: Sequence[str]) -> str:
    """Return the only one of some keys that is given."""
    given = [key for key in keys if getattr(spec, key) is not None]
    if len(given) != 1:
        what = f"{' and '.join(given)} at once" if given else "nothing is named"
        raise BadKey(path, what, f"one of {', '.join(keys)}")
    return given[0]


def _removed(i: int, spec: RemovalSpec, site: FrameSite) -> Sequence[Removable]:
    """Return the parts of a frame that an entry of `remove` names."""
    kind = _one_of(("remove", i), spec, ("member", "support", "mass", "spring"))
    frame, named = site.frame, getattr(spec, kind)
    if kind == "member":
        found = [member for member in frame.members if member.name == named]
        there = [member.name for member in frame.members]
    else:
        with at_key("remove", i, kind):
            xyz = np.array(site.point(named))
        parts: tuple[Any, ...] = getattr(frame, "masses" if kind == "mass" else f"{kind}s")
        near = (float(np.linalg.norm(place_xyz(frame, p.at) - xyz)) <= ON_MEMBER for p in parts)
        found = [part for part, here in zip(parts, near, strict=True) if here]
        there = list(dict.fromkeys(str(part.at) for part in parts))
    if not found:
        expected = ", ".join(there[:20]) or f"the model has no {kind}"
        raise BadKey(("remove", i, kind), f"there is no {kind} {str(named)!r}", expected)
    return found


def _exchanged(i: int, spec: ExchangeSpec, site: FrameSite, model: FrameSpec) -> list[Exchange]:
    """Return the members that an entry of `set` names, with what they become."""
    where = _one_of(("set", i), spec, ("member", "set"))
    name, frame = getattr(spec, where), site.frame
    known: Mapping[str, tuple[str, ...]] = {m.name: (m.name,) for m in frame.members}
    if where == "set":
        known = {s.name: s.members for s in frame.sets}
    if name not in known:
        raise BadKey(("set", i, where), f"there is no {where} {name!r}", ", ".join(known))
    if spec.section is None and spec.material is None:
        raise BadKey(("set", i), "nothing is set", "section or material")
    tables: dict[str, Any] = {"section": model.sections, "material": model.materials}
    for key, table in tables.items():
        if getattr(spec, key) is not None and getattr(spec, key) not in table:
            what = f"there is no {key} {getattr(spec, key)!r}"
            raise BadKey(("set", i, key), what, ", ".join(table))
    section = material = None
    if spec.section is not None:
        made = section_of(model.sections[spec.section], model.plane, model.beam)
        section = replace(made, name=spec.section)
    if spec.material is not None:
        m = model.materials[spec.material]
        material = Material(m.E, m.nu, m.rho, spec.material)
    return [Exchange(member, section, material) for member in known[name]]
