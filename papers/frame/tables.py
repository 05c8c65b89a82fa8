"""Tables 1 to 4 of the ladder-frame paper, cell by cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from femubench.fem import FloatArray
from femubench.papers.frame import readings
from femubench.papers.frame.common import (
    PAPER,
    RECOVERED,
    TWIN_SHAPES,
    listed,
    rigid_modes,
    strain_modes,
)
from femubench.papers.printed import printed
from femubench.reproduction import Cell, Page, Workbench

_EXACT = 0.1  # percent: of what a method promises to meet, or what follows from the model alone
_SHAPED = 0.5  # percent: of what depends on shapes that are not the test's
LS_FORCED = "generic-ls:expansion=force"


def table_cells(bench: Workbench) -> tuple[Cell, ...]:
    """Return the cells of tables 1 to 4."""
    data = printed(PAPER)
    return (
        *_table1(bench, data),
        *_table2(bench, data),
        *_table3(bench, data),
        *_table4(bench, data),
    )


def page(table: str, tolerance: float, convention: str = "", reason: str = "") -> Page:
    """Return a page of frequencies in Hz with one printed digit behind the point."""
    return Page(PAPER, table, "Hz", tolerance, 1, convention, reason)


def column(
    where: Page, name: str, values: Sequence[float], ours: FloatArray, first: int
) -> list[Cell]:
    """Return the cells of strain modes, the first of which has the number ``first``."""
    return [
        where.cell(f"mode {first + i}", name, p, float(o))
        for i, (p, o) in enumerate(zip(values, ours, strict=True))
    ]


def _rigid(where: Page, name: str, values: Sequence[float], ours: FloatArray) -> Cell:
    """Return the cell of the row of rigid-body modes, which prints one figure a column.

    Three zero frequencies are as good as the worst of them, of others the paper prints the lowest.
    """
    free = not any(values)
    size = float(ours[np.argmax(np.abs(ours))] if free else ours.min())
    return where.cell("rigid-body modes", name, float(values[0]), size if len(ours) == 3 else None)


def _table1(bench: Workbench, data: dict[str, Any]) -> list[Cell]:
    table, fe = data["table1"], strain_modes(bench, "unchanged")
    measured = np.array(table["measured"])
    ours, of_print = (100.0 * (np.asarray(f) / measured - 1.0) for f in (fe, table["fe"]))
    errors = [
        Page(
            PAPER, "1", "%", 0.0, 1, RECOVERED,
            f"does not follow from the two printed columns either: they give {own:.2f} %",
        ).cell(f"mode {i + 1}", "error", p, float(o))
        for i, (p, o, own) in enumerate(zip(table["error_percent"], ours, of_print, strict=True))
    ]  # fmt: skip
    return column(page("1", _EXACT, RECOVERED), "FE model", table["fe"], fe, 1) + errors


def _table2(bench: Workbench, data: dict[str, Any]) -> list[Cell]:
    cells = []
    rigid = f"{TWIN_SHAPES}; {readings.beam_shapes(bench, 'kabe-rigid')}"
    for key, name, words, convention, reason in (
        ("baruch", "Baruch's method", "baruch", RECOVERED, ""),
        ("nonzeros", "changing non-zeros", "kabe", TWIN_SHAPES, readings.kabe_reason(bench)),
        ("nonzeros_rigid", "changing non-zeros + rigid modes", "kabe-rigid", rigid, ""),
    ):
        values, ours = data["table2"][key], strain_modes(bench, words)
        met = page("2", _EXACT, reason=reason)
        higher = page("2", _EXACT if key == "baruch" else _SHAPED, convention, reason)
        cells += [_rigid(met, name, values["rigid"], rigid_modes(bench, words))]
        cells += column(met, name, values["modes"][:3], ours[:3], 1)
        cells += column(higher, name, values["modes"][3:], ours[3:], 4)
    return cells


def _table3(bench: Workbench, data: dict[str, Any]) -> list[Cell]:
    cells = []
    for key, name, words in (
        ("physical", "physical parameters", "physical"),
        ("nobari", "Nobari's method", "nobari"),
    ):
        values, ours = data["table3"][key], strain_modes(bench, words)
        reason = readings.met_reason(bench, words, values["modes"])
        rigid = rigid_modes(bench, words)
        size = f"one imaginary and one zero frequency as printed, but {listed(rigid)} Hz"
        at = page("3", _EXACT, reason=f"{size}; {TWIN_SHAPES}")
        cells.append(_rigid(at, name, values["rigid"], rigid))
        cells += column(page("3", _SHAPED, TWIN_SHAPES, reason), name, values["modes"], ours, 1)
    return cells


def _table4(bench: Workbench, data: dict[str, Any]) -> list[Cell]:
    least, adjusted = data["table4"]["generic_ls"], data["table4"]["generic_adjusted"]
    forced, tied = strain_modes(bench, LS_FORCED), strain_modes(bench, "generic-adjusted")
    met = page("4", _EXACT)
    convention = readings.forced_convention(bench, LS_FORCED)
    name = "LS solution"
    cells = [_rigid(met, name, least["rigid"], rigid_modes(bench, "generic-ls"))]
    cells += column(page("4", _SHAPED, convention), name, least["modes"], forced, 1)
    name = "adjusted solution"
    close = (
        f"16 parameters meet them within {_EXACT} % with the orthogonality equations; {TWIN_SHAPES}"
    )
    cells.append(_rigid(met, name, adjusted["rigid"], rigid_modes(bench, "generic-adjusted")))
    cells += column(page("4", _EXACT, close), name, adjusted["modes"][:3], tied[:3], 1)
    reason = readings.adjusted_reason(bench)
    return cells + column(
        page("4", _SHAPED, reason=reason), name, adjusted["modes"][3:], tied[3:], 4
    )
