"""Leaderboards as README and docs print them, against the leaderboard of a run."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from femubench import Run
from femubench.results import leaderboard

ROOT = Path(__file__).parents[1]
# Those that the docs on noise and on the last step of `diagnosed` speak of.
TWO_STRUCTURES = (
    *("frame", "hframe", "frame-solid", "hframe-solid"),
    *("frame-beam", "frame-beam-asymmetric", "design-change"),
)
# Counts of evaluations and seconds are those of one machine.
COLUMNS = (
    *("skill", "used_percent", "higher_percent", "modified_percent"),
    *("rigid_modes_lost", "negative_eigenvalues", "parameters"),
)
_ROW = re.compile(r"^\s*([!*]*)(\d+)  (\S+)((?:\s+[\d.–]+){9})$", re.M)
_UNSEEN = re.compile(r"([!*]*)([a-z-]+) (\d+\.\d\d)(?:,|$)")


def text_of(*names: str) -> str:
    """Return the words of documents on one line."""
    return " ".join(" ".join((ROOT / name).read_text(encoding="utf-8").split()) for name in names)


def as_printed(text: str, spare: float = 0.1) -> Any:
    """Return what a number is that is printed so; rounding may have gone either way."""
    digits = len(text.partition(".")[2])
    return pytest.approx(float(text), rel=0, abs=(0.5 + spare) * 10.0**-digits)


def assert_board_is_that_of(run: Run, name: str) -> None:
    """The table and the line on unseen data that a document prints are those of a run."""
    text = (ROOT / name).read_text(encoding="utf-8")
    board = leaderboard(run).to_dict("records")
    rows = _ROW.findall(text)
    assert [(int(rank), name) for _, rank, name, _ in rows] == [
        (row["rank"], row["strategy"]) for row in board
    ]
    for (marks, _, _, cells), row in zip(rows, board, strict=True):
        assert ("!" in marks) == row["unphysical"]
        assert ("*" in marks) == (row["ok"] + row["not_applicable"] < row["total"])
        for column, cell in zip(COLUMNS, cells.split(), strict=False):
            assert row[column] == as_printed(cell), (row["strategy"], column)
    line = text[text.index("skill on unseen data (higher") :].partition(": ")[2]
    listed = _UNSEEN.findall(" ".join(line.partition("```")[0].partition("\n\n")[0].split()))
    assert {name for _, name, _ in listed} == {row["strategy"] for row in board}
    unseen = {row["strategy"]: row["skill_unseen"] for row in board}
    for _, name, value in listed:
        assert unseen[name] == as_printed(value), name
    values = [float(value) for *_, value in listed]
    assert values == sorted(values)
