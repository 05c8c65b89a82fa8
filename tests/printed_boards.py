"""Leaderboards as README and docs print them, against the leaderboard of a run."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import femubench
from femubench import Run
from femubench.core.score.leaderboard import list_rows
from femubench.reports.cells import shorten_text
from femubench.reports.summary import finding

ROOT = Path(__file__).parents[1]
COLUMNS = ("gain", "gain_low", "gain_high", "error_percent", "better_share", "error_gain")
_ROW = re.compile(
    r"^\s*([=!*]*)(\d*)  (\S+)\s+(-?[\d.]+)  +(?:(-?[\d.]+) to (-?[\d.]+))  +"
    r"([\d.]+)  +([\d.]+)  +(-?[\d.]+)  +-?[\d.]+$",
    re.M,
)


def stored(name: str) -> Run:
    """Return the run of a board that benchmarks/boards.py keeps."""
    return femubench.read_run(ROOT / "docs" / "figures" / f"board-{name}.json")


def text_of(*names: str) -> str:
    """Return the words of documents on one line."""
    return " ".join(" ".join((ROOT / name).read_text(encoding="utf-8").split()) for name in names)


def as_printed(text: str, spare: float = 0.1) -> Any:
    """Return what a number is that is printed so; rounding may have gone either way."""
    digits = len(text.partition(".")[2])
    return pytest.approx(float(text), rel=0, abs=(0.5 + spare) * 10.0**-digits)


def assert_board_is_that_of(run: Run, name: str, mark: str = "leaderboard") -> None:
    """The table between marks of a document, and what it says below, are those of a run."""
    text = (ROOT / name).read_text(encoding="utf-8")
    board = list_rows(run)
    rows = _ROW.findall(text.partition(f"<!-- {mark} -->")[2].partition(f"<!-- /{mark} -->")[0])
    assert [(rank, name) for _, rank, name, *_ in rows] == [
        ("" if row["rank"] is None else f"{row['rank']}", shorten_text(row["strategy"], 16))
        for row in board
    ]
    for (marks, _, _, *cells), row in zip(rows, board, strict=True):
        assert ("=" in marks) == bool(row["yardstick"])
        assert ("!" in marks) == row["unphysical"]
        assert ("*" in marks) == (row["ok"] < row["total"])
        for column, cell in zip(COLUMNS, cells, strict=True):
            value = 100.0 * row[column] if column == "better_share" else row[column]
            assert value == as_printed(cell), (row["strategy"], column)
    words = " ".join(text.replace("\u2212", "-").split())
    for sentence in finding(run, board):
        assert sentence.replace("\u2212", "-") in words, sentence


# Random searches amplify rounding.
_SEARCHES = frozenset({"cma-es", "multi-start"})


def assert_same_errors(kept: Run, found: Run) -> None:
    """The errors of a run are those of one that is kept, on the cases that it has."""
    known = {(r.case, r.strategy, r.seed, r.nominal): r for r in kept.results}
    for result in found.results:
        job = result.case, result.strategy, result.seed, result.nominal
        before = known[job]
        assert (result.status, result.unphysical) == (before.status, before.unphysical), job
        rel = 0.1 if result.strategy in _SEARCHES else 5e-3
        for name, block in result.blocks.items():
            error = before.blocks[name].rms_percent
            assert block.rms_percent == pytest.approx(error, rel=rel, abs=2e-3), (job, name)
