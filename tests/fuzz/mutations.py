"""Break texts by their structure: tokens, numbers, lines, columns, entries of JSON."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable, Sequence
from typing import Any

from hypothesis import strategies as st

Edit = tuple[str, int, int, str]

_TOKEN = re.compile(r'"[^"\n]*"|[A-Za-z_][\w-]*|[-+]?\d[\w.+-]*|\s+|.', re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
NUMBERS = (
    *("0", "-0.0", "-1", "1", "2", "3", "7", "0.5", "nan", "inf", "-inf", "NaN", "Infinity"),
    *("1e400", "-1e400", "1e308", "1e-320", "1e30", "-1e30", "1e-30", "1e155", "1e16"),
    *("1E5", "1D5"),
    *("2147483648", "4294967296", "-2147483649", "9223372036854775808", "1000000000", "9" * 30),
    *("9" * 5000, "0x10", "1_000", "1e", "--1", "1.2.3", "1+2j", "1j", "true", "null", ""),
)
PIECES = (
    *("", "-", "[", "]", "{", "}", '"', "'", "\n", ",", "=", "#", ".", "@", "/", ":", "%", " "),
    *("\ufeff", "\x00", "\x1b[2J", "\x9b31m", "\u202e", "\u2028", "\r", "\r\n", "\x0c", "é", "𝛼"),
    *('"""', "[[", "]]", "    -1\n", "[" * 500, "a." * 60 + "b = 1\n", '{"a":' * 200, "x" * 3000),
    *("../case.toml", "/etc/passwd", "~/x.csv", "file:///etc/passwd", "..\\x", "case.toml", "."),
    *("!!python/object/apply:os.system", "__import__('os')", "${HOME}", "=1+1", "<script>", "|"),
    *("model", "joints", "members", "ends", "matrices", "frame", "3d", "in-plane", "all", "x"),
    "rz",
    *("%%MatrixMarket matrix array real general", "coordinate", "complex", "pattern", "hermitian"),
)


def edits(most: int = 4) -> st.SearchStrategy[list[Edit]]:
    """Return lists of edits: what to do, where, how much, what to put in."""
    place, amount = st.integers(0, 10**6), st.integers(0, 40)
    odd = st.sampled_from(PIECES) | st.text(max_size=8)
    numbers = st.sampled_from(NUMBERS) | st.floats().map(repr) | st.integers().map(str)
    anything = st.tuples(st.sampled_from(sorted(OPERATIONS)), place, amount, odd | numbers)
    figure = st.tuples(st.just("number"), place, amount, numbers)
    return st.lists(figure | anything, min_size=1, max_size=most)


def mutated(text: str, changes: Sequence[Edit]) -> bytes:
    """Return a text with edits made one after the other, as bytes that may be no UTF-8."""
    for operation, place, amount, new in changes:
        text = OPERATIONS[operation](text, place, amount, new)
    return text.encode("utf-8", errors="surrogateescape")


def _parts(split: Callable[[str], list[str]]) -> Callable[[Callable[..., None]], Any]:
    """Return a decorator that lets a function change a list of parts of the text."""

    def decorate(change: Callable[..., None]) -> Callable[[str, int, int, str], str]:
        def operation(text: str, place: int, amount: int, new: str) -> str:
            parts = split(text)
            if parts:
                change(parts, place % len(parts), amount, new)
            return "".join(parts)

        return operation

    return decorate


_tokens, _lines = _parts(_TOKEN.findall), _parts(lambda text: text.splitlines(keepends=True))


@_tokens
def _token(parts: list[str], at: int, amount: int, new: str) -> None:
    parts[at] = new


@_tokens
def _double(parts: list[str], at: int, amount: int, new: str) -> None:
    parts[at] *= 1 + amount


@_tokens
def _swap(parts: list[str], at: int, amount: int, new: str) -> None:
    other = (at + amount + 1) % len(parts)
    parts[at], parts[other] = parts[other], parts[at]


@_lines
def _drop_lines(parts: list[str], at: int, amount: int, new: str) -> None:
    del parts[at : at + 1 + amount % 3]


@_lines
def _repeat_line(parts: list[str], at: int, amount: int, new: str) -> None:
    parts[at : at + 1] = [parts[at]] * (1 + amount)


@_lines
def _move_line(parts: list[str], at: int, amount: int, new: str) -> None:
    line = parts.pop(at)
    parts.insert(amount % (len(parts) + 1), line)


@_lines
def _insert_line(parts: list[str], at: int, amount: int, new: str) -> None:
    parts.insert(at, new + "\n")


@_lines
def _column(parts: list[str], at: int, amount: int, new: str) -> None:
    """Take a column out, or put one in, from a line on."""
    for i in range(at, len(parts)):
        cells = parts[i].rstrip("\n").split(",")
        column = amount % len(cells)
        cells[column : column + 1] = [] if amount % 2 else [cells[column], new]
        parts[i] = ",".join(cells) + "\n"


def _number(text: str, place: int, amount: int, new: str) -> str:
    found = list(_NUMBER.finditer(text))
    if not found:
        return text
    one = found[place % len(found)]
    return text[: one.start()] + new + text[one.end() :]


def _cut(text: str, place: int, amount: int, new: str) -> str:
    return text[: place % (len(text) + 1)]


def _splice(text: str, place: int, amount: int, new: str) -> str:
    at = place % (len(text) + 1)
    return text[:at] + new + text[at + amount :]


def _bytes(text: str, place: int, amount: int, new: str) -> str:
    at = place % (len(text) + 1)
    return text[:at] + chr(0xDC80 + amount) + text[at:]


def _line_ends(text: str, place: int, amount: int, new: str) -> str:
    return text.replace("\n", "\r\n" if amount % 2 else "\r")


OPERATIONS: dict[str, Callable[[str, int, int, str], str]] = {
    "token": _token,
    "double": _double,
    "swap": _swap,
    "drop lines": _drop_lines,
    "repeat line": _repeat_line,
    "move line": _move_line,
    "insert line": _insert_line,
    "column": _column,
    "number": _number,
    "cut": _cut,
    "splice": _splice,
    "bytes": _bytes,
    "line ends": _line_ends,
}

_ODD_VALUES: tuple[object, ...] = (
    *(None, True, 0, -1, 1, 2.5, 1e308, -1e308, 1e-300, 10**400, 2**63, -(2**70), 1e155),
    *("", "ok", "failed", "unchanged", "x" * 2000, "\x1b[2J", "\u202e", "<script>", "|", "a\nb"),
    *([], {}, [None], {"": {}}, [[[[[[]]]]]], {"a": 1}, ["a", "a"], [1, 2], {"used": 1.0}),
)


def json_edits() -> st.SearchStrategy[list[tuple[list[int], str, object]]]:
    """Return lists of edits of JSON data: a path as choices, what to do, a value."""
    path = st.lists(st.integers(0, 10**4), min_size=1, max_size=7)
    what = st.sampled_from(["set", "set", "delete", "double", "wrap", "rename"])
    return st.lists(st.tuples(path, what, st.sampled_from(_ODD_VALUES)), min_size=1, max_size=3)


def changed_json(data: Any, changes: Sequence[tuple[list[int], str, object]]) -> Any:
    """Return JSON data with edits made one after the other."""
    data = json.loads(json.dumps(data))
    for path, what, value in changes:
        place, key = data, None
        for choice in path:
            inner = place if key is None else place[key]
            if not isinstance(inner, (dict, list)) or not inner:
                break
            place = inner
            key = sorted(inner)[choice % len(inner)] if isinstance(inner, dict) else None
            key = choice % len(inner) if key is None else key
        if key is not None:
            _change(place, key, what, copy.deepcopy(value))
    return data


def _change(place: Any, key: Any, what: str, value: object) -> None:
    if what == "delete":
        del place[key]
    elif what == "wrap":
        place[key] = [place[key]]
    elif what == "double" and isinstance(place, list):
        place.append(copy.deepcopy(place[key]))
    elif what == "rename" and isinstance(place, dict):
        place[str(value)] = place.pop(key)
    else:
        place[key] = value
