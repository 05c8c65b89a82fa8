"""A fault in `case.toml`: where it is, what it is, what was expected."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from femubench.core.errors import InputError, clipped

KeyPath = tuple[str | int, ...]
_LONGEST_VALUE = 60


class BadKey(Exception):  # noqa: N818 - becomes an InputError before anybody sees it
    """A fault at a key; the reader adds file and line and makes an `InputError` of it.

    Arguments:
        path: keys and list positions from the top of the file.
    """

    def __init__(self, path: KeyPath, what: str, expected: str | None = None) -> None:
        super().__init__(what)
        self.path, self.what, self.expected = path, what, expected


@dataclass(frozen=True)
class Remedy:
    """Keys of a case with which a test fits its model, by the options of `bench init`."""

    keys: Mapping[str, str]

    def __str__(self) -> str:
        parts = []
        for key, value in self.keys.items():
            text = {"tolerance": value, "origin": f"[{value}]"}.get(key, f'"{value}"')
            text = str(value.split(",")) if key == "without" else text
            parts.append(f"{key.removeprefix('model-')} = {text}")
            parts[-1] += " of [model]" if key == "model-unit" else ""
        return " and ".join(parts)


class Misfit(Exception):  # noqa: N818 - likewise
    """A place or direction that the structure does not have; has no key yet."""

    def __init__(self, what: str, expected: str, remedy: Remedy | None = None) -> None:
        super().__init__(what)
        self.what, self.expected, self.remedy = what, expected, remedy

    def at(self, file: Path, line: int | None = None, key: str | None = None) -> InputError:
        """Return it as the error of a place in a file."""
        error = InputError(self.what, file=file, line=line, key=key, expected=self.expected)
        error.remedy = self.remedy
        return error


class WrongDirection(Misfit):
    """A direction in which the structure has no degree of freedom."""


@contextmanager
def at_key(*path: str | int) -> Iterator[None]:
    """Put a key path before the faults raised inside, and give a `Misfit` that path."""
    try:
        yield
    except BadKey as fault:
        raise BadKey((*path, *fault.path), fault.what, fault.expected) from None
    except Misfit as misfit:
        raise BadKey(path, misfit.what, misfit.expected) from None


def join_key_path(path: KeyPath) -> str:
    """Return ``model.members[2].ends`` for a key path."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{clipped(part, _LONGEST_VALUE)}"
    return text.lstrip(".")


def shorten_value(value: object) -> str:
    """Return a value as text of one short line."""
    if isinstance(value, (dict, list, tuple)):
        return "a table" if isinstance(value, dict) else "a list"
    # The text of a whole number of thousands of digits is itself an error in Python.
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**_LONGEST_VALUE:
        return "a very large number"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return clipped(text, _LONGEST_VALUE)


def first_fault(error: ValidationError, schema: type[BaseModel]) -> BadKey:
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
        return BadKey(
            path[:-1], f"{shorten_value(found['input'])} is not allowed as a name", expected
        )
    kind, value = found["type"], found["input"]
    context: Mapping[str, Any] = found.get("ctx", {})
    if kind == "too_long":
        most = f"{context.get('max_length')} at most"
        return BadKey(path, f"{context.get('actual_length') or 'too many'} entries", most)
    if kind == "too_short" or (kind == "missing" and isinstance(path[-1], int)):
        whole = path[:-1] if kind == "missing" else path
        return BadKey(whole, "wrong number of entries", expected)
    if kind == "missing":
        return BadKey(path, "missing key", expected)
    if kind == "extra_forbidden":
        near = get_close_matches(clipped(str(path[-1]), _LONGEST_VALUE), owner.model_fields, n=1)
        hint = f"; is {near[0]!r} meant?" if near else ""
        return BadKey(path, f"unknown key{hint}", f"one of {', '.join(owner.model_fields)}")
    if kind.startswith("union_tag"):
        kind_given = shorten_value(value.get("kind") if isinstance(value, dict) else value)
        missing = kind == "union_tag_not_found"
        what = "missing key" if missing else f"unknown kind {kind_given}"
        return BadKey(("model", "kind"), what, "'frame', 'matrices' or 'file'")
    if kind == "misfit":
        return BadKey(path, context["what"], context["expected"])
    return BadKey(path, f"{shorten_value(value)} is not allowed", expected)


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
        inside_mapping = getattr(field.annotation, "__origin__", None) is dict
        if tables and part != path[-1]:
            owner = next((t for t in tables if t.__name__.lower().startswith(tag)), tables[0])
    return owner, expected


def _tables(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _tables(argument)


_BLANK = re.compile(r"[ \t\r\n]*(?:#[^\n]*[ \t\r\n]*)*")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ONE_LINE = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'')
_MANY_LINES = re.compile(r'"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}', re.DOTALL)
_SCALAR = re.compile(r"[^,\]}#\n]*")


def key_lines(text: str) -> dict[KeyPath, int]:
    """Return the line, from 1, of every key and list entry of a valid TOML text."""
    scanner = _Scanner(text)
    scanner.document()
    return scanner.lines


def line_of(lines: dict[KeyPath, int], path: KeyPath) -> int | None:
    """Return the line of a key path, or of the nearest table above it that has one."""
    while path:
        if path in lines:
            return lines[path]
        path = path[:-1]
    return None


class _Scanner:
    """Walks over a text that `tomllib` has accepted and notes where keys stand."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.breaks = [i for i, letter in enumerate(text) if letter == "\n"]
        self.lines: dict[KeyPath, int] = {}
        self.counts: dict[KeyPath, int] = {}

    def note(self, path: KeyPath, position: int) -> None:
        self.lines.setdefault(path, bisect_right(self.breaks, position) + 1)

    def skip(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self.text, self.at)
        found = match.group() if match else ""
        self.at += len(found)
        return found

    def peek(self, length: int = 1) -> str:
        return self.text[self.at : self.at + length]

    def document(self) -> None:
        table: KeyPath = ()
        self.skip(_BLANK)
        while self.at < len(self.text):
            if self.peek() == "[":
                table = self.header()
            else:
                self.pair(table)
            self.skip(_BLANK)

    def header(self) -> KeyPath:
        start, listed = self.at, self.peek(2) == "[["
        self.at += 2 if listed else 1
        *above, last = self.key()
        self.at += 2 if listed else 1
        path: KeyPath = ()
        for part in above:
            path = self.newest((*path, part))
        path = (*path, last)
        if listed:
            self.counts[path] = self.counts.get(path, 0) + 1
        self.note(path, start)
        path = self.newest(path)
        self.note(path, start)
        return path

    def newest(self, path: KeyPath) -> KeyPath:
        """Return the path of a table, or of the last entry of a list of tables."""
        return (*path, self.counts[path] - 1) if path in self.counts else path

    def key(self) -> list[str]:
        parts = []
        while True:
            self.skip(_BLANK)
            quoted = self.peek() in ("'", '"')
            raw = self.skip(_ONE_LINE if quoted else _BARE)
            parts.append(tomllib.loads(f"k = {raw}")["k"] if quoted else raw)
            self.skip(_BLANK)
            if self.peek() != ".":
                return parts
            self.at += 1

    def pair(self, table: KeyPath) -> None:
        start = self.at
        path = table
        for part in self.key():
            path = (*path, part)
            self.note(path, start)
        self.at += 1  # the equals sign
        self.value(path)

    def value(self, path: KeyPath) -> None:
        self.skip(_BLANK)
        opening = self.peek()
        if opening in ("[", "{"):
            self.at += 1
            self.entries(path, "]" if opening == "[" else "}")
        elif self.peek(3) in ('"""', "'''"):
            self.skip(_MANY_LINES)
        else:
            self.skip(_ONE_LINE if opening in ("'", '"') else _SCALAR)

    def entries(self, path: KeyPath, closing: str) -> None:
        """Walk over the entries of a list or of an inline table."""
        index = 0
        self.skip(_BLANK)
        while self.peek() != closing and self.at < len(self.text):
            if closing == "]":
                self.note((*path, index), self.at)
                self.value((*path, index))
                index += 1
            else:
                self.pair(path)
            self.skip(_BLANK)
            if self.peek() == ",":
                self.at += 1
                self.skip(_BLANK)
        self.at += 1
