"""The papers' own columns, to stand beside ours."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

from femubench.reports.summary import cases_of, measured_modes
from femubench.results import Run

# Relative; the cases hold the printed frequencies, and what goes by the same name may be another.
_SAME = 1e-6


def papers_of(run: Run) -> dict[str, dict[str, dict[int, float]]]:
    """Return printed frequencies in Hz by case, strategy and number of the mode.

    A case counts as that of a paper when it has its name and its measured frequencies.
    """
    found = {}
    for case in cases_of(run):
        paper = _printed().get(case)
        if paper is None:
            continue
        measured = {mode.number: mode.measured_hz for _, mode in measured_modes(run, case)}
        modes = range(1, len(paper["measured"]) + 1)
        if all(
            number in measured and abs(measured[number] / hertz - 1.0) <= _SAME
            for number, hertz in zip(modes, paper["measured"], strict=True)
        ):
            found[case] = {
                name: dict(zip(modes, column, strict=True))
                for name, column in paper["strategies"].items()
            }
    return found


@cache
def _printed() -> dict[str, Any]:
    text = files("femubench.papers.printed").joinpath("columns.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
