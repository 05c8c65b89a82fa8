"""The predictive board in every form: CRPS, coverage and skill by band, apart from the ranks."""

from __future__ import annotations

from typing import Any

from femubench.reports.blocks import Block, Column, Items, Passage, Table
from femubench.reports.cells import NOTHING, interval
from femubench.reports.page.rounding import clean
from femubench.reports.terminal import to_terminal
from femubench.results import PredictiveBoard, Run

_COLUMNS = {
    "name": Column("strategy", 18, left=True),
    "above_crps_percent": Column("above\nCRPS\n%", 5, digits=2),
    "above_coverage90": Column("in\n90 %", 4, digits=2),
    "above_skill": Column("skill", 6, digits=3),
    "interval": Column("95 % interval", 16),
    "band_crps_percent": Column("in band\nCRPS\n%", 7, digits=2),
    "band_coverage90": Column("in\n90 %", 4, digits=2),
    "band_skill": Column("skill", 6, digits=3),
}
_LEGEND = [
    (
        "above, in band",
        "unseen modes above the highest given frequency, and modified ones below it, where the "
        "given frequencies nearly are the answer",
    ),
    ("CRPS", "continuous ranked probability score of ln f, less is better"),
    ("in 90 %", "share of the modes in 90 % intervals, near 0.90 where these are right"),
    ("skill", "gain of the CRPS over that of the textbook model, -1 to 1"),
    ("±", "states an uncertainty of its own; =: yardstick that knows nothing of the structure"),
]


class PredictiveReporter:
    """The predictive board alone, for the screen."""

    name = "predictive"
    suffix = ".predictive.txt"

    def render(self, run: Run) -> str:
        """Return the table in 80 columns."""
        return to_terminal([Passage("", predictive_blocks(PredictiveBoard.of(run)))])


def predictive_blocks(board: PredictiveBoard) -> list[Block]:
    """Return the predictive board and what its columns mean, or why there is none."""
    if (table := predictive_table(board)) is None:
        return ["No uncertainty is stated, and to learn a common one takes 6 structures or more."]
    return [table, Items(list_remarks(board))]


def predictive_table(board: PredictiveBoard) -> Table | None:
    """Return the table without columns of which nothing is known; None where no score is."""
    rows: list[dict[str, Any]] = [
        {
            **row,
            "name": "= " * bool(row["yardstick"]) + "± " * bool(row["stated"]) + row["strategy"],
            "interval": interval(row["above_low"], row["above_high"]),
        }
        for row in board.rows
    ]
    heads = {k: h for k, h in _COLUMNS.items() if {h.text(r[k]) for r in rows} - {NOTHING, ""}}
    if not any(name.endswith("crps_percent") for name in heads):
        return None
    return Table(list(heads.values()), [[row[key] for key in heads] for row in rows])


def list_remarks(board: PredictiveBoard) -> list[tuple[str, str]]:
    """Return what the columns mean, and what stands for an uncertainty that is not stated."""
    parts = [
        f"{low:.1f} to {high:.1f} % {where}"
        for where, (low, high) in zip(("above", "in band"), board.common.values(), strict=True)
        if low == low
    ]
    common = (
        "the standard deviation that is best for the textbook models of all other structures "
        f"({', '.join(parts)}); a job without a possible model counts as the textbook one with it"
    )
    few = "fewer than 6 structures: no score"
    return [*_LEGEND, ("where none is stated", common if parts else few)]


def predictive_json(board: PredictiveBoard) -> dict[str, Any]:
    """Return the predictive board as plain data."""
    rows = [
        {name: clean(value) for name, value in row.items()}
        | {"yardstick": row["yardstick"] or None}
        for row in board.rows
    ]
    common = {band: list(map(clean, ends)) for band, ends in board.common.items()}
    return {"common_percent": common, "rows": rows}
