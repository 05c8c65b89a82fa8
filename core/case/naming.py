"""Name the sections and materials of a frame, which knows them by their content alone."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from femubench.core.case.files import read_text
from femubench.core.case.schema import FrameSpec, MaterialSpec, MemberSpec, SectionSpec, parse_spec
from femubench.core.errors import InputError

Keys: TypeAlias = dict[str, Any]
_LONGEST = 80


@dataclass(frozen=True)
class Known:
    """What the file of a case says beyond its frame: names, sizes of shapes, the share of noise."""

    sections: Mapping[str, SectionSpec] = field(default_factory=dict)
    materials: Mapping[str, MaterialSpec] = field(default_factory=dict)
    members: Mapping[str, MemberSpec] = field(default_factory=dict)
    shape_std: float | None = None

    def name_of(self, kind: str, member: str) -> str | None:
        """Return the name of a member's ``section`` or ``material``."""
        spec = self.members.get(member)
        return None if spec is None else str(getattr(spec, kind))


def known_from(file: Path) -> Known:
    """Return what a `case.toml` says; nothing where it is not there or not a case."""
    try:
        spec = parse_spec(tomllib.loads(read_text(file)))
    except (InputError, ValueError, RecursionError):  # not TOML, or not the keys of a case
        return Known()
    share = spec.measurement.shape_std
    if not isinstance(spec.model, FrameSpec):
        return Known(shape_std=share)
    members = {member.name: member for member in spec.model.members}
    return Known(spec.model.sections, spec.model.materials, members, share)


def named_tables(
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
        tables: what the names meant before.
        plain: a name for what never had one.
    """
    found = [_known_name(content, own.get(member), tables) for member, content in contents]
    bases = [own.get(member, plain) for member, _ in contents]
    pairs = {(base, _frozen(c)) for base, (_, c) in zip(bases, contents, strict=True)}
    taken = {name for name in found if name is not None}
    new: dict[tuple[object, ...], str] = {}
    names, result = [], {}
    for name, base, (member, content) in zip(found, bases, contents, strict=True):
        key = _frozen(content)
        chosen = name or new.get(key)
        if chosen is None:
            alone = sum(base == other for other, _ in pairs) == 1
            chosen = new[key] = _free_name(base if alone else f"{base}-{member}", taken)
        names.append(chosen)
        result[chosen] = content
        taken.add(chosen)
    return names, result


def _known_name(content: Keys, own: str | None, tables: Mapping[str, Keys]) -> str | None:
    if own is not None and tables.get(own) == content:
        return own
    return next((name for name, table in tables.items() if table == content), None)


def _frozen(content: Keys) -> tuple[object, ...]:
    return tuple(content.items())


def _free_name(name: str, taken: set[str]) -> str:
    chosen, count = name[:_LONGEST].rstrip(), 1
    while chosen in taken:
        count += 1
        chosen = f"{name[: _LONGEST - 8].rstrip()}-{count}"
    return chosen
