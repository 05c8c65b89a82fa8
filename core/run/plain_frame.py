"""A frame as plain data: what differs from the nominal frame, read back field by field.

The classes that can cross are those named here and in the fields of `Frame`; every value is checked
against the type of its field. Of a section the shear coefficients cross as numbers for the
materials that it is used with: the function that gave them stays where it was written.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from typing import Any, get_type_hints

from pydantic import TypeAdapter, ValidationError

from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame, Material, Member, Vector
from femubench.core.fem.sections import Section, TabulatedKappa
from femubench.core.run.plain_arrays import BytesError

# What a strategy may change of a frame; the rest says what kind of structure it is.
_KEPT = ("plane", "free", "sets", "families")
_CHANGED = tuple(field.name for field in fields(Frame) if field.name not in _KEPT)


@dataclass(frozen=True)
class _Section:
    """A section with the shear coefficients (nu, along y, along z) of the materials in use."""

    A: float
    Iy: float
    Iz: float
    J: float
    Jp: float
    kappa: tuple[tuple[float, float, float], ...] | None
    width: float | None
    height: float | None
    shape: str
    name: str


@dataclass(frozen=True)
class _Member:
    """A member with the numbers of its section and material."""

    name: str
    ends: tuple[str, str]
    elements: int
    section: int
    material: int
    up: Vector | None


@dataclass(frozen=True)
class _Members:
    members: tuple[_Member, ...]
    sections: tuple[_Section, ...]
    materials: tuple[Material, ...]


def frame_to_plain(frame: Frame, nominal: Frame) -> dict[str, Any]:
    """Return what differs between two frames, for `json.dumps`."""
    changed = [name for name in _CHANGED if getattr(frame, name) is not getattr(nominal, name)]
    found: dict[str, Any] = {}
    for name in changed:
        value = getattr(frame, name)
        if name == "members":
            found[name] = asdict(_numbered(value))
        elif isinstance(value, tuple):
            found[name] = [asdict(item) for item in value]
        else:
            found[name] = value
    return found


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
    values = {name: read_plain(_hints()[name], value, name) for name, value in data.items()}
    if "members" in values:
        values["members"] = _whole(values["members"])
    found = replace(nominal, **values)
    if not all(member.elements >= 1 for member in found.members):
        raise BytesError("a member has no element")
    if sum(member.elements for member in found.members) > most_elements:
        raise BytesError(f"the members have more than the {most_elements} elements of its arrays")
    return found


def read_plain(kind: Any, data: object, name: str) -> Any:  # noqa: ANN401 - any type
    """Return plain data as a type.

    Raises:
        BytesError: in one line, naming the first thing that does not fit.
    """
    try:
        return _reader(kind).validate_python(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        where = ".".join(str(part)[:100] for part in (name, *first["loc"]))
        raise BytesError(f"{where}: {first['msg']}") from None
    except ModelError as error:
        raise BytesError(f"{name}: {error}") from None


@cache
def _reader(kind: Any) -> TypeAdapter[Any]:  # noqa: ANN401
    return TypeAdapter(kind)


@cache
def _hints() -> Mapping[str, Any]:
    return {**get_type_hints(Frame), "members": _Members}


def _numbered(members: tuple[Member, ...]) -> _Members:
    sections: dict[int, tuple[Section, dict[float, tuple[float, float]]]] = {}
    materials: dict[int, Material] = {}
    numbers = {}, {}  # type: tuple[dict[int, int], dict[int, int]]
    rows = []
    for member in members:
        section, material = member.section, member.material
        _, used = sections.setdefault(id(section), (section, {}))
        if section.kappa is not None and material.nu not in used:
            along_y, along_z = section.kappa(material.nu)
            used[material.nu] = (float(along_y), float(along_z))
        materials.setdefault(id(material), material)
        s = numbers[0].setdefault(id(section), len(numbers[0]))
        m = numbers[1].setdefault(id(material), len(numbers[1]))
        rows.append(_Member(member.name, member.ends, member.elements, s, m, member.up))
    return _Members(
        tuple(rows),
        tuple(_tabled(section, used) for section, used in sections.values()),
        tuple(materials.values()),
    )


def _tabled(section: Section, used: Mapping[float, tuple[float, float]]) -> _Section:
    plain = {f.name: getattr(section, f.name) for f in fields(_Section)}
    table = tuple((nu, *pair) for nu, pair in used.items())
    return _Section(**{**plain, "kappa": None if section.kappa is None else table})


def _whole(found: _Members) -> tuple[Member, ...]:
    sections = []
    for item in found.sections:
        plain = {f.name: getattr(item, f.name) for f in fields(_Section)}
        kappa = None if item.kappa is None else TabulatedKappa(item.kappa)
        sections.append(Section(**{**plain, "kappa": kappa}))
    for member in found.members:
        if not (
            0 <= member.section < len(sections) and 0 <= member.material < len(found.materials)
        ):
            raise BytesError(f"member {member.name[:100]!r} has no such section or material")
    return tuple(
        Member(m.name, m.ends, m.elements, sections[m.section], found.materials[m.material], m.up)
        for m in found.members
    )
