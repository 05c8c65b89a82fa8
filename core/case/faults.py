"""A fault in `case.toml`: where it is, what it is, what was expected."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

KeyPath = tuple[str | int, ...]
_LONGEST_VALUE = 60


class Fault(Exception):  # noqa: N818 - becomes an InputError before anybody sees it
    """A fault at a key; the reader adds file and line and makes an `InputError` of it.

    Arguments:
        path: keys and list positions from the top of the file.
        what: the fault.
        expected: what would have been right.
    """

    def __init__(self, path: KeyPath, what: str, expected: str | None = None) -> None:
        super().__init__(what)
        self.path, self.what, self.expected = path, what, expected


class Misfit(Exception):  # noqa: N818 - likewise
    """A place or direction that the structure does not have; has no key yet."""

    def __init__(self, what: str, expected: str) -> None:
        super().__init__(what)
        self.what, self.expected = what, expected


class WrongDirection(Misfit):
    """A direction in which the structure has no degree of freedom."""


@contextmanager
def at_key(*path: str | int) -> Iterator[None]:
    """Put a key path before the faults raised inside, and give a `Misfit` that path."""
    try:
        yield
    except Fault as fault:
        raise Fault((*path, *fault.path), fault.what, fault.expected) from None
    except Misfit as misfit:
        raise Fault(path, misfit.what, misfit.expected) from None


def dotted(path: KeyPath) -> str:
    """Return ``model.members[2].ends`` for a key path."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{_clipped(part)}"
    return text.lstrip(".")


def _clipped(text: str) -> str:
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."


def shown(value: object) -> str:
    """Return a value as text of one short line."""
    if isinstance(value, (dict, list, tuple)):
        return "a table" if isinstance(value, dict) else "a list"
    # The text of a whole number of thousands of digits is itself an error in Python.
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**_LONGEST_VALUE:
        return "a very large number"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return _clipped(text)


def first_fault(error: ValidationError, schema: type[BaseModel]) -> Fault:
    """Return the most telling of pydantic's findings in the words of the case format.

    A misspelt key is also a missing one; the spelling is named.
    """
    findings = error.errors(include_url=False)
    found = next((f for f in findings if f["type"] == "extra_forbidden"), findings[0])
    path, tag = tuple(found["loc"]), ""
    if path[:1] == ("model",) and len(path) > 1:
        # The second part is the tag of the union of the two kinds of model.
        path, tag = ("model", *path[2:]), str(path[1])
    owner, expected = _described(schema, path, tag)
    if path[-1] == "[key]":
        return Fault(path[:-1], f"{shown(found['input'])} is not allowed as a name", expected)
    kind, value = found["type"], found["input"]
    if kind in ("too_short", "too_long") or (kind == "missing" and isinstance(path[-1], int)):
        whole = path[:-1] if kind == "missing" else path
        return Fault(whole, "wrong number of entries", expected)
    if kind == "missing":
        return Fault(path, "missing key", expected)
    if kind == "extra_forbidden":
        near = get_close_matches(_clipped(str(path[-1])), owner.model_fields, n=1)
        hint = f"; is {near[0]!r} meant?" if near else ""
        return Fault(path, f"unknown key{hint}", f"one of {', '.join(owner.model_fields)}")
    if kind.startswith("union_tag"):
        what = "missing key" if kind == "union_tag_not_found" else f"unknown kind {_tag(value)}"
        return Fault(("model", "kind"), what, "'frame' or 'matrices'")
    if kind == "misfit":
        context: Mapping[str, Any] = found.get("ctx", {})
        return Fault(path, context["what"], context["expected"])
    return Fault(path, f"{shown(value)} is not allowed", expected)


def _tag(value: object) -> str:
    return shown(value.get("kind")) if isinstance(value, dict) else shown(value)


def _described(schema: type[BaseModel], path: KeyPath, tag: str) -> tuple[type[BaseModel], str]:
    """Return the table that holds the last key of a path, and what that key should be."""
    owner, expected = schema, "a table"
    inside_mapping = False
    for part in path:
        if isinstance(part, int) or inside_mapping:
            inside_mapping = False
            continue
        field = owner.model_fields.get(part)
        if field is None:
            break
        expected = field.description or expected
        tables = list(_tables(field.annotation))
        inside_mapping = _is_mapping(field.annotation)
        if tables and part != path[-1]:
            owner = next((t for t in tables if t.__name__.lower().startswith(tag)), tables[0])
    return owner, expected


def _tables(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _tables(argument)


def _is_mapping(annotation: object) -> bool:
    return getattr(annotation, "__origin__", None) is dict
