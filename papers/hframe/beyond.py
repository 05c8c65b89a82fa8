"""What the paper did not compute: held-out modes, iterations, frequencies at its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from femubench import ParameterEstimate
from femubench.fem import FloatArray
from femubench.papers.hframe.meshes import frequencies
from femubench.papers.hframe.physical import (
    TimoshenkoFit,
    in_plane,
    physical_model,
    shape_paired_errors,
)
from femubench.papers.hframe.rows import FREE_EI, ROWS, at_printed, parameter_values, run
from femubench.papers.hframe.updates import USED, unit_of
from femubench.papers.printed import read_printed
from femubench.reproduction import Bars, Extra, Workbench

DIAGNOSED = "diagnosed:meet_frequencies=false"
BUILT, PHYSICAL = "C_a as built", "shear, k_theta, E"
_DRAWN = (BUILT, "a", "b", "d", "e", PHYSICAL)


@dataclass(frozen=True)
class ModelComparison:
    """Models compared on all in-plane modes that were measured.

    Arguments:
        what: from a short name to what the model is, from as built to the best physical one.
        errors: from the same names to errors in percent on modes 1 to 6 and 8, (7,).
        softer: change of the stiffness of the horizontal at its joints that was diagnosed.
        physical: the model with shear and two fitted numbers.
    """

    what: Mapping[str, str]
    errors: Mapping[str, FloatArray]
    softer: ParameterEstimate
    physical: TimoshenkoFit


def compare(bench: Workbench) -> ModelComparison:
    """Return every row of table 4 with the model as built and the physical ones."""
    case = bench.cases["hframe"]
    diagnosed, physical = run(bench, DIAGNOSED), physical_model(case)
    found = {BUILT: ("mesh C with accelerometers, nothing updated", case.model)}
    for row in ROWS:
        words = row.converged or row.updated.words
        found[row.letter] = f"{row.title}: {words}", run(bench, words).model
    found["d, EI free"] = f"as the text of (d) has it: {FREE_EI}", run(bench, FREE_EI).model
    found["diagnosed"] = f"what the drawing lacks: {DIAGNOSED}", diagnosed.model
    found[PHYSICAL] = "Timoshenko, k_theta at the column's face and E fitted", physical.model
    return ModelComparison(
        what={name: what for name, (what, _) in found.items()},
        errors={name: shape_paired_errors(case, model) for name, (_, model) in found.items()},
        softer=next(item for item in diagnosed.parameters if "branch" in item.name),
        physical=physical,
    )


def extras(bench: Workbench, comparison: ModelComparison) -> tuple[Extra, ...]:
    """Return the tables that the paper does not print."""
    rows = []
    for row in ROWS:
        theirs = read_printed("hframe")["table4"][row.key]["updated"]
        ours = frequencies(at_printed(bench, row), USED)
        for mode, (f, found) in enumerate(zip(theirs, ours, strict=True), 1):
            off = _signed(100.0 * (found / f - 1.0), 3)
            rows.append((row.table, f"mode {mode}", f"{f:.2f}", f"{found:.2f}", off))
    return (
        _held_out(bench, comparison),
        Extra(
            "Frequencies at the printed parameters",
            ("table", "mode", "printed updated, Hz", "model, Hz", "deviation, %"),
            tuple(rows),
            "No update: the parameters are set to the printed ones. Row c with rigid springs.",
        ),
        _converged(bench),
    )


def _signed(value: float, digits: int = 2) -> str:
    return f"{value:+.{digits}f}" if np.isfinite(value) else "no partner"


def _held_out(bench: Workbench, comparison: ModelComparison) -> Extra:
    data = in_plane(bench.cases["hframe"])
    rows = []
    for name, errors in comparison.errors.items():
        rms = float(np.sqrt(np.mean(errors[:USED] ** 2)))
        cells = *(_signed(e) for e in errors), f"{rms:.2f}", comparison.what[name]
        rows.append((name, *cells))
    heads = [f"{f:.2f} Hz, %" for f in data.frequencies]
    return Extra(
        "Errors on the five used and the two held-out modes",
        ("model", *heads, "rms of the five, %", "what it is"),
        tuple(rows),
        "Modes pair by shape: the seventh mode of the model is measured mode 8, 979.89 Hz; "
        "measured mode 7, 960.79 Hz, moves out of plane. Rows b and d are the converged updates.",
    )


def _converged(bench: Workbench) -> Extra:
    rows, ratios = [], ("printed ratio", "our ratio")
    for row in ROWS:
        theirs = read_printed("hframe")["table4"][row.key]["parameters"]
        cells = {name: row.apart.get(name, row.updated).words for name in row.names}
        runs = [("as in the cells", cells)]
        undamped = dict.fromkeys(row.names, row.converged or row.updated.words)
        runs += [("without damping of its own", undamped)] if undamped != cells else []
        free = dict.fromkeys(row.names, FREE_EI)
        runs += [("EI free, as the text has it", free)] if row.letter == "d" else []
        for what, words in runs:
            for symbol, chosen in words.items():
                before, after = parameter_values(bench, row, chosen)[symbol]
                first, last = theirs[symbol]
                off = _signed(100.0 * (after / last - 1.0), 3)
                unit, ratio = unit_of(symbol), f"{after / before:.4f}"
                figures = f"{last:.6g} {unit}", f"{after:.6g} {unit}", off
                rows.append((row.table, symbol, what, *figures, f"{last / first:.4f}", ratio))
    return Extra(
        "Updated parameters",
        ("table", "parameter", "update", *("printed", "ours", "deviation, %"), *ratios),
        tuple(rows),
        "In c only EI / rho A is determined; in d k_x and k_z are not.",
    )


def draw_held_out_bars(bench: Workbench, comparison: ModelComparison) -> Bars:
    """Return the errors of six models on seven modes."""
    data = in_plane(bench.cases["hframe"])
    kinds = ["used"] * USED + ["held out"] * (len(data) - USED)
    groups = zip(data.numbers, data.frequencies, kinds, strict=True)
    return Bars(
        name="hframe-held-out",
        title="Errors on used and held-out modes of the H-frame",
        caption="Modes 1 to 5 are given to the updates, 6 and 8 are not. a to e are the rows of "
        "table 4; the last model has shear, rotary inertia, a rotational spring at the face of "
        "each column and one factor on E.",
        groups=tuple(f"{number}, {kind}\n{f:.2f} Hz" for number, f, kind in groups),
        series=tuple((name, tuple(float(e) for e in comparison.errors[name])) for name in _DRAWN),
        group_label="measured mode",
        value_label="frequency error, %",
        lines=(("measured", 0.0),),
    )
