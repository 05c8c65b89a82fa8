"""Tables 1 to 4 of the ladder-frame paper, cell by cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from femubench import Modes
from femubench.fem import FloatArray
from femubench.papers.frame import readings
from femubench.papers.frame.common import (
    GIVEN,
    PAPER,
    RECOVERED,
    SHAPES,
    TRUTH,
    TWIN_SHAPES,
    format_frequencies,
    rigid_modes,
    strain_modes,
    under_other_shapes,
)
from femubench.papers.printed import read_printed
from femubench.reproduction import Cell, Grid, Ground, Page, PrintedTable, Workbench

_EXACT = 0.1  # percent: of what a method promises to meet, or what follows from the model alone
_SHAPED = 0.5  # percent: of what depends on shapes that are not the test's
LS_FORCED = "generic-ls:expansion=force"
_FREE = "free of force in rigid-body motion"
_BY_MASS = Ground(
    "independent",
    "equation (18) changes K0 in the span of the three used modes alone, so that the free "
    "structure stays free, whatever its dimensions and shapes",
)
_AS_DATA = Ground("input", "the rigid-body modes are given to the update as data")
_BY_ELEMENTS = Ground(
    "input",
    f"by definition: every element matrix of the family is {_FREE}, so that every update is",
)
_COLUMNS = Ground(
    "input",
    "by definition: the error of the two frequencies next to it; ours is computed from them",
)


def table_cells(bench: Workbench) -> tuple[Cell, ...]:
    """Return the cells of tables 1 to 4."""
    data = read_printed(PAPER)
    return (
        *_table1(bench, data),
        *_table2(bench, data),
        *_table3(bench, data),
        *_table4(bench, data),
    )


def layout() -> tuple[PrintedTable, ...]:
    """Return table 1 with the measured frequencies; the others print their cells alone."""
    measured = [f"{value:.1f}" for value in read_printed(PAPER)["table1"]["measured"]]
    modes = [f"mode {i}" for i in range(1, 6)]
    rows = tuple(
        (m, ((m, "FE model"), f, (m, "error"))) for m, f in zip(modes, measured, strict=True)
    )
    return (
        PrintedTable(
            "1",
            "Frequencies of the FE model",
            (Grid(("", "FE model", "measured", "error, %"), rows),),
        ),
        PrintedTable("2", "Updated without an eye on connectivity, or on non-zeros alone", ()),
        PrintedTable("3", "Updated by factors on elements", ()),
        PrintedTable("4", "Updated by generic elements", ()),
        PrintedTable("generalised mass", "Of the five expanded shapes, off the diagonal", ()),
    )


def page(table: str, tolerance: float, ground: Ground, reason: str = "") -> Page:
    """Return a page of frequencies in Hz with one printed digit behind the point."""
    made = Page(PAPER, table, (ground,), "Hz", tolerance, 1, unprinted=SHAPES)
    return replace(made, fault=Ground("does-not-follow", reason)) if reason else made


def column(
    bench: Workbench, where: Page, words: str, name: str, values: Sequence[float], first: int = 1
) -> list[Cell]:
    """Return the cells of strain modes under an update, from that with the number ``first`` on."""
    ours, last = strain_modes(bench, words), first + len(values)
    return [
        where.cell(
            *(f"mode {k}", name, theirs, float(ours[k - 1])),
            partial(under_other_shapes, bench, words, partial(_strain_mode, k)),
        )
        for k, theirs in zip(range(first, last), values, strict=True)
    ]


def _strain_mode(number: int, modes: Modes) -> float:
    return float(modes.elastic.natural_frequencies[number - 1])


def _rigid(bench: Workbench, where: Page, words: str, name: str, values: Sequence[float]) -> Cell:
    """Return the cell of the row of rigid-body modes, which prints one figure a column."""
    size = rigid_figure(values, rigid_modes(bench, words))
    others = partial(under_other_shapes, bench, words, lambda m: float(m.natural_frequencies[0]))
    return where.cell("rigid-body modes", name, float(values[0]), size, others)


def rigid_figure(values: Sequence[float], ours: FloatArray) -> float | None:
    """Return our figure of the row of rigid-body modes in Hz; None where there are not three.

    Three zero frequencies are as good as the worst of them, of others the paper prints the lowest.
    """
    if len(ours) != 3:
        return None
    return float(ours.min() if any(values) else ours[np.argmax(np.abs(ours))])


def compute_printed_errors() -> FloatArray:
    """Return the errors in percent that follow from the two printed columns of table 1, (5,)."""
    table = read_printed(PAPER)["table1"]
    return np.asarray(100.0 * (np.array(table["fe"]) / np.array(table["measured"]) - 1.0))


def _table1(bench: Workbench, data: dict[str, Any]) -> list[Cell]:
    table = data["table1"]
    half = 0.05  # Hz, of the last printed digit
    errors = []
    for i, (p, own) in enumerate(
        zip(table["error_percent"], compute_printed_errors(), strict=True)
    ):
        model, test = table["fe"][i], table["measured"][i]
        most = 100.0 * ((model + half) / (test - half) - 1.0)
        wrong = Ground(
            "misprint",
            f"the printed frequencies, {model} and {test} Hz, give {own:.2f} %, and at most "
            f"{most:.2f} % before they were rounded",
        )
        where = Page(PAPER, "1", (_COLUMNS,), "%", 0.0, 1, wrong)
        errors.append(where.cell(f"mode {i + 1}", "error", p, float(own)))
    return [
        *column(bench, page("1", _EXACT, RECOVERED), "unchanged", "FE model", table["fe"]),
        *errors,
    ]


def _table2(bench: Workbench, data: dict[str, Any]) -> list[Cell]:
    cells = []
    shaped = f"{TWIN_SHAPES}; {readings.beam_shapes(bench, 'kabe-rigid')}"
    shapes = Ground("under-convention", shaped)
    cutoff = Ground("under-convention", f"with a cutoff of 0.03; {TWIN_SHAPES}")
    for key, name, words, free, ground, reason in (
        ("baruch", "Baruch's method", "baruch", _BY_MASS, RECOVERED, ""),
        ("nonzeros", "changing non-zeros", "kabe", cutoff, cutoff, readings.kabe_reason(bench)),
        (
            *("nonzeros_rigid", "changing non-zeros + rigid modes", "kabe-rigid"),
            *(_AS_DATA, shapes, ""),
        ),
    ):
        values, at = data["table2"][key], page("2", _EXACT, free, reason)
        cells.append(_rigid(bench, at, words, name, values["rigid"]))
        cells += column(bench, page("2", _EXACT, GIVEN), words, name, values["modes"][:3])
        higher = page("2", _EXACT if key == "baruch" else _SHAPED, ground, reason)
        cells += column(bench, higher, words, name, values["modes"][3:], 4)
    return cells


def _table3(bench: Workbench, data: dict[str, Any]) -> list[Cell]:
    cells = []
    shapes = Ground("under-convention", TWIN_SHAPES)
    for key, name, words, free in (
        ("physical", "physical parameters", "physical", _BY_ELEMENTS),
        ("nobari", "Nobari's method", "nobari", shapes),
    ):
        values = data["table3"][key]
        reason = readings.explain_met(bench, words, values["modes"])
        rigid, other = rigid_modes(bench, words), rigid_modes(bench, words, TRUTH)
        size = (
            f"one imaginary and one zero frequency as printed, but {format_frequencies(rigid)} Hz; "
            f"{TWIN_SHAPES}; with the beam truth and its shapes {format_frequencies(other)} Hz"
        )
        cells.append(_rigid(bench, page("3", _EXACT, free, size), words, name, values["rigid"]))
        cells += column(bench, page("3", _SHAPED, shapes, reason), words, name, values["modes"])
    return cells


def _table4(bench: Workbench, data: dict[str, Any]) -> list[Cell]:
    least, adjusted = data["table4"]["generic_ls"], data["table4"]["generic_adjusted"]
    free, met = page("4", _EXACT, _BY_ELEMENTS), page("4", _EXACT, GIVEN)
    searched = page("4", _SHAPED, readings.explain_higher_modes(bench, LS_FORCED))
    shapes = Ground("under-convention", TWIN_SHAPES)
    higher = page("4", _SHAPED, shapes, readings.explain_adjusted(bench))
    cells = []
    for name, words, taken, theirs, last in (
        ("LS solution", "generic-ls", LS_FORCED, least, searched),
        ("adjusted solution", "generic-adjusted", "generic-adjusted", adjusted, higher),
    ):
        cells.append(_rigid(bench, free, words, name, theirs["rigid"]))
        cells += column(bench, met, taken, name, theirs["modes"][:3])
        cells += column(bench, last, taken, name, theirs["modes"][3:], 4)
    return cells
