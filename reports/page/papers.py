"""The papers' own columns, for comparison with ours."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

from femubench.reports.summary import cases_of, first_seed, measured_modes
from femubench.results import RunData

# Relative; the cases hold the printed frequencies, and what goes by the same name may be another.
_SAME = 1e-6


def papers_of(run: RunData) -> dict[str, dict[str, dict[int, float]]]:
    """Return printed frequencies in Hz by case, strategy and number of the mode.

    A case counts as that of a paper when it has its name and its measured frequencies.
    """
    found = {}
    for case in filter(_printed().__contains__, cases_of(run)):
        paper = _printed()[case]
        measured = {mode.number: mode.measured_hz for _, mode in measured_modes(run, case)}
        if all(
            math.isclose(measured.get(number, 0.0), hertz, rel_tol=_SAME)
            for number, hertz in enumerate(paper["measured"], 1)
        ):
            columns = paper["strategies"].items()
            found[case] = {name: dict(enumerate(column, 1)) for name, column in columns}
    return found


def list_drawn_frequencies(run: RunData) -> dict[str, dict[str, dict[int, float | None]]]:
    """Return our own frequencies in Hz from the models as drawn, as the papers have them.

    By case, strategy and mode; of the first seed, where a run starts from both nominal models.
    """
    if len(run.nominals) < 2:
        return {}
    seed, found = first_seed(run), papers_of(run)
    return {
        case: {
            result.strategy: {
                mode.number: mode.predicted_hz
                for name in ("used", "higher")
                if name in result.blocks
                for mode in result.blocks[name].modes
            }
            for result in run.started_from("drawn")
            if result.case == case and result.seed == seed and result.strategy in strategies
        }
        for case, strategies in found.items()
    }


@cache
def _printed() -> dict[str, Any]:
    text = files("femubench.papers.printed").joinpath("columns.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
