"""The predictive board in every form: CRPS, coverage and skill by band, apart from the ranks."""

from __future__ import annotations

from typing import Any

from femubench.reports.blocks import Block, Column, Items, Passage, Table
from femubench.reports.cells import NOTHING, interval
from femubench.reports.page.rounding import clean
from femubench.reports.terminal import to_terminal
from femubench.results import PredictiveBoard, RunData

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
_LEGEND = {
    "above, in band": "unseen modes above the highest given frequency, and modified ones below "
    "it, where the given frequencies nearly are the answer",
    "CRPS": "continuous ranked probability score of ln f, less is better",
    "in 90 %": "share of the modes in 90 % intervals, near 0.90 where these are right",
    "skill": "gain of the CRPS over that of the textbook model, -1 to 1",
    "±": "states an uncertainty of its own; =: yardstick that knows nothing of the structure",
}
_COMMON = (
    "For others, and jobs without a possible model, which count as the textbook one, stands the "
    "deviation that is best for the textbook models of all other structures: "
)


class PredictiveReporter:
    """The predictive board alone, for the screen."""

    name = "predictive"
    suffix = ".predictive.txt"

    def render(self, run: RunData) -> str:
        """Return the table in 80 columns."""
        return to_terminal([Passage("", predictive_blocks(run))])


def predictive_blocks(run: RunData) -> list[Block]:
    """Return the predictive board and what its columns mean, or why there is none."""
    board = PredictiveBoard.of(run)
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
        return ["No uncertainty is stated, and to learn a common one takes 6 structures or more."]
    table = Table(list(heads.values()), [[row[key] for key in heads] for row in rows])
    return [table, Items(list(_LEGEND.items())), _describe_common(board)]


def predictive_json(run: RunData) -> dict[str, Any]:
    """Return the predictive board as plain data."""
    board = PredictiveBoard.of(run)
    common = {band: list(map(clean, ends)) for band, ends in board.common.items()}
    rows = [{name: clean(value) for name, value in row.items()} for row in board.rows]
    return {"common_percent": common, "common": _describe_common(board), "rows": rows}


def _describe_common(board: PredictiveBoard) -> str:
    """Return what stands for an uncertainty that is not stated."""
    ends = zip(("above", "in band"), board.common.values(), strict=False)
    parts = [f"{low:.1f} to {high:.1f} % {where}" for where, (low, high) in ends if low == low]
    return f"{_COMMON}{', '.join(parts) or 'none with fewer than 6 structures'}."
