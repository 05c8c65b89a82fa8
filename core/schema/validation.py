"""Plain data and JSON against a class: the first field that is wrong comes out as one line."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from femubench.core.errors import InputError

_T = TypeVar("_T")
_WORDS = {
    **{"int": "a whole number", "float": "a number", "str": "a text", "bool": "true or false"},
    **{"object": "a table", "array": "a list", "null": "nothing", "None": "nothing"},
}


def read_plain(
    kind: type[_T],
    data: object,
    *,
    file: Path | str | None = None,
    line: int | None = None,
    key: str = "",
    hidden: str = "",
) -> _T:
    """Return plain data as an instance of a class, with every field checked.

    Arguments:
        kind: what `msgspec.convert` can make.
        file, line, key: where the data stand, for the message.
        hidden: a key of `data` that the file has not, and the message leaves out.

    Raises:
        InputError: naming the first field that is wrong.
    """
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        path, what, expected = find_fault(kind, data, error)
    path = (key + (path.replace(f".{hidden}.", ".", 1) if hidden else path)).lstrip(".")
    raise InputError(what, file=file, line=line, key=path or None, expected=expected)


def find_fault(
    kind: Any,  # noqa: ANN401 - any type
    data: object,
    error: msgspec.ValidationError,
) -> tuple[str, str, str | None]:
    """Return path, fault and expectation of an error that `msgspec.convert` raised.

    Arguments:
        kind, data: that it was given; without data a key of a mapping is not named.
    """
    # Behind " - at " stand names of fields alone, and dots for a key of a mapping.
    text, _, where = str(error).rpartition(" - at `")
    if not text:
        text, where = where, ""
    steps: list[Any] = []
    for name, number in re.findall(r"\.(\w+)|\[(\d+|\.\.\.)\]", where.partition("$")[2]):
        step = name or number
        steps.append(_culprit(kind, data, steps, str(error)) if step == "..." else step)
        if step.isdigit():
            steps[-1] = int(step)
    path = "".join(f"[{s}]" if isinstance(s, int) or s == "..." else f".{s}" for s in steps)
    missing = re.fullmatch(r"Object missing required field `(\w+)`", text)
    if missing:
        return f"{path}.{missing[1]}", "missing", None
    words = re.sub(
        r"`([A-Za-z| ]+)`", lambda m: " or ".join(_WORDS.get(w, w) for w in m[1].split(" | ")), text
    )
    expected, got, what = words.removeprefix("Expected ").partition(", got ")
    if not words.startswith("Expected "):
        return path, words.replace("Invalid enum value", "unknown value"), None
    if where.startswith("key") or not got:
        return path, "of another form" if "regex" in expected else "out of bounds", expected
    return path, what, expected


def say_fault(kind: object, data: object, error: msgspec.ValidationError) -> str:
    """Return path, fault and expectation of an error of `msgspec`, in one line."""
    path, what, expected = find_fault(kind, data, error)
    return f"{path}: {what}" + (f", expected {expected}" if expected else "")


def _culprit(kind: Any, data: object, steps: Sequence[Any], message: str) -> str:  # noqa: ANN401
    """Return the key of a mapping at which the same error is raised again, by halves of it."""
    table: Any = data
    for step in steps:
        table = table and table[step]
    names = list(table or {})
    while len(names) > 1:
        first = names[: len(names) // 2]
        try:
            msgspec.convert(_put(data, steps, {name: table[name] for name in first}), kind)
            found = ""
        except msgspec.ValidationError as error:
            found = str(error)
        names = first if found == message else names[len(first) :]
    return str(*names) or "..."


def _put(data: Any, steps: Sequence[Any], value: object) -> object:  # noqa: ANN401
    """Return plain data with another value at a place."""
    if not steps:
        return value
    changed = dict(data) if isinstance(data, Mapping) else list(data)
    changed[steps[0]] = _put(data[steps[0]], steps[1:], value)
    return changed
