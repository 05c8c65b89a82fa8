"""Search for readings of the ladder paper that give its open columns; write docs/reproduce.md.

    python benchmarks/open_cells.py [--every N] [--write]     # some minutes on one core

`equation_readings` says what a reading is. `--every` tries one of so many of them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.linalg as la
from equation_readings import Reading, predicted
from nearest_model import nearest_with
from open_cells_choices import ALONE, AXES, CLOSING, EXPANSIONS, WEIGHTS
from open_cells_numbering import DIRECTIONS, SHAPES, direction
from sweep_data import DATA, as_markdown, filled
from threadpoolctl import threadpool_limits

from femubench import StrategyFailure
from femubench.fem import FloatArray
from femubench.papers.printed import read_printed

PAGE = Path(__file__).parents[1] / "docs" / "reproduce.md"
CLOSED = 0.5  # percent
TABLES = read_printed("frame")
NOMINAL = TABLES["table1"]["fe"]
# Family: what the page calls the column, and where it is printed.
COLUMNS = {
    "physical": ("physical", "table3", "physical"),
    "nobari": ("Nobari", "table3", "nobari"),
    "generic-ls": ("generic LS", "table4", "generic_ls"),
    "generic-adjusted": ("generic adjusted", "table4", "generic_adjusted"),
    "kabe-rigid": ("Kabe + rigid", "table2", "nonzeros_rigid"),
}


@dataclass(frozen=True)
class Found:
    """What a reading predicts, and its largest deviation from the printed column in percent."""

    reading: Reading
    rigid: FloatArray
    modes: FloatArray

    @property
    def deviation(self) -> float:
        """Return the largest deviation over the five modes."""
        return deviation(self.modes, self.reading.family)


def column(family: str) -> FloatArray:
    """Return the five printed frequencies in Hz."""
    _, table, name = COLUMNS[family]
    return np.array(TABLES[table][name]["modes"])


def deviation(modes: Sequence[float] | FloatArray, family: str) -> float:
    """Return the largest deviation from a printed column in percent."""
    return float(100.0 * np.abs(np.asarray(modes) / column(family) - 1.0).max())


def found(readings: Iterable[Reading]) -> list[Found]:
    """Return what readings predict; those that lose a measured mode on the way are left out."""
    results = []
    for reading in readings:
        try:
            results.append(Found(reading, *predicted(reading)))
        except (StrategyFailure, la.LinAlgError):
            continue
    return results


def grid(family: str) -> list[Reading]:
    """Return the readings of one column: every combination of the axes that matter."""
    chosen: list[dict[str, object]] = []
    for expansion, data, loaded in product(EXPANSIONS, ("twin", "beam"), (True, False)):
        merged = {"data": data, **expansion, "accelerometer": loaded}
        # The twin's shapes carry the accelerometer.
        if (loaded or merged["data"] == "beam") and merged not in chosen:
            chosen.append(merged)
    return [
        replace(
            Reading(family=family), **words, target=target, rows=rows,
            diagonal=diagonal, cross=cross, iterations=iterations,
        )
        for words, target, rows, (diagonal, cross), iterations in product(
            chosen, ("measured", "nominal"), ("paper", "raw", "mass"), WEIGHTS[:4], (5, 1),
        )
    ]  # fmt: skip


def across(results: Sequence[Found]) -> pd.DataFrame:
    """Return the largest deviation in percent, a row a reading, a column a family."""
    rows = [(f.reading.words, f.reading.family, f.deviation) for f in results]
    table = pd.DataFrame(rows, columns=["reading", "family", "percent"])
    return table.drop_duplicates(["reading", "family"]).pivot(
        index="reading", columns="family", values="percent"
    )


def best_rows(results: Sequence[Found], family: str, count: int = 4) -> list[dict[str, str]]:
    """Return the best readings of a column that differ in their result."""
    table, seen, rows = across(results), set(), []
    for best in sorted(
        (f for f in results if f.reading.family == family), key=lambda f: f.deviation
    ):
        stated = tuple(np.round(best.modes))
        if stated in seen or len(rows) == count:
            continue
        seen.add(stated)
        others = table.loc[best.reading.words]
        rows.append(
            {
                "column": COLUMNS[family][0],
                "reading": best.reading.words,
                "modes, Hz": " ".join(f"{hz:.1f}" for hz in best.modes),
                "rigid, Hz": _rigid(best.rigid),
                "off, %": f"{best.deviation:.2f}",
                "same reading elsewhere, %": ", ".join(
                    f"{COLUMNS[name][0]} {_percent(float(others.get(name, np.nan)))}"
                    for name in COLUMNS
                    if name != family
                ),
            }
        )
    return rows


def count_rows(results: Sequence[Found]) -> list[dict[str, str]]:
    """Return how many readings come within 0.5 % of each column, by the frequencies asked for."""
    rows = []
    for family, (name, _, _) in COLUMNS.items():
        row = {"column": name, "unchanged model, %": f"{deviation(NOMINAL, family):.2f}"}
        for target in ("measured", "nominal"):
            own = [f for f in results if f.reading.family == family and f.reading.target == target]
            off = [f.deviation for f in own]
            row[f"{target} frequencies: within 0.5 %"] = (
                f"{sum(x < CLOSED for x in off)} of {len(off)}, best {min(off):.2f} %"
            )
        rows.append(row)
    return rows


def _percent(value: float) -> str:
    if not np.isfinite(value):
        return "none"
    return f"{value:.1f}" if value < 100.0 else "> 100"


def _rigid(rigid: FloatArray) -> str:
    return " ".join(f"{-hz:.0f}i" if hz < -0.5 else f"{abs(hz):.0f}" for hz in rigid)


def axis_rows(every: int) -> list[dict[str, str]]:
    """Return what single departures from the built-in reading do to the two open columns."""
    rows = []
    for axis, choices in list(AXES.items())[::every]:
        row = {"departure": axis}
        for family in ("physical", "nobari", "generic-adjusted"):
            base = Reading(family=family)
            skipped = ALONE.get(axis, family) != family
            results = [] if skipped else found(replace(base, **one) for one in choices[::every])
            off = [one.deviation for one in results]
            said = f"{_percent(min(off))} to {_percent(max(off))}" if len(off) > 1 else ""
            row[f"{COLUMNS[family][0]}, %"] = said or (_percent(off[0]) if off else "-")
        rows.append(row)
    return rows


def numbering_rows(every: int) -> list[dict[str, str]]:
    """Return the adjusted column where tied cores follow the numbering of the members."""
    rows = []
    for name, words in SHAPES.items():
        base = replace(Reading(family="generic-adjusted"), **words)
        turned = DIRECTIONS[::every]
        tried = found(replace(base, sharing="numbered", backward=b) for b in turned)
        off = [round(one.deviation, 6) for one in tried]  # all turned is none turned
        best = tried[int(np.argmin(off))]
        rows.append(
            {
                "reading": name,
                "turned (built in), %": f"{found([base])[0].deviation:.2f}",
                "not turned, %": f"{min(off):.2f} to {max(off):.2f}",
                "within 1 %, 0.5 %": f"{sum(x < 1.0 for x in off)}, {sum(x < CLOSED for x in off)}",
                "best, Hz": " ".join(f"{hz:.1f}" for hz in best.modes),
                "its numbering": direction(best.reading.backward),
            }
        )
    return rows


def need_rows(every: int) -> list[dict[str, str]]:
    """Return what the physical column would need, for equations with and without orthogonality."""
    rows = []
    for words in (
        {},
        {"diagonal": 0.0, "cross": 0.0},
        {"expansion": "force", "start": "nominal"},
        {"expansion": "force", "start": "nominal", "diagonal": 0.0, "cross": 0.0},
    )[::every]:
        reading = replace(Reading(), **words)
        start, least, there, largest = nearest_with(reading, column("physical"))
        rows.append(
            {
                "equations": reading.words,
                "nominal": f"{start:.3f}",
                "least squares": f"{least:.3f}",
                "best with the printed five": f"{there:.3f}",
                "its largest change of a parameter": f"{100.0 * largest:.0f} %",
            }
        )
    return rows


def firm_rows(every: int) -> list[dict[str, str]]:
    """Return how the readings that close a column stand against other shapes."""
    rows = []
    for reading in CLOSING[::every]:
        drawn = [replace(reading, noise=0.01, seed=seed) for seed in range(0, 20, every)]
        off = [one.deviation for one in found(drawn)]
        other = replace(reading, data="beam" if reading.data == "twin" else "twin")
        moved = "-" if reading.expansion == "all dofs" else _percent(found([other])[0].deviation)
        own = found([reading])[0]
        rows.append(
            {
                "column": COLUMNS[reading.family][0],
                "reading": reading.words,
                "rigid, Hz": _rigid(own.rigid),
                "modes, Hz": " ".join(f"{hz:.1f}" for hz in own.modes),
                "off, %": f"{own.deviation:.2f}",
                "1 % noise, 20 draws, %": "-"
                if reading.expansion == "all dofs"
                else f"{min(off):.2f} to {max(off):.2f}",
                "the other shapes, %": moved,
            }
        )
    return rows


def search(every: int) -> tuple[str, dict[str, list[dict[str, str]]]]:
    """Return the generated part of the page, and the rows of the tables in docs/data."""
    results: list[Found] = []
    for family in COLUMNS:
        readings = grid(family)
        results += found(readings[::every])
        print(f"{family}: {len(readings)} readings", flush=True)
    parts = [
        f"{len(results)} readings gave a model. Printed, modes 1 to 5 in Hz:",
        "\n".join(f"- {n}: {' '.join(map(str, column(f)))}" for f, (n, _, _) in COLUMNS.items()),
        "How many come near, by the frequencies that the equations ask for:",
        as_markdown(count_rows(results)),
    ]
    return "\n\n".join(parts), {
        "best": [row for family in COLUMNS for row in best_rows(results, family)],
        "departures": axis_rows(every),
        "numbering": numbering_rows(every),
        "equations": need_rows(every),
        "shapes": firm_rows(every),
    }


def main() -> None:
    """Search, print, and with --write replace the generated block of the page and its data."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1, help="readings of which one is tried")
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.name} and {DATA.name}")
    options = parser.parse_args()
    with threadpool_limits(1):
        text, tables = search(options.every)
    print(text)
    for name, rows in tables.items():
        print(f"\n{name}\n\n{as_markdown(rows)}")
    if options.write:
        page = filled(PAGE.read_text(encoding="utf-8"), text, "open-cells")
        PAGE.write_text(page, encoding="utf-8")
        for name, rows in tables.items():
            table = pd.DataFrame(rows)
            table.to_csv(DATA / f"open-cells-{name}.csv", index=False, lineterminator="\n")


if __name__ == "__main__":
    main()
