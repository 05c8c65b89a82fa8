"""A frame as plain data: what differs from the nominal frame, read back field by field.

The classes that can cross are those named here and in the fields of `Frame`; every value is checked
against the type of its field. Of a section the shear coefficients cross as numbers for the
materials that it is used with: the function that gave them stays where it was written.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any, get_type_hints

import msgspec

from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame, Material, Member
from femubench.core.fem.sections import Section, TabulatedKappa
from femubench.core.run.plain_arrays import BytesError
from femubench.core.schema.validation import say_fault

# What a strategy may change of a frame; the rest says what kind of structure it is.
_KEPT = ("plane", "free", "damping", "sets", "families")
_CHANGED = tuple(field.name for field in fields(Frame) if field.name not in _KEPT)


@dataclass(frozen=True)
class _Section(Section):
    """A section with the shear coefficients (nu, along y, along z) of the materials in use."""

    kappa: tuple[tuple[float, float, float], ...] | None = None  # type: ignore[assignment]


@dataclass(frozen=True)
class _Member(Member):
    """A member with the numbers of its section and material."""

    section: int  # type: ignore[assignment]
    material: int  # type: ignore[assignment]


@dataclass(frozen=True)
class _Members:
    members: tuple[_Member, ...]
    sections: tuple[_Section, ...]
    materials: tuple[Material, ...]


def frame_to_plain(frame: Frame, nominal: Frame) -> dict[str, Any]:
    """Return what differs between two frames, as plain data and data classes of it."""
    changed = [name for name in _CHANGED if getattr(frame, name) is not getattr(nominal, name)]
    found = {name: getattr(frame, name) for name in changed}
    return {**found, "members": _numbered(frame.members)} if "members" in found else found


def frame_from_plain(data: object, nominal: Frame, most_elements: int) -> Frame:
    """Return the nominal frame with what differs.

    Arguments:
        data: from `frame_to_plain`, or from anybody.
        most_elements: that the members may be cut into together.

    Raises:
        BytesError: when it is something else.
    """
    if not isinstance(data, dict) or not set(data) <= set(_CHANGED):
        raise BytesError(f"a frame has other fields: {str(data)[:100]}")
    values = {name: read_part(_hints()[name], value, name) for name, value in data.items()}
    if "members" in values:
        values["members"] = _whole(values["members"])
    found = replace(nominal, **values)
    if not all(member.elements >= 1 for member in found.members):
        raise BytesError("a member has no element")
    if sum(member.elements for member in found.members) > most_elements:
        raise BytesError(f"the members have more than the {most_elements} elements of its arrays")
    return found


def read_part(kind: Any, data: object, name: str) -> Any:  # noqa: ANN401 - any type
    """Return plain data as a type.

    Raises:
        BytesError: in one line, naming the first thing that does not fit.
    """
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise BytesError(f"{name}{say_fault(kind, data, error)}") from None
    except ModelError as error:
        raise BytesError(f"{name}: {error}") from None


@cache
def _hints() -> Mapping[str, Any]:
    return {**get_type_hints(Frame), "members": _Members}


def _numbered(members: tuple[Member, ...]) -> _Members:
    """Return members with each section and material once."""
    sections: dict[int, tuple[int, Section, dict[float, tuple[float, float, float]]]] = {}
    materials: dict[int, tuple[int, Material]] = {}
    rows = []
    for member in members:
        section, nu = member.section, member.material.nu
        s, _, used = sections.setdefault(id(section), (len(sections), section, {}))
        if section.kappa is not None and nu not in used:
            along_y, along_z = section.kappa(nu)
            used[nu] = nu, float(along_y), float(along_z)
        m, _ = materials.setdefault(id(member.material), (len(materials), member.material))
        rows.append(_Member(**{**vars(member), "section": s, "material": m}))
    tabled = []
    for _, section, used in sections.values():
        kappa = None if section.kappa is None else tuple(used.values())
        tabled.append(_Section(**{**vars(section), "kappa": kappa}))
    return _Members(tuple(rows), tuple(tabled), tuple(one for _, one in materials.values()))


def _whole(found: _Members) -> tuple[Member, ...]:
    sections = []
    for item in found.sections:
        kappa = None if item.kappa is None else TabulatedKappa(item.kappa)
        sections.append(Section(**{**vars(item), "kappa": kappa}))
    for member in found.members:
        if not (
            0 <= member.section < len(sections) and 0 <= member.material < len(found.materials)
        ):
            raise BytesError(f"member {member.name[:100]!r} has no such section or material")
    return tuple(
        Member(m.name, m.ends, m.elements, sections[m.section], found.materials[m.material], m.up)
        for m in found.members
    )
