"""A paper worked through: its cells, what it left out, and its figures drawn anew."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from femubench.core.plot.figure import Figure
from femubench.core.reproduction.cell import Cell
from femubench.core.reproduction.convention import Convention
from femubench.core.reproduction.equation import Equation
from femubench.core.reproduction.printed_table import PrintedTable

FIGURES = "figures"  # folder of the drawings beneath that of a report
_STATED = (
    *("paper", "table", "row", "column"),
    *("printed", "ours", "deviation_percent", "verdict", "note", "tried"),
)


@dataclass(frozen=True)
class Extra:
    """A table that the paper does not print.

    Arguments:
        title: what it shows.
        columns: headers, with units.
        rows: text cells, one a column.
        note: what it tells.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True)
class Study:
    """What a re-run of a paper says.

    Arguments:
        paper: slug.
        title, citation: of the paper.
        premises: what was taken from where, one sentence each.
        cells: every printed figure.
        findings: what the re-run shows, one sentence each.
        extras: what the paper did not print.
        figures: its figures, and ours.
        tables: how it prints its tables; cells of others stand by their rows.
        equations: its equations, and what works by them.
        conventions: computes what can be read in several ways; no two change the same cell.
    """

    FIGURES: ClassVar[str] = FIGURES

    paper: str
    title: str
    citation: str
    premises: tuple[str, ...]
    cells: tuple[Cell, ...]
    findings: tuple[str, ...] = ()
    extras: tuple[Extra, ...] = ()
    figures: tuple[Figure, ...] = ()
    tables: tuple[PrintedTable, ...] = ()
    equations: tuple[Equation, ...] = ()
    conventions: Callable[[], tuple[Convention, ...]] = tuple


def cells_to_json(studies: Sequence[Study]) -> list[dict[str, Any]]:
    """Return all cells as plain data; None for what is missing."""
    return [
        {name: getattr(cell, name) for name in _STATED}
        | ({} if math.isfinite(cell.ours or 0.0) else {"ours": None})
        for study in studies
        for cell in study.cells
    ]
