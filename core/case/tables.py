"""Read the CSV files of a case: rows and cells, with file and line in every error."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import NamedTuple

from femubench.core.case.faults import Misfit
from femubench.core.case.files import LARGEST_TEXT
from femubench.core.case.schema import LARGEST
from femubench.core.errors import InputError, clipped
from femubench.core.fem.frame import Place, Vector
from femubench.core.fem.sensors import DIRECTIONS, axis_of
from femubench.core.files import read_text

_MOST_ROWS, _MOST_COLUMNS, _MOST_CELLS = 1_000_000, 50_000, 10_000_000
_LONGEST_NUMBER = 100
_REAL = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_NUMBER = re.compile(_REAL, re.ASCII)
_COMPLEX = re.compile(rf"\(?(?:({_REAL})(?=[+-]))?({_REAL})[ijIJ]\)?", re.ASCII)
_DECIMAL = re.compile(r"(?<=\d),(?=\d)", re.ASCII)
_WHOLE = re.compile(r"\+?\d{1,9}", re.ASCII)
SUFFIXES = (".csv", ".txt")
RESERVED = ("mode", "frequency", "frequency_std", "damping", "modal_mass")
PLACES = (
    "sensors (`bench init --sensors FILE`): a table label,x,y,z,direction, or label,at,direction; "
    "or the whole folder of `bench identify`: --modes FOLDER"
)


class Complex(NamedTuple):
    """A cell that was written as a complex number, which `complex` alone does not tell."""

    real: float
    imag: float


@dataclass(frozen=True)
class CsvRow:
    """One row of a table; cells are found by column; errors name file and line."""

    file: Path
    line: int
    cells: dict[str, str]

    def error(self, column: str, what: str, expected: str) -> InputError:
        """Return the error that names this cell."""
        return InputError(what, file=self.file, line=self.line, key=column, expected=expected)

    def text(self, column: str, expected: str = "a name") -> str:
        """Return a cell that must not be empty."""
        cell = self.cells[column]
        if not cell or not cell.isprintable():
            raise self.error(column, "empty cell" if not cell else "not a text", expected)
        return cell

    def whole(self, column: str) -> int:
        """Return a whole number, at least 0."""
        cell = self.cells[column]
        if not _WHOLE.fullmatch(cell):
            raise self.error(column, _refused(cell), "a whole number")
        return int(cell)

    def value(self, column: str) -> float | Complex | None:
        """Return a real or complex number, None for an empty cell or a missing column."""
        cell = self.cells.get(column, "")
        if not cell:
            return None
        # No number is this long, and the patterns below take the square of a cell's length.
        if len(cell) > _LONGEST_NUMBER:
            raise self.error(column, f"{_shown(cell)} is too long", "a number")
        compact = "".join(cell.split())
        match = _COMPLEX.fullmatch(compact)
        if match is not None:
            parts = [float(part or 0.0) for part in match.groups()]
        elif _NUMBER.fullmatch(compact):
            parts = [float(compact), 0.0]
        else:
            raise self.error(column, f"{_shown(cell)} is not a finite number", "a number")
        if not all(math.isfinite(part) and abs(part) <= LARGEST for part in parts):
            raise self.error(column, f"{_shown(cell)} is too large", "a finite number")
        return Complex(*parts) if match is not None else parts[0]

    def number(
        self,
        column: str,
        expected: str = "a number",
        allowed: Callable[[float], bool] | None = None,
    ) -> float | None:
        """Return a real number, None for an empty cell or a missing column."""
        value = self.value(column)
        if value is None:
            return None
        if isinstance(value, Complex) or (allowed is not None and not allowed(value)):
            raise self.error(column, _refused(self.cells[column]), expected)
        return value

    def vector(self) -> Vector:
        """Return the columns x, y, z."""
        values = []
        for column in ("x", "y", "z"):
            value = self.number(column)
            if value is None:
                raise self.error(column, "empty cell", "a number in m")
            values.append(value)
        return values[0], values[1], values[2]

    def direction(self) -> str:
        """Return the column direction as `Sensors` has it."""
        cell = self.cells["direction"]
        try:
            axis_of(cell)
        except ValueError:
            expected = (
                f"one of {', '.join(DIRECTIONS)}, with an optional sign, or a vector as 0.6 0 0.8"
            )
            raise self.error("direction", _refused(cell), expected) from None
        return cell.removeprefix("+")


def _refused(cell: str) -> str:
    return f"{_shown(cell)} is not allowed" if cell else "empty cell"


def _shown(cell: str) -> str:
    return repr(clipped(cell, 40))


def plain_number(cell: str) -> float | str:
    """Return the number of a cell, or the cell itself where it is none."""
    return float(cell) if len(cell) <= _LONGEST_NUMBER and _NUMBER.fullmatch(cell) else cell


def whole_number(cell: str) -> int | str:
    """Return the whole number of a cell, or the cell itself where it is none."""
    return int(cell) if _WHOLE.fullmatch(cell) else cell


@dataclass(frozen=True)
class CsvTable:
    """A CSV file: its column names, and line and cells of every row.

    A table of a million rows is read by its cells alone; `rows` takes as much memory again.
    """

    file: Path
    columns: tuple[str, ...]
    lines: tuple[int, ...]
    cells: tuple[list[str], ...]

    @cached_property
    def rows(self) -> tuple[CsvRow, ...]:
        """Return the rows, whose cells are found by column."""
        return tuple(
            CsvRow(self.file, line, dict(zip(self.columns, cells, strict=True)))
            for line, cells in zip(self.lines, self.cells, strict=True)
        )

    def check_columns(self, required: tuple[str, ...], known: Collection[str] = ()) -> None:
        """Check that the required columns are there and no others but the known ones."""
        for column in required:
            if column not in self.columns:
                what, found = "missing column", f"it among {', '.join(self.columns)}"[:200]
                raise InputError(what, file=self.file, line=1, key=column, expected=found)
        for column in self.columns:
            if column not in required and column not in known:
                listed = ", ".join([*required, *sorted(set(known).difference(required))])[:200]
                what, key = "unknown column", column[:60]
                raise InputError(what, file=self.file, line=1, key=key, expected=listed)


def read_table(file: Path) -> CsvTable:
    """Return the content of a CSV file whose first row names the columns.

    Raises:
        InputError: for a ragged row, a column without name or named twice, a broken quotation.
    """
    text = read_text(file, LARGEST_TEXT)
    first = next((line for line in text.splitlines() if line.strip()), "")
    # Spreadsheets of half of the world: semicolons between cells, commas in numbers.
    separator = next((mark for mark in ";\t" if mark in first and "," not in first), ",")
    foreign = separator != ","
    reader = csv.reader(StringIO(text), delimiter=separator, skipinitialspace=True)
    lines: list[int] = []
    rows: list[list[str]] = []
    columns: tuple[str, ...] = ()
    try:
        for cells in reader:
            cells = [cell.strip() for cell in cells]
            if any("\n" in cell for cell in cells):
                raise csv.Error("a quotation is not closed")
            if not any(cells):
                continue
            if not columns:
                columns = _header(file, reader.line_num, cells)
                continue
            if len(cells) != len(columns):
                what = f"{len(cells)} cells"
                expected = f"{len(columns)} as in the first row"
                raise InputError(what, file=file, line=reader.line_num, expected=expected)
            lines.append(reader.line_num)
            rows.append([_DECIMAL.sub(".", cell) for cell in cells] if foreign else cells)
            if len(rows) > _MOST_ROWS:
                raise InputError("too many rows", file=file, expected=f"at most {_MOST_ROWS}")
            if len(rows) * len(columns) > _MOST_CELLS:
                raise InputError("too many cells", file=file, expected=f"at most {_MOST_CELLS}")
    except csv.Error as error:
        what = f"not a table: {error}"
        expected = "cells separated by commas or by semicolons"
        raise InputError(what, file=file, line=reader.line_num, expected=expected) from None
    if not columns:
        raise InputError("empty file", file=file, expected="a row of column names")
    return CsvTable(file, columns, tuple(lines), tuple(rows))


def _header(file: Path, line: int, cells: list[str]) -> tuple[str, ...]:
    if len(cells) > _MOST_COLUMNS:
        raise InputError("too many columns", file=file, expected=f"at most {_MOST_COLUMNS}")
    seen: set[str] = set()
    for i, cell in enumerate(cells):
        if not cell or not cell.isprintable():
            what = f"column {i + 1} has no name"
            raise InputError(what, file=file, line=line, expected="a name for every column")
        if cell in seen:
            what, expected = f"column {_shown(cell)} is listed twice", "every column once"
            raise InputError(what, file=file, line=line, key=cell[:60], expected=expected)
        seen.add(cell)
    return tuple(cells)


def parse_place(text: str) -> Place:
    """Return the place that a cell names; raises Misfit."""
    member, found, station = text.rpartition("@")
    if not found:
        return Place(joint=text)
    if len(station) > _LONGEST_NUMBER:
        raise Misfit("a station is too long", "member@s with s in 0..1")
    if not _NUMBER.fullmatch(station) or not 0.0 <= float(station) <= 1.0:
        raise Misfit(f"{station[:20]!r} is not a station", "member@s with s in 0..1")
    return Place(member=member, s=float(station))
