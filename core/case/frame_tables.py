"""Joints and members of a frame that stand in tables of their own next to `case.toml`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from femubench.core.case.faults import KeyPath, at_key
from femubench.core.case.files import CaseFiles
from femubench.core.case.schema import CaseSpec, parse_spec
from femubench.core.case.tables import CsvTable, plain_number, read_table, whole_number
from femubench.core.errors import InputError
from femubench.core.typing import IntArray

# A key of a joint or member that is a list stands in one column an entry.
SPREAD = {"xyz": ("x", "y", "z"), "ends": ("end_1", "end_2"), "up": ("up_x", "up_y", "up_z")}
KEYS = {
    "joints": ("name", "xyz", "type"),
    "members": ("name", "ends", "elements", "section", "material", "up"),
}
OPTIONAL = ("type", "elements", "up")
MANY = 1000  # joints and members beyond which a case is written with tables of its own


def columns_of(key: str) -> tuple[str, ...]:
    """Return the columns that stand for a key of a joint or member."""
    return SPREAD.get(key, (key,))


class FrameTables:
    """The tables that a `case.toml` names, put in the place of its lists of joints and members."""

    def __init__(self, files: CaseFiles) -> None:
        self.files = files
        self.found: dict[str, tuple[Path, IntArray]] = {}

    def spec(self, data: Mapping[str, Any]) -> CaseSpec:
        """Return the content of a case as typed tables.

        Raises:
            Fault: when a table cannot be found, `pydantic.ValidationError` for what is in it.
            InputError: for a table that is none, or has other columns.
        """
        model = data.get("model")
        if isinstance(model, dict) and model.get("kind") == "frame":
            lists = {
                key: self._list(key, model[key]) for key in KEYS if isinstance(model.get(key), str)
            }
            data = {**data, "model": {**model, **lists}}
        return parse_spec(data)

    def _list(self, key: str, name: str) -> Iterator[dict[str, Any]]:
        with at_key("model", key):
            path = self.files.path(name)
        optional = [c for k in KEYS[key] if k in OPTIONAL for c in columns_of(k)]
        required = [c for k in KEYS[key] if k not in OPTIONAL for c in columns_of(k)]
        cells = read_table(path)
        cells.check_columns(tuple(required), optional)
        if not cells.cells:
            raise InputError("no rows", file=path, expected=f"one of the {key} at least")
        self.found[key] = path, np.array(cells.lines)
        return _entries(key, cells)

    def place(self, path: KeyPath) -> tuple[Path, int, str | None] | None:
        """Return file, line and column of a key path; None where it lies in `case.toml`."""
        if len(path) < 3 or path[0] != "model" or path[1] not in self.found:
            return None
        (file, lines), row = self.found[str(path[1])], path[2]
        assert isinstance(row, int)
        column = None
        if len(path) > 3:
            spread = columns_of(str(path[3]))
            k = path[4] if len(path) > 4 else 0
            column = spread[k] if isinstance(k, int) and k < len(spread) else spread[0]
        return file, int(lines[row]), column


def _entries(key: str, cells: CsvTable) -> Iterator[dict[str, Any]]:
    """Yield the keys of every row; empty cells of optional keys are left out."""
    at = {name: i for i, name in enumerate(cells.columns)}
    places = {k: [at[c] for c in columns_of(k)] for k in KEYS[key] if columns_of(k)[0] in at}
    for row in cells.cells:
        entry: dict[str, Any] = {}
        for k, columns in places.items():
            if k in ("xyz", "up"):
                if k == "xyz" or any(row[c] for c in columns):
                    entry[k] = [plain_number(row[c]) for c in columns]
            elif k == "ends":
                entry[k] = [row[c] for c in columns]
            elif k not in OPTIONAL or row[columns[0]]:
                cell = row[columns[0]]
                entry[k] = whole_number(cell) if k == "elements" else cell
        yield entry
