"""Say in keys of `case.toml` what a frame is: the way back from `frames`."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, astuple, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from femubench.core.case.faults import BadKey
from femubench.core.case.files import LARGEST_TEXT, CaseFiles
from femubench.core.case.frame_tables import FrameTables
from femubench.core.case.frames import CONSTANTS, section_of
from femubench.core.case.schema import FrameSpec, MaterialSpec, MemberSpec, SectionSpec
from femubench.core.errors import InputError
from femubench.core.fem.frame import Factor, Frame, Member, Place, Plane, RigidEnd
from femubench.core.fem.nominal import MAY_VANISH
from femubench.core.fem.sections import SHAPES, BoxKappa, CircleKappa, Section, ShearCoefficients
from femubench.core.fem.structure import Structure
from femubench.core.files import read_text

Keys: TypeAlias = dict[str, Any]
_LONGEST = 80


@dataclass(frozen=True)
class Known:
    """What the file of a case says beyond its frame: names, sizes of shapes, the share of noise."""

    sections: Mapping[str, SectionSpec] = field(default_factory=dict)
    materials: Mapping[str, MaterialSpec] = field(default_factory=dict)
    members: tuple[MemberSpec, ...] = ()
    shape_std: float | None = None

    def names(self, kind: str) -> dict[str, str]:
        """Return the name of every member's ``section`` or ``material``."""
        return {member.name: getattr(member, kind) for member in self.members}


def read_known(file: Path) -> Known:
    """Return what a `case.toml` says; nothing where it is not there or not a case."""
    try:
        data = tomllib.loads(read_text(file, LARGEST_TEXT))
        spec = FrameTables(CaseFiles(file.parent)).spec(data)
    except (InputError, BadKey, ValueError, RecursionError):  # not TOML, or not the keys of a case
        return Known()
    share = spec.measurement.shape_std
    if not isinstance(spec.model, FrameSpec):
        return Known(shape_std=share)
    return Known(spec.model.sections, spec.model.materials, spec.model.members, share)


def name_tables(
    contents: Sequence[tuple[str, Keys]],
    own: Mapping[str, str],
    tables: Mapping[str, Keys],
    plain: str,
) -> tuple[list[str], dict[str, Keys]]:
    """Return the name that every member uses, and the tables of these names.

    A content keeps the name it had. A new one takes the name of what it replaces, unless others
    still bear it: then the member's name follows, as in ``aluminium-front-left``.

    Arguments:
        contents: the member's name and the content of its table, for every member.
        own: the name that a member used before.
        plain: a name for what never had one.
    """
    found: list[str | None] = []
    for member, content in contents:
        alike = [name for name, table in tables.items() if table == content]
        found.append(own[member] if own.get(member) in alike else next(iter(alike), None))
    bases = [own.get(member, plain) for member, _ in contents]
    pairs = {(base, tuple(c.items())) for base, (_, c) in zip(bases, contents, strict=True)}
    taken = {name for name in found if name is not None}
    new: dict[tuple[object, ...], str] = {}
    names, result = [], {}
    for name, base, (member, content) in zip(found, bases, contents, strict=True):
        key = tuple(content.items())
        chosen = name or new.get(key)
        if chosen is None:
            alone = sum(base == other for other, _ in pairs) == 1
            free = base if alone else f"{base}-{member}"
            chosen, count = free[:_LONGEST].rstrip(), 1
            while chosen in taken:
                count += 1
                chosen = f"{free[: _LONGEST - 8].rstrip()}-{count}"
            new[key] = chosen
        names.append(chosen)
        result[chosen] = content
        taken.add(chosen)
    return names, result


def describe_frame(structure: Structure) -> Frame:
    """Return the frame with all parameter changes turned into factors, joint springs, rigid ends.

    Raises:
        BadKey: for a value that no key of a frame can have.
    """
    frame = structure.frame
    springs = {f"{s.member}@{s.joint}": s for s in frame.joint_springs}
    ends = {f"{end.member}@{end.joint}": end for end in frame.rigid_ends}
    factors: dict[tuple[str, str], float] = {}
    for parameter, value in structure.changes:
        quantity, places = parameter.quantity, parameter.places
        possible = value > 0.0 or (value == 0.0 and quantity in (*MAY_VANISH, "spring"))
        if not np.isfinite(value) or not (possible or quantity == "rigid") or "" in places:
            what = f"{parameter.name} = {value:g} cannot be written as a key of a frame"
            expected = "values > 0 of factors, >= 0 of springs, on members of the frame"
            raise BadKey(("model",), what, expected)
        for place in dict.fromkeys(places):
            if quantity == "spring":
                end, _, direction = place.rpartition(":")
                stiffness = {**springs[end].stiffness, direction: value}
                springs[end] = replace(springs[end], stiffness=stiffness)
            elif quantity == "rigid":
                member, _, joint = place.rpartition("@")
                old = ends.get(place, RigidEnd(joint, member, 0.0))
                ends[place] = replace(old, stiffness_length=value)
            else:
                factors[quantity, place] = factors.get((quantity, place), 1.0) * value
    groups: dict[tuple[str, float], list[str]] = {}
    for (quantity, place), factor in factors.items():
        if factor != 1.0:
            groups.setdefault((quantity, factor), []).append(place)
    written = (
        Factor(quantity, _shorten(structure, places), factor)
        for (quantity, factor), places in groups.items()
    )
    return replace(
        frame,
        joint_springs=tuple(springs.values()),
        rigid_ends=tuple(ends.values()),
        factors=(*frame.factors, *written),
    )


def _shorten(structure: Structure, places: Sequence[str]) -> tuple[str, ...]:
    """Return ``all`` for every element of the frame, a member's name for all elements of it."""
    rest = dict.fromkeys(places)
    short: list[str] = []
    for member, labels in structure.member_labels.items():
        if all(label in rest for label in labels):
            short.append(member)
        else:
            short += [label for label in labels if label in rest]
    return ("all",) if short == list(structure.member_labels) else tuple(short)


_SAME_KAPPA = 1e-13
_ANY_NU = 0.3  # a section of case.toml has the kappa of its shape or one number for every nu


def frame_keys(frame: Frame, known: Known, spare: Sequence[Member] = ()) -> tuple[Keys, list[Keys]]:
    """Return the table `[model]` of a frame as plain data, every key that is not its default.

    Arguments:
        frame: any frame; its fields bear the names of the keys.
        known: names and sizes from the file of the case that it comes from.
        spare: members by other names, in sections and materials that it keeps for them.

    Returns:
        the table, and the tables of the spare members.

    Raises:
        BadKey: when a section cannot be said in keys, with a path from the top of the file.
    """
    # A beam without length is no arm, and the reader takes none.
    springs = (replace(s, arm_factor=s.arm_factor if s.arm else None) for s in frame.joint_springs)
    plain = keys_of(replace(frame, joint_springs=tuple(springs)), without=("members", "families"))
    everyone = (*frame.members, *spare)
    own = known.names("section") | {member.name: member.section.name for member in spare}
    contents, seen = [], dict[tuple[int, float, str], Keys]()
    for member in everyone:
        name = own.get(member.name, "")
        key = id(member.section), member.material.nu, name
        if key not in seen:
            hint = known.sections.get(name)
            try:
                seen[key] = section_keys(member.section, member.material.nu, frame.plane, hint)
            except BadKey as fault:
                what = f"member {member.name!r}: {fault.what}"
                raise BadKey(("model", "sections"), what, fault.expected) from None
        contents.append((member.name, seen[key]))
    tables = {}
    for name, spec in known.sections.items():
        try:
            section = section_of(spec, frame.plane, "euler-bernoulli")
        except BadKey:
            continue
        tables[name] = section_keys(section, _ANY_NU, frame.plane, spec)
    sections, section_tables = name_tables(contents, own, tables, "section")
    contents = [(member.name, keys_of(member.material, without=("name",))) for member in everyone]
    tables = {name: spec.model_dump() for name, spec in known.materials.items()}
    own = known.names("material") | {member.name: member.material.name for member in spare}
    materials, material_tables = name_tables(contents, own, tables, "material")
    members = [
        {
            **keys_of(member, without=("section", "material")),
            "elements": int(member.elements),
            "section": section,
            "material": material,
        }
        for member, section, material in zip(everyone, sections, materials, strict=True)
    ]
    members, others = members[: len(frame.members)], members[len(frame.members) :]
    head = {key: value for key, value in plain.items() if not isinstance(value, list)}
    lists = {key: value for key, value in plain.items() if isinstance(value, list)}
    tables = {"materials": material_tables, "sections": section_tables}
    whole = {"joints": lists.pop("joints"), "members": members, **lists}
    return {"kind": "frame", **head, **tables, **whole}, others


def keys_of(item: Any, without: Collection[str] = ()) -> Keys:  # noqa: ANN401 - see below
    """Return the fields that differ from their defaults, as what TOML can hold.

    Arguments:
        item: any of the dataclasses of `fem.frame`.
    """
    keys = {}
    for f in fields(item):
        if f.name not in without:
            value = _plain(getattr(item, f.name))
            if f.default is MISSING or value != _plain(f.default):
                keys[f.name] = value
    return keys


def _plain(value: object) -> Any:  # noqa: ANN401 - what TOML can hold
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, Place):
        return value.joint or {"member": value.member, "s": _plain(value.s)}
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list, np.ndarray)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    return float(value) if isinstance(value, (int, float, np.number)) else keys_of(value)


def section_keys(section: Section, nu: float, plane: Plane, hint: SectionSpec | None) -> Keys:
    """Return the table of a section: its shape with what differs from it, or numbers.

    Arguments:
        nu: Poisson's ratio of the material, for a shear coefficient that no key can say.
        hint: a table with the shape and the sizes that the section may have had.

    Raises:
        BadKey: when the shear coefficients of a frame in 3d differ in a way that no shape has.
    """
    best, least = None, np.inf
    candidates = list(_recover_sizes(section))
    if hint is not None and hint.shape is not None and hint.shape in SHAPES:
        sizes = {key: getattr(hint, key) for key in SHAPES[hint.shape][1]}
        candidates[:0] = [] if None in sizes.values() else [(hint.shape, sizes)]
    for shape, sizes in candidates:
        made = SHAPES[shape][0](**sizes)
        if (made.shape, made.width, made.height) != (section.shape, section.width, section.height):
            continue
        differ = {key: float(getattr(section, key)) for key in CONSTANTS}
        differ = {key: value for key, value in differ.items() if value != getattr(made, key)}
        gap = _kappa_gap(made.kappa, section.kappa)
        if section.kappa is not None and gap > _SAME_KAPPA:
            differ["kappa"] = _kappa(section.kappa, nu, plane)
        # What is the same but for rounding is as good as anything but the very same.
        score = len(differ) + (0.5 if 0.0 < gap <= _SAME_KAPPA else 0.0)
        if score < least:
            best, least = {"shape": shape, **sizes, **differ}, score
        if score == 0.0:
            break
    if best is not None:
        return best
    numbers: Keys = {key: float(getattr(section, key)) for key in CONSTANTS}
    if section.kappa is not None:
        numbers["kappa"] = _kappa(section.kappa, nu, plane)
    return {key: value for key, value in numbers.items() if value != 0.0}


def _recover_sizes(section: Section) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield shapes with sizes that the section may come from, short numbers first."""
    width, height = section.width, section.height
    if width is None or height is None:
        return
    square = width == height
    if section.shape == "solid-rectangle":
        sizes = {"width": width} if square else {"width": width, "height": height}
        yield "solid-square" if square else "solid-rectangle", sizes
    elif section.shape == "round-tube":
        yield "solid-circle", {"diameter": width}
        for wall in _walls(section, width, height):
            yield "round-tube", {"diameter": width, "wall": wall}
    elif section.shape == "rectangular-tube":
        for wall in _walls(section, width, height):
            if square:
                yield "square-tube", {"width": width, "wall": wall}
            else:
                yield "rectangular-tube", {"width": width, "height": height, "wall": wall}


def _walls(section: Section, width: float, height: float) -> Iterator[float]:
    """Yield wall thicknesses that the shear coefficient or the area of a tube tells of."""
    walls, kappa = [section.wall], section.kappa
    if isinstance(kappa, BoxKappa):
        # It knows the centre-line sizes; the wall is what both of them round from.
        pairs = [(width, kappa.b), (height, kappa.h)]
        low = max(outer - line - np.spacing(line) / 2 for outer, line in pairs)
        high = min(outer - line + np.spacing(line) / 2 for outer, line in pairs)
        walls[:0] = [(low + high) / 2, low, high]
    elif isinstance(kappa, CircleKappa):
        walls[:0] = [(1.0 - kappa.ratio) * width / 2]
    for wall in walls:
        for digits in range(3, 18):
            rounded = float(f"{wall:.{digits}g}")
            if 0.0 < rounded < min(width, height) / 2:
                yield rounded


def _kappa_gap(one: ShearCoefficients | None, other: ShearCoefficients | None) -> float:
    """Return how far the shear coefficients of two sections of one shape are apart, relative."""
    if one is other:
        return 0.0
    if not (isinstance(one, BoxKappa | CircleKappa) and type(one) is type(other)):
        return float("inf")
    sizes, others = np.array(astuple(one)), np.array(astuple(other))
    return float(np.abs(sizes - others).max() / max(np.abs(sizes).max(), 1e-300))


def _kappa(kappa: ShearCoefficients, nu: float, plane: Plane) -> float:
    """Return the shear coefficient as the one number that a table can hold."""
    along_y, along_z = kappa(nu)
    if plane == "3d" and along_y != along_z:
        what = f"shear coefficients {along_y:g} along y and {along_z:g} along z cannot be written"
        raise BadKey((), what, "those of a shape, or one number")
    return float(along_z)
