"""Say in keys of `case.toml` what a frame is: the way back from `frames` and `sections`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import MISSING, fields, replace
from functools import partial
from typing import Any

import numpy as np

from femubench.core.case.faults import Fault
from femubench.core.case.naming import Keys, Known, named_tables
from femubench.core.case.schema import SectionSpec
from femubench.core.case.sections import section_of
from femubench.core.fem.frame import Frame, Member, Place, Plane
from femubench.core.fem.sections import (
    SHAPES,
    Section,
    ShearCoefficients,
    constant_kappa,
    rectangular_tube,
    round_tube,
)

_CONSTANTS = ("A", "Iy", "Iz", "J", "Jp")
_SIZES = ("width", "height", "diameter", "wall")
_SAME_KAPPA = 1e-13
_ANY_NU = 0.3  # a section of case.toml has the kappa of its shape or one number for every nu


def frame_keys(frame: Frame, known: Known) -> Keys:
    """Return the table `[model]` of a frame as plain data, every key that is not its default.

    Arguments:
        frame: any frame; its fields bear the names of the keys.
        known: names and sizes from the file of the case that it comes from.

    Raises:
        Fault: when a section cannot be said in keys, with a path from the top of the file.
    """
    # A beam without length is no arm, and the reader takes none.
    springs = (replace(s, arm_factor=s.arm_factor if s.arm else None) for s in frame.joint_springs)
    plain = keys_of(replace(frame, joint_springs=tuple(springs)), without=("members",))
    sections, section_tables = _sections(frame, known)
    materials, material_tables = _materials(frame, known)
    members = [
        {
            **keys_of(member, without=("section", "material")),
            "elements": int(member.elements),
            "section": section,
            "material": material,
        }
        for member, section, material in zip(frame.members, sections, materials, strict=True)
    ]
    head = {key: value for key, value in plain.items() if not isinstance(value, list)}
    lists = {key: value for key, value in plain.items() if isinstance(value, list)}
    tables = {"materials": material_tables, "sections": section_tables}
    whole = {"joints": lists.pop("joints"), "members": members, **lists}
    return {"kind": "frame", **head, **tables, **whole}


def keys_of(item: Any, without: Collection[str] = ()) -> Keys:  # noqa: ANN401 - see below
    """Return the fields that differ from their defaults, as what TOML can hold.

    Arguments:
        item: any of the dataclasses of `fem.frame`.
        without: fields to leave out.
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
        return (
            value.joint
            if value.joint is not None
            else {"member": value.member, "s": _plain(value.s)}
        )
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list, np.ndarray)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    return float(value) if isinstance(value, (int, float, np.number)) else keys_of(value)


def _materials(frame: Frame, known: Known) -> tuple[list[str], dict[str, Keys]]:
    contents = [(member.name, keys_of(member.material)) for member in frame.members]
    contents = [(name, {k: float(v) for k, v in keys.items()}) for name, keys in contents]
    tables = {name: {k: float(v) for k, v in spec} for name, spec in known.materials.items()}
    return named_tables(contents, _own(frame, known, "material"), tables, "material")


def _sections(frame: Frame, known: Known) -> tuple[list[str], dict[str, Keys]]:
    own = _own(frame, known, "section")
    contents, seen = [], dict[tuple[int, float, str], Keys]()
    for member in frame.members:
        name = own.get(member.name, "")
        key = id(member.section), member.material.nu, name
        if key not in seen:
            seen[key] = _section_keys(member, frame.plane, known.sections.get(name))
        contents.append((member.name, seen[key]))
    tables = {}
    for name, spec in known.sections.items():
        try:
            section = section_of(spec, frame.plane, "euler-bernoulli")
        except Fault:
            continue
        tables[name] = section_keys(section, _ANY_NU, frame.plane, spec)
    return named_tables(contents, own, tables, "section")


def _own(frame: Frame, known: Known, kind: str) -> dict[str, str]:
    """Return the name that every member's section or material had."""
    names = ((member.name, known.name_of(kind, member.name)) for member in frame.members)
    return {member: name for member, name in names if name is not None}


def _section_keys(member: Member, plane: Plane, hint: SectionSpec | None) -> Keys:
    try:
        return section_keys(member.section, member.material.nu, plane, hint)
    except Fault as fault:
        what = f"member {member.name!r}: {fault.what}"
        raise Fault(("model", "sections"), what, fault.expected) from None


def section_keys(section: Section, nu: float, plane: Plane, hint: SectionSpec | None) -> Keys:
    """Return the table of a section: its shape with what differs from it, or numbers.

    Arguments:
        section: any section.
        nu: Poisson's ratio of the material, for a shear coefficient that no key can say.
        plane: of the frame.
        hint: a table with the shape and the sizes that the section may have had.

    Raises:
        Fault: when the shear coefficients of a frame in 3d differ in a way that no shape has.
    """
    best, least = None, np.inf
    for shape, sizes in (*_hinted(hint), *_recovered(section)):
        made = SHAPES[shape][0](**sizes)
        if (made.shape, made.width, made.height) != (section.shape, section.width, section.height):
            continue
        differ = {key: _number(section, key) for key in _CONSTANTS}
        differ = {key: value for key, value in differ.items() if value != _number(made, key)}
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
    numbers: Keys = {key: _number(section, key) for key in _CONSTANTS}
    if section.kappa is not None:
        numbers["kappa"] = _kappa(section.kappa, nu, plane)
    return {key: value for key, value in numbers.items() if value != 0.0}


def _number(section: Section, key: str) -> float:
    return float(getattr(section, key))


def _hinted(hint: SectionSpec | None) -> Iterator[tuple[str, dict[str, float]]]:
    shape = None if hint is None else hint.shape
    if shape is not None and shape in SHAPES:
        sizes = {key: getattr(hint, key) for key in SHAPES[shape][1]}
        if None not in sizes.values():
            yield shape, sizes


def _recovered(section: Section) -> Iterator[tuple[str, dict[str, float]]]:
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
    for wall in (*_walls_of_kappa(section, width, height), _wall_of_area(section, width, height)):
        for digits in range(3, 18):
            rounded = float(f"{wall:.{digits}g}")
            if 0.0 < rounded < min(width, height) / 2:  # nan compares false
                yield rounded


def _walls_of_kappa(section: Section, width: float, height: float) -> Iterator[float]:
    kappa, wall = section.kappa, min(width, height) / 4
    box, ring = rectangular_tube(width, height, wall).kappa, round_tube(width, wall).kappa
    if not isinstance(kappa, partial):
        return
    if isinstance(box, partial) and kappa.func is box.func:
        # It knows the centre-line sizes; the wall is what both of them round from.
        pairs = [(width, kappa.args[0]), (height, kappa.args[1])]
        low = max(outer - line - np.spacing(line) / 2 for outer, line in pairs)
        high = min(outer - line + np.spacing(line) / 2 for outer, line in pairs)
        yield from (float((low + high) / 2), float(low), float(high))
    elif isinstance(ring, partial) and kappa.func is ring.func:
        yield float((1.0 - kappa.args[0]) * width / 2)  # inner over outer radius


def _wall_of_area(section: Section, width: float, height: float) -> float:
    with np.errstate(invalid="ignore"):
        if section.shape == "round-tube":
            return float(width / 2 - np.sqrt(width**2 / 4 - section.A / np.pi))
        return float((width + height - np.sqrt((width + height) ** 2 - 4 * section.A)) / 4)


def _kappa_gap(one: ShearCoefficients | None, other: ShearCoefficients | None) -> float:
    """Return how far two shear coefficients are apart: `partial` objects are never equal."""
    if one is other:
        return 0.0
    if not (isinstance(one, partial) and isinstance(other, partial) and one.func is other.func):
        return float("inf")
    apart = np.array(one.args) - np.array(other.args)
    return float(np.abs(apart).max(initial=0.0) / max(np.abs(one.args).max(initial=0.0), 1e-300))


def _kappa(kappa: ShearCoefficients, nu: float, plane: Plane) -> float:
    """Return the shear coefficient as the one number that a table can hold."""
    constant = constant_kappa(1.0)
    if isinstance(kappa, partial) and isinstance(constant, partial) and kappa.func is constant.func:
        return float(kappa.args[0])
    along_y, along_z = kappa(nu)
    if plane == "3d" and along_y != along_z:
        what = f"shear coefficients {along_y:g} along y and {along_z:g} along z cannot be written"
        raise Fault((), what, "those of a shape, or one number")
    return float(along_z)
