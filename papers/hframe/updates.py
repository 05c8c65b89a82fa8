"""Table 4 (a) to (e): frequencies, errors and parameters before and after the updates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from femubench import Model
from femubench.papers.hframe.meshes import RECOVERED, frequencies
from femubench.papers.hframe.rows import (
    ROWS,
    Reading,
    Row,
    at_printed,
    parameter_values,
    run,
)
from femubench.papers.printed import printed
from femubench.reproduction import Cell, Page, Workbench
from femubench.update import spring_estimates

INITIAL, UPDATED, LIMIT = 0.01, 0.05, 0.1  # of frequencies and of parameters, in percent
DIGITS = {"k_x": -7, "k_z": -7}  # printed with three digits
UNITS = {"EI": "N m2", "rhoA": "kg/m", "k_theta": "N m/rad", "k": "N/m", "a": "m"}
USED = 5


def unit_of(symbol: str) -> str:
    """Return the unit of a parameter by the paper's symbol."""
    return UNITS.get(symbol) or UNITS[symbol.split("_")[0]]


def update_cells(bench: Workbench) -> tuple[Cell, ...]:
    """Return all cells of table 4, and the initial offsets as section 8 states them."""
    cells: list[Cell] = []
    for row in ROWS:
        theirs = printed("hframe")["table4"][row.key]
        cells += _mode_cells(bench, row, theirs, "initial", row.initial, INITIAL)
        cells += _mode_cells(bench, row, theirs, "updated", row.updated, UPDATED)
        cells += _parameter_cells(bench, row, theirs)
    return (*cells, *_text_cells(bench))


def misprinted(frequency: float, measured: float, error: float) -> str:
    """Return how a printed error contradicts the printed frequency beside it; empty if not."""
    follows = 100.0 * (frequency / measured - 1.0)
    if abs(follows - error) <= 0.02:
        return ""
    return f"misprint: the printed frequencies give {follows:+.2f} %"


def _mode_cells(
    bench: Workbench, row: Row, theirs: dict[str, Any], column: str, reading: Reading, limit: float
) -> Iterator[Cell]:
    words = reading.start if column == "initial" else reading.words
    ours = frequencies(run(bench, words).model, USED)
    measured = bench.cases["hframe"].used_measurement(0).frequencies
    # The model as built is that of table 3, to which its dimensions are fitted.
    fitted = RECOVERED if row.letter in "ab" else ""
    note = reading.note if column == "updated" else fitted
    hertz = Page("hframe", row.table, "Hz", limit, decimals=2, convention=note)
    for i, (f, f_m) in enumerate(zip(theirs[column], measured, strict=True)):
        yield hertz.cell(f"mode {i + 1}", column, f, float(ours[i]))
        printed_error = theirs[f"{column}_error"][i]
        wrong = misprinted(f, f_m, printed_error)
        # What the tolerance of the frequency makes of the error, and half a printed digit.
        points = limit * f / f_m + 0.005
        page = Page("hframe", row.table, "%", points, convention=note)
        page = replace(page, reason=wrong) if wrong else page
        error = 100.0 * (float(ours[i]) / f_m - 1.0)
        yield page.cell(f"mode {i + 1}", f"{column} error", printed_error, error)


def _parameter_cells(bench: Workbench, row: Row, theirs: dict[str, Any]) -> Iterator[Cell]:
    reason = _reason(bench, row)
    for symbol, (first, last) in theirs["parameters"].items():
        reading = row.apart.get(symbol, row.updated)
        before, after = parameter_values(bench, row, reading.words)[symbol]
        digits, unit = DIGITS.get(symbol), unit_of(symbol)
        page = Page("hframe", row.table, unit, LIMIT, digits, reason=_rule(bench, symbol))
        yield page.cell(symbol, "initial", first, _initial(bench, symbol, before))
        page = Page("hframe", row.table, unit, LIMIT, digits, reading.note, reason)
        yield page.cell(symbol, "updated", last, after)
        ratio = theirs["ratios"][symbol]
        # The tolerance of the value, and half a digit of a ratio printed with three decimals.
        tolerance = LIMIT + 100.0 * 0.0005 / abs(ratio)
        page = Page("hframe", row.table, "", tolerance, None, reading.note, reason)
        yield page.cell(symbol, "ratio", ratio, after / before)


def _springs_by_rule(bench: Workbench) -> dict[str, float]:
    frame = bench.cases["hframe"].model.frame_structure.frame
    found = spring_estimates(frame, ("horizontal@T1", "horizontal@T2"))
    return {"k_x": found["x"], "k_z": found["z"], "k_theta": found["ry"]}


def _initial(bench: Workbench, symbol: str, before: float) -> float:
    """Return the initial value; of a spring, the rule that the text gives for it."""
    return _springs_by_rule(bench).get(symbol, before)


def element_lengths(bench: Workbench) -> tuple[float, dict[str, float]]:
    """Return the element of mesh C, and those that the three printed springs follow from, in m."""
    frame = bench.cases["hframe"].model.frame_structure.frame
    horizontal = frame.members[frame.member_index["horizontal"]]
    start, stop = frame.corners[frame.member_ends[frame.member_index["horizontal"]]]
    length = float(np.linalg.norm(stop - start)) / horizontal.elements
    theirs, ours = printed("hframe")["initial_springs"], _springs_by_rule(bench)
    powers = {"k_x": 1.0, "k_z": 3.0, "k_theta": 1.0}
    return length, {
        name: length * (ours[name] / theirs[name]) ** (1.0 / n) for name, n in powers.items()
    }


def _rule(bench: Workbench, symbol: str) -> str:
    length, needed = element_lengths(bench)
    return (
        f"the rule of section 7 on the elements of mesh C, {length:.5f} m long; the printed value "
        f"needs {needed.get(symbol, length):.4f} m"
    )


def largest_miss(model: Model, theirs: Sequence[float]) -> float:
    """Return the largest deviation of a model from printed frequencies in percent."""
    return float(100.0 * np.abs(frequencies(model, USED) / np.array(theirs) - 1.0).max())


def _reason(bench: Workbench, row: Row) -> str:
    """Return why an updated parameter is not met."""
    theirs = printed("hframe")["table4"][row.key]["updated"]
    here = largest_miss(run(bench, row.updated.words).model, theirs)
    there = largest_miss(at_printed(bench, row), theirs)
    return (
        f"the converged update meets the printed frequencies within {here:.2f} %, the model at "
        f"the printed parameters within {there:.2f} % only: printed frequencies and parameters "
        "seem to belong to slightly different models"
    )


def _text_cells(bench: Workbench) -> Iterator[Cell]:
    """Return the initial offsets of section 8, printed in mm there and in m in the table."""
    text = printed("hframe")["section8"]
    row = ROWS[-1]
    found = parameter_values(bench, row, row.updated.words)
    structure = run(bench, row.updated.start).model.frame_structure
    passing = next(p for p, _ in structure.changes if p.name == row.names["a_V"])
    thousandth = Model.of(structure.with_values([passing], [1e-3 * found["a_V"][0]]))
    moved = largest_miss(thousandth, list(frequencies(Model.of(structure), USED)))
    reason = (
        "misprint: the unit, mm in the text and m in table 4(e); the frequencies cannot tell, "
        f"they differ by {moved:.4f} %"
    )
    page = Page("hframe", "4e", "mm", LIMIT, reason=reason)
    for symbol in ("a_H", "a_V"):
        yield page.cell(symbol, "initial in section 8", text[symbol], 1e3 * found[symbol][0])
