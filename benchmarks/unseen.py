"""Errors on what a strategy was not given, as multiples of those of the textbook model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import log

import numpy as np

from femubench import Run
from femubench.core.schema.results import UNSEEN
from femubench.core.score.statistics import FEWEST, interval_of_mean
from femubench.results import JobResult

OFFSET_PERCENT = 0.05  # added to both errors: one that is met must not decide everything


def unseen_logs(run: Run, zero: str = "textbook") -> dict[str, dict[str, float]]:
    """Return ln of the error over that of a strategy that is there, by strategy and structure.

    Geometric means over the unseen blocks of all cases and seeds of a structure. Without a model it
    stays as it was.

    Arguments:
        run: with the strategy `zero` in it.
        zero: whose errors are the unit.
    """
    structures = run.structures
    unit = {r.case: _errors(r) for r in run.results if r.strategy == zero}
    found: dict[str, dict[str, list[float]]] = {}
    for result in run.results:
        base = unit[result.case]
        own = _errors(result) if result.status == "ok" else base
        rows = found.setdefault(result.strategy, {})
        structure = structures.get(result.case, result.case)
        rows.setdefault(structure, []).extend(
            log((own[name] + OFFSET_PERCENT) / (error + OFFSET_PERCENT))
            for name, error in base.items()
        )
    return {
        strategy: {name: float(np.mean(values)) for name, values in rows.items() if values}
        for strategy, rows in found.items()
    }


def _errors(result: JobResult) -> dict[str, float]:
    return {name: b.rms_percent for name, b in result.blocks.items() if name in UNSEEN}


def mean_ratio(logs: Mapping[str, float], structures: Iterable[str] | None = None) -> float:
    """Return the geometric mean of the ratios of some structures, all where none is named."""
    names = logs if structures is None else structures
    return float(np.exp(np.mean([logs[name] for name in names])))


def interval(logs: Iterable[float]) -> str:
    """Return the 95 % interval of a geometric mean over structures, in words for a table."""
    values = np.array(list(logs))
    if len(values) < FEWEST:
        return "-"
    low, high = np.exp(interval_of_mean(values))
    return f"{low:.2f} to {high:.2f}"
