"""How much nearer to the test solids are than beams, as drawn and updated: docs/scenarios.md.

python benchmarks/solid_drawings.py --store DIR    # docs/data/solid-drawings.csv, a minute each
python benchmarks/solid_drawings.py    # of that table and the kept boards: the page
"""

from __future__ import annotations

import argparse
import textwrap
from pathlib import Path

import numpy as np
import pandas as pd
from boards import file_of, put
from sweep_data import as_markdown

import femubench
from truths.solid_drawing import DECK, DRAWN
from truths.suite import SUITE

ROOT = Path(__file__).parents[1]
DATA, PAGE = ROOT / "docs" / "data" / "solid-drawings.csv", ROOT / "docs" / "scenarios.md"
STRATEGIES = ("unchanged", "global", "bayesian", "bayesian-sampling", "diagnosed")
STRATEGIES += ("eigensensitivity", "sparse", "cross-model", "baruch")
ERRORS, PHYSICAL = ["higher", "modified"], STRATEGIES[2:5]
COLUMNS = ("structure", "nodes", "groups", "beams", "best on beams", "solid", "best on the solid")


def rows_of(run: femubench.Run) -> pd.DataFrame:
    """Return structure, strategy, status and both errors (rms %) of the jobs of a run."""
    rows = [
        {
            "structure": result.case.removeprefix("suite/").partition(":")[0],
            "strategy": result.strategy,
            "status": "unphysical" if result.unphysical else result.status,
            **{name: block.rms_percent for name, block in result.blocks.items()},
        }
        for result in run.results
        if result.strategy in STRATEGIES
    ]
    return pd.DataFrame(rows)[["structure", "strategy", "status", *ERRORS]].round(4)


def table_of(solids: pd.DataFrame, beams: pd.DataFrame) -> str:
    """Return the table of the page, and what it comes to."""
    drawn, best, rows, names = [], [], [], sorted(set(solids["structure"]))
    for jobs in (beams, solids):
        own = jobs[jobs["structure"].isin(names)].set_index("structure").sort_index()
        drawn.append(own[own["strategy"] == "unchanged"])
        done = own[own["status"] == "ok"]
        done = done.assign(mean=np.log(done[ERRORS]).mean(axis=1)).sort_values("mean")
        best.append(done[~done.index.duplicated()].sort_index())
    for name in names:
        deck = (SUITE / name / DECK).read_text(encoding="utf-8")
        nodes = deck.partition("*ELEMENT")[0].count("\n") - 1
        groups = deck.count("*SOLID SECTION") + deck.count("*SPRING,")
        cells = [f"`{name}`", str(nodes), str(groups)]
        for pair in zip(drawn, best, strict=True):
            for table, word in zip(pair, ("", f" `{pair[1].strategy[name]}`"), strict=True):
                cells.append(f"{table.higher[name]:.1f} / {table.modified[name]:.1f}{word}")
        rows.append(dict(zip(COLUMNS, cells, strict=True)))
    ratios = [np.exp(np.log(s[ERRORS] / b[ERRORS]).to_numpy().mean()) for b, s in (drawn, best)]
    fine = (solids["status"] == "ok").groupby(solids["strategy"])
    text = (
        f"In the geometric mean over these {len(names)} structures the solid as drawn errs "
        f"{ratios[0]:.2f} times as much as the beams, and the best on it {ratios[1]:.2f} times as "
        "much as the best on them. Physical models on the solid: "
        + ", ".join(f"`{s}` {fine.sum()[s]} of {fine.size()[s]}" for s in PHYSICAL)
        + "."
    )
    return f"{as_markdown(rows)}\n\n{textwrap.fill(text, 118, break_long_words=False)}"


def main() -> None:
    """Run where a store is given; put the table into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--store", help="keep the run there, and go on with what is there")
    store = parser.parse_args().store
    if store:
        words = {"drawing": "solid", "nominal": "drawn", "store": store, "resume": True}
        # One model in memory at a time.
        runs = (femubench.rank(f"suite/{name}", STRATEGIES, jobs=1, **words) for name in DRAWN)
        rows = pd.concat([rows_of(run) for run in runs])
        rows.to_csv(DATA, index=False, lineterminator="\n")
    boards = [rows_of(femubench.read_run(file_of(name))) for name in ("suite", "after")]
    text = table_of(pd.read_csv(DATA), pd.concat(boards))
    put("solid-drawings", text, PAGE)
    print(text)


if __name__ == "__main__":
    main()
