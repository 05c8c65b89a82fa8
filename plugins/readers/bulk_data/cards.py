"""Cards of Nastran bulk data: free, small and large fields, continuations, included files."""

from __future__ import annotations

import math
import re
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from femubench import InputError

LARGEST = 64  # MiB of a file with all that it includes
_MOST_LINES = 500_000  # likewise
_MOST_FILES = 100
_HIGHEST_ID = 99_999_999
_LARGEST_NUMBER = 1e30
_SMALL, _LARGE = 8, 16  # characters of a field
_INTEGER = re.compile(r"[+-]?\d{1,15}")
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d{1,3})|[eEdD](\d{1,3}))?")
_ENDS = re.compile(rb"\r\n?|\n")
_NAME = re.compile(r"[A-Z][A-Z0-9]{0,7}")
_BEGIN = re.compile(r"\s*BEGIN\b", re.IGNORECASE)
_BULK = re.compile(r"\s*BEGIN[\s,]*BULK\s*", re.IGNORECASE)
_ANSYS = re.compile(r"/[A-Za-z]{2,}")
_KEYWORD = re.compile(r"\*[A-Za-z]{3,}")  # of Abaqus and CalculiX; in Nastran a continuation
_ONE_SECTION = "BEGIN BULK, and all of the structure in it"
_INCLUDE = re.compile(r"""\s*INCLUDE\s*['"]?([^'"]+?)['"]?\s*""", re.IGNORECASE)
_CHOICE = re.compile(r"\s*(SPC|MPC)\s*=\s*(\d{1,8})\s*", re.IGNORECASE)

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Card:
    """One card: its name, its data fields without those of continuation, and where it stands.

    Arguments:
        name: upper case, without the star of large fields.
        fields: stripped texts, eight to a row; those behind the last one are blank.
        first, last: its lines there, from 0.
    """

    name: str
    fields: tuple[str, ...]
    file: Path
    first: int
    last: int

    def __str__(self) -> str:
        return f"{self.name} {self.text(1)}".rstrip()

    def error(self, what: str, expected: str | None = None, key: str = "") -> InputError:
        """Return the error of something that is wrong with the card."""
        where = f"{self}, {key}" if key else str(self)
        return InputError(what, file=self.file, line=self.first + 1, key=where, expected=expected)

    def text(self, number: int) -> str:
        """Return a data field, counted from 1, rows of eight one after the other."""
        return self.fields[number - 1] if number <= len(self.fields) else ""

    def is_integer(self, number: int) -> bool:
        """Tell whether a field holds a whole number."""
        return _INTEGER.fullmatch(self.text(number)) is not None

    def integer(self, number: int, key: str, default: int | None = None) -> int:
        """Return a whole number; raises InputError, also for a blank without a default."""
        text = self.text(number)
        if not text and default is not None:
            return default
        if not _INTEGER.fullmatch(text):
            raise self.error(_shown(text), "a whole number", key)
        return int(text)

    def id(self, number: int, key: str, default: int | None = None) -> int:
        """Return the number of a grid, element, property, material or set; raises InputError."""
        found = self.integer(number, key, default)
        if not 0 < found <= _HIGHEST_ID and found != default:
            raise self.error(f"{found}", f"a number from 1 to {_HIGHEST_ID}", key)
        return found

    def pick(self, table: Mapping[int, T], number: int, kind: str, key: str) -> T:
        """Return what a field of the card names by its number; raises InputError."""
        if number not in table:
            raise self.error(f"there is no {kind} {number}", f"the number of a {kind}", key)
        return table[number]

    def real(self, number: int, key: str, default: float | None = None) -> float:
        """Return a real number such as ``1.5-3``; raises InputError."""
        text = self.text(number)
        if not text and default is not None:
            return default
        found = _REAL.fullmatch(text) if len(text) <= 40 else None
        if found is None:
            raise self.error(_shown(text), "a number", key)
        mantissa, signed, plain = found.groups()
        value = float(f"{mantissa}e{signed or plain or 0}")
        if not (math.isfinite(value) and abs(value) <= _LARGEST_NUMBER):
            raise self.error(_shown(text), f"a number up to {_LARGEST_NUMBER:g}", key)
        return value

    def vector(self, number: int, key: str) -> tuple[float, float, float]:
        """Return three numbers that follow each other, 0 where blank."""
        x, y, z = (self.real(number + i, f"{key}{i + 1}", 0.0) for i in range(3))
        return x, y, z

    def components(self, number: int, key: str) -> str:
        """Return directions such as ``123``, each once; raises InputError."""
        text = self.text(number)
        if text == "0":
            return ""
        if not set(text) <= set("123456") or len(set(text)) < len(text):
            raise self.error(_shown(text), "digits from 1 to 6, each once", key)
        return text

    def numbers(self, first: int, key: str, known: Sequence[int]) -> list[int]:
        """Return the grids of a list with ``THRU``.

        Arguments:
            first: the field in which the list starts.
            known: the grids that there are, sorted; of ranges only these count.
        """
        texts = [text for text in self.fields[first - 1 :] if text]
        found: list[int] = []
        position = 0
        while position < len(texts):
            ranged = texts[position + 1 : position + 2] == ["THRU"]
            words = texts[position : position + 3 : 2] if ranged else texts[position : position + 1]
            position += 3 if ranged else 1
            if not all(map(_INTEGER.fullmatch, words)) or len(words) < 1 + ranged:
                raise self.error(_shown(" ".join(words)), "numbers, or FIRST THRU LAST", key)
            low, high = int(words[0]), int(words[-1])
            found += known[bisect_left(known, low) : bisect_right(known, high)] if ranged else [low]
        return found


def _shown(text: str) -> str:
    return repr(text[:40]) if text else "blank"


class Deck:
    """All cards of a file and of what it includes.

    `lines` are those of every file, with their ends, byte for byte; `cards` are in their order;
    `end` is the file and line, from 0, behind the last card: of ``ENDDATA`` where it is there;
    `chosen` is the set that case control chooses, for ``SPC`` and ``MPC``; `controlled` tells
    whether there is a case control.

    Raises:
        InputError: for what cannot be read, a line that is no card, a continuation of another
            card, or an included file outside of the folder.
    """

    def __init__(self, file: Path) -> None:
        self.file, self.controlled = file, False
        self.lines: dict[Path, list[bytes]] = {}
        self.end: tuple[Path, int] | None = None
        self.cards: list[Card] = []
        self.chosen: dict[str, int] = {}
        self._left, self._lines_left = LARGEST * 2**20, _MOST_LINES
        lines = self._load(file)
        self._bulk(file, lines, self._control(lines))

    def _load(self, file: Path) -> list[bytes]:
        """Return the lines of a file with their ends."""
        if file in self.lines or len(self.lines) >= _MOST_FILES:
            what = "is included twice" if file in self.lines else "one file too many"
            raise InputError(what, file=file, expected=f"at most {_MOST_FILES}, each once")
        try:
            with file.open("rb") as stream:
                content = stream.read(self._left + 1)
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", file=file) from None
        self._left -= len(content)
        if self._left < 0:
            expected = f"at most {LARGEST} MiB with all that is included"
            raise InputError("file is too large", file=file, expected=expected)
        if b"\0" in content:
            raise InputError("not a text: a NUL byte", file=file, expected="bulk data")
        self._lines_left -= len(_ENDS.findall(content))
        if self._lines_left < 0:
            what, expected = "file has too many lines", f"at most {_MOST_LINES} with all included"
            raise InputError(what, file=file, expected=expected)
        self.lines[file] = content.splitlines(keepends=True)
        return self.lines[file]

    def _control(self, lines: list[bytes]) -> int:
        """Return where bulk data start, and keep which constraints case control chooses."""
        begin = next((i for i, line in enumerate(lines) if _BEGIN.match(_text(line))), None)
        if begin is None:
            control = [i for i, line in enumerate(lines) if _text(line).strip().upper() == "CEND"]
            if control:
                what, line = "case control without bulk data", control[0] + 1
                raise InputError(what, file=self.file, line=line, expected="BEGIN BULK")
            return 0
        if not _BULK.fullmatch(_text(lines[begin])):
            raise _section(self.file, begin + 1, _text(lines[begin]))
        self.controlled = True
        for i in range(begin):
            if found := _CHOICE.fullmatch(_text(lines[i])):
                word, number = found[1].upper(), int(found[2])
                if self.chosen.setdefault(word, number) != number:
                    what = f"subcases choose different sets of {word}"
                    raise InputError(what, file=self.file, line=i + 1, expected="one set")
        return begin + 1

    def _bulk(self, file: Path, lines: list[bytes], start: int) -> None:
        """Collect the cards of one file from a line on."""
        open_card: _Rows | None = None
        for i in range(start, len(lines)):
            if self.end is not None:
                break
            text = _text(lines[i])
            if not text.strip():
                continue
            if _BEGIN.match(text):
                raise _section(file, i + 1, text)
            found = _INCLUDE.fullmatch(text)
            words = text.split(maxsplit=1)
            if not found and words[0].upper() != "ENDDATA":
                open_card = self._line(file, i, text, open_card)
                continue
            self._close(open_card)
            open_card = None
            if found is None:
                self.end = file, i
                return
            included = _inside(self.file, file, found[1], i + 1)
            self._bulk(included, self._load(included), 0)
        self._close(open_card)

    def _line(self, file: Path, i: int, text: str, card: _Rows | None) -> _Rows:
        """Take up one line; return the card that the next line may continue."""
        if card is None and not self.cards:
            _check_language(text, file, i + 1)
        line = _split(text, file, i + 1)
        if not line.continues:
            self._close(card)
            return _Rows(file, i, line)
        if card is None:
            expected = "a card that it continues"
            raise InputError("a continuation", file=file, line=i + 1, expected=expected)
        card.add(i, line)
        return card

    def _close(self, card: _Rows | None) -> None:
        if card is not None:
            self.cards.append(card.card())


def _text(line: bytes) -> str:
    """Return a line without its end and its comment, one character a byte."""
    return line.decode("latin-1").partition("$")[0].rstrip()


@dataclass(frozen=True)
class _Line:
    """A physical line: its first field, four or eight data fields, and the last field."""

    head: str
    fields: list[str]
    tail: str

    @property
    def continues(self) -> bool:
        return not self.head or self.head[0] in "+*"


def _split(text: str, file: Path, number: int) -> _Line:
    if "," in text:
        head, *fields = (part.strip().upper() for part in text.split(","))
        count = 4 if "*" in head else 8
        if len(fields) > count + 1:
            expected = f"{count + 2} at most, further ones on a continuation"
            what = f"{len(fields) + 1} fields"
            raise InputError(what, file=file, line=number, expected=expected)
        line = _Line(head, fields[:count], "".join(fields[count:]))
    else:
        wide = text.expandtabs(_SMALL).upper()
        head = wide[:_SMALL].strip()
        width = _LARGE if "*" in head else _SMALL
        starts = range(_SMALL, 72, width)
        line = _Line(head, [wide[s : s + width].strip() for s in starts], wide[72:80].strip())
    if any(item.startswith("=") for item in (line.head, *line.fields)):
        what = "a card that repeats another one (replication)"
        raise InputError(what, file=file, line=number, expected="cards without =, written out")
    if not line.continues and not _NAME.fullmatch(line.head.rstrip("* ")):
        raise InputError(_shown(line.head), file=file, line=number, expected="the name of a card")
    return line


def _section(file: Path, line: int, text: str) -> InputError:
    """Return the error of a second section of bulk data, or of one of another kind."""
    stated = " ".join(text.split())[:40]
    kind = "superelements are not read: " if "SUPER" in text.upper() else ""
    return InputError(f"{kind}{stated!r}", file=file, line=line, expected=_ONE_SECTION)


def _check_language(text: str, file: Path, line: int) -> None:
    """Check that the first line is none of another program; raises InputError."""
    word = text.split(maxsplit=1)[0][:20]
    for pattern, program, expected in (
        (_ANSYS, "Ansys", "Nastran bulk data; of Ansys its .full file is read"),
        (_KEYWORD, "Abaqus or CalculiX", "Nastran bulk data; their matrices are read from .mtx"),
    ):
        if pattern.match(word):
            what = f"an input file of {program}: {word!r}"
            raise InputError(what, file=file, line=line, expected=expected)


class _Rows:
    """A card while its lines are collected."""

    def __init__(self, file: Path, i: int, line: _Line) -> None:
        self.file, self.first, self.head = file, i, line.head
        self.fields: list[str] = []
        self.tail = ""
        self.take(i, line)

    def add(self, i: int, line: _Line) -> None:
        """Add a continuation."""
        one, other = self.tail.lstrip("+*"), line.head.lstrip("+*")
        if one and other and one != other:
            what, expected = f"continuation {line.head[:20]!r}", f"{self.tail[:20]!r}"
            raise InputError(what, file=self.file, line=i + 1, expected=expected)
        self.take(i, line)

    def take(self, i: int, line: _Line) -> None:
        large = "*" in line.head
        if not large:  # a row that began in large fields may have ended after its first half
            self.fields += [""] * (-len(self.fields) % 8)
        count = 4 if large else 8
        self.fields += line.fields + [""] * (count - len(line.fields))
        self.last, self.tail = i, line.tail

    def card(self) -> Card:
        count = max((n for n, text in enumerate(self.fields, 1) if text), default=0)
        name = self.head.rstrip("* ")
        return Card(name, tuple(self.fields[:count]), self.file, self.first, self.last)


def _inside(main: Path, file: Path, name: str, line: int) -> Path:
    """Return an included file; raises InputError outside of the folder of the main file.

    Backslashes part folders too, as on Windows.
    """

    def wrong(why: str) -> InputError:
        what = f"included file {name[:80]!r} {why}"
        expected = "a file in the folder of the main file"
        return InputError(what, file=file, line=line, key="INCLUDE", expected=expected)

    try:
        path = (file.parent / name.replace("\\", "/")).resolve()
        if not path.is_relative_to(main.parent.resolve()):
            raise wrong("lies elsewhere")
        if not path.is_file():
            raise wrong("is not there")
    except (OSError, ValueError):
        raise wrong("cannot be opened") from None
    return main.parent / path.relative_to(main.parent.resolve())
