"""Table 4 (a) to (e): frequencies, errors and parameters before and after the updates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from femubench import Model
from femubench.papers.hframe.meshes import LEVERS, frequencies, levered
from femubench.papers.hframe.rows import ROWS, Setup, Update, at_printed, parameter_values, run
from femubench.papers.printed import read_printed
from femubench.reproduction import Cell, Ground, Page, Workbench
from femubench.update import Joints

INITIAL, UPDATED, LIMIT = 0.01, 0.05, 0.1  # of frequencies and of parameters, in percent
DIGITS = {"k_x": -7, "k_z": -7, "a_H": 4}  # printed with three digits
# Digits of the initial springs, and the power of the length of an element that each goes with.
RULED = {"k_x": (-7, 1.0), "k_z": (-7, 3.0), "k_theta": (-4, 1.0)}
UNITS = {"EI": "N m2", "rhoA": "kg/m", "k_theta": "N m/rad", "k": "N/m", "a": "m"}
USED, ERROR_DECIMALS = 5, 2
_TAKEN = Ground("input", "an initial value that the update is given")
_ERROR = Ground(
    "input",
    "by definition: the error of the printed frequency next to it; ours is computed from that and "
    "the measured one",
)
_RATIO = Ground(
    "input", "by definition: the ratio of the two printed values; ours is computed from them"
)


def unit_of(symbol: str) -> str:
    """Return the unit of a parameter by the paper's symbol."""
    return UNITS.get(symbol) or UNITS[symbol.split("_")[0]]


def update_cells(bench: Workbench) -> tuple[Cell, ...]:
    """Return all cells of table 4, and the initial offsets as section 8 states them."""
    cells: list[Cell] = []
    for row in ROWS:
        theirs = read_printed("hframe")["table4"][row.key]
        cells += _mode_cells(bench, row, theirs, "initial", row.initial, INITIAL)
        cells += _mode_cells(bench, row, theirs, "updated", row.updated, UPDATED)
        cells += _parameter_cells(bench, row, theirs)
    return (*cells, *_text_cells(bench))


def _mode_cells(
    bench: Workbench, row: Update, theirs: dict[str, Any], column: str, reading: Setup, limit: float
) -> Iterator[Cell]:
    words = reading.start if column == "initial" else reading.words
    ours = frequencies(run(bench, words).model, USED)
    measured = bench.cases["hframe"].used_measurement(0).frequencies
    ground = reading.ground if column == "initial" else reading.stated
    hertz = Page("hframe", row.table, (ground,), "Hz", limit, decimals=2)
    for i, (f, f_m) in enumerate(zip(theirs[column], measured, strict=True)):
        yield hertz.cell(f"mode {i + 1}", column, f, float(ours[i]))
        own = 100.0 * (f / float(f_m) - 1.0)
        wrong = Ground("misprint", f"the printed frequencies, {f} and {f_m} Hz, give {own:+.2f} %")
        page = Page("hframe", row.table, (_ERROR,), "%", 0.0, ERROR_DECIMALS, wrong)
        yield page.cell(f"mode {i + 1}", f"{column} error", theirs[f"{column}_error"][i], own)


def _parameter_cells(bench: Workbench, row: Update, theirs: dict[str, Any]) -> Iterator[Cell]:
    at_test = read_printed("hframe")["table4"][row.key]["updated"]
    here = largest_miss(run(bench, row.updated.words).model, at_test)
    there = largest_miss(at_printed(bench, row), at_test)
    missed = Ground(
        "does-not-follow",
        f"the converged update meets the printed frequencies within {here:.2f} %, the model at "
        f"the printed parameters within {there:.2f} % only: theirs is slightly another model",
    )
    length, common, springs = springs_by_rule(bench)
    rule = Ground(
        "fitted",
        f"by the rule of section 7 with elements of {common:.4f} m, the one length that meets all "
        f"three springs; those of mesh C on the recovered dimensions have {length:.5f} m: what "
        "disagrees is the recovered length of the horizontal, not the printed springs",
    )
    for symbol, (first, last) in theirs["parameters"].items():
        reading = row.apart.get(symbol, row.updated)
        before, after = parameter_values(bench, row, reading.words)[symbol]
        digits, unit = DIGITS.get(symbol), unit_of(symbol)
        first_digits, _ = RULED.get(symbol, (digits, 1.0))
        ground = rule if symbol in RULED else _TAKEN
        page = Page("hframe", row.table, (ground,), unit, LIMIT, first_digits)
        yield page.cell(symbol, "initial", first, springs.get(symbol, before))
        page = Page("hframe", row.table, (reading.stated,), unit, LIMIT, digits, missed, LEVERS)
        others = partial(_levered_values, bench, row, reading.words, symbol)
        yield page.cell(symbol, "updated", last, after, others)
        ratio, own = theirs["ratios"][symbol], last / first
        # The three digits of the values, and half a digit of a ratio printed with three decimals.
        tolerance = LIMIT + 100.0 * 0.0005 / abs(ratio)
        wrong = Ground("misprint", f"the printed values, {first:g} and {last:g}, give {own:.4f}")
        page = Page("hframe", row.table, (_RATIO,), "", tolerance, None, wrong)
        yield page.cell(symbol, "ratio", ratio, own)


def _levered_values(bench: Workbench, row: Update, words: str, symbol: str) -> Iterator[float]:
    for case in levered(bench.cases["hframe"]):
        other = Workbench(bench.strategies, {"hframe": case}, bench.on_advance)
        yield parameter_values(other, row, words)[symbol][1]


def springs_by_rule(bench: Workbench) -> tuple[float, float, dict[str, float]]:
    """Return the element of mesh C, the one that the printed springs ask for, and its springs.

    The second, in m as well, is the middle of the lengths that all three round to print with.
    """
    structure = bench.cases["hframe"].model.frame_structure
    frame = structure.frame
    horizontal = frame.members[frame.member_index["horizontal"]]
    start, stop = frame.corners[frame.member_ends[frame.member_index["horizontal"]]]
    length = float(np.linalg.norm(stop - start)) / horizontal.elements
    found = Joints(structure).spring_estimates(("horizontal@T1", "horizontal@T2"))
    ours = dict(zip(RULED, (found["x"], found["z"], found["ry"]), strict=True))
    ends, theirs = [], read_printed("hframe")["initial_springs"]
    for symbol, (digits, power) in RULED.items():
        printed = theirs[symbol] + 0.5 * 10.0**-digits * np.array([1.0, -1.0])
        ends.append(length * (ours[symbol] / printed) ** (1.0 / power))
    low, high = np.transpose(ends)
    common = float(0.5 * (low.max() + high.min()))
    return length, common, {s: ours[s] * (length / common) ** n for s, (_, n) in RULED.items()}


def largest_miss(model: Model, theirs: Sequence[float]) -> float:
    """Return the largest deviation of a model from printed frequencies in percent."""
    return float(100.0 * np.abs(frequencies(model, USED) / np.array(theirs) - 1.0).max())


def _text_cells(bench: Workbench) -> Iterator[Cell]:
    """Return the initial offsets of section 8, printed in mm there and in m in the table."""
    text = read_printed("hframe")["section8"]
    row = ROWS[-1]
    found = parameter_values(bench, row, row.updated.words)
    structure = run(bench, row.updated.start).model.frame_structure
    passing = next(p for p, _ in structure.changes if p.name == row.names["a_V"])
    thousandth = Model.of(structure.with_values([passing], [1e-3 * found["a_V"][0]]))
    moved = largest_miss(thousandth, list(frequencies(Model.of(structure), USED)))
    unit = Ground(
        "misprint",
        "the unit, mm in the text and m in table 4(e); the frequencies cannot tell, they differ by "
        f"{moved:.4f} %",
    )
    page = Page("hframe", "4e", (_TAKEN,), "mm", LIMIT, fault=unit)
    for symbol in ("a_H", "a_V"):
        yield page.cell(symbol, "initial in section 8", text[symbol], 1e3 * found[symbol][0])
