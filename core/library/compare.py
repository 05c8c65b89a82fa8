"""Two runs side by side: ``bench compare``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from os import PathLike

from femubench.core.errors import InputError
from femubench.core.library.cases import listed
from femubench.core.library.rank import read_run
from femubench.core.plugin.validation import chosen
from femubench.core.run.store import Store
from femubench.core.schema.results import Run
from femubench.core.score.comparison import (
    DEFAULT_THRESHOLDS,
    METRICS,
    Comparison,
    Threshold,
    compare_runs,
)

_THRESHOLD = re.compile(r"\s*(\w+)\s*>\s*([0-9][0-9.eE+-]*)\s*")


def compare(
    before: Run | str | PathLike[str],
    after: Run | str | PathLike[str],
    *,
    strategies: str | Iterable[str] = (),
    fail: Iterable[str | Threshold] = (),
    store: Store | str | PathLike[str] | None = None,
) -> Comparison:
    """Set run B beside run A; `Comparison.worse` tells whether B is worse.

    Arguments:
        before, after: runs, files that ``bench run --json`` wrote, or run ids in the store.
        strategies: those to compare; all where there are none.
        fail: what counts as worse, as ``"skill>1.01"`` (the default, with ``"failures>0"``): a
            ratio B / A of skill, used, higher, modified or seconds, or the number of lost results.
        store: where runs are kept.

    Raises:
        InputError: when a run cannot be found, or they have no job in common.
    """
    runs = read_run(before, store), read_run(after, store)
    known = dict.fromkeys(result.strategy for run in runs for result in run.results)
    wanted = chosen("strategy", map(str, listed(strategies)), known)
    limits = tuple(threshold_of(item) if isinstance(item, str) else item for item in listed(fail))
    return compare_runs(*runs, thresholds=limits or DEFAULT_THRESHOLDS, strategies=wanted)


def threshold_of(text: str) -> Threshold:
    """Return a threshold that is written as METRIC>NUMBER.

    Raises:
        InputError: for anything else.
    """
    found = _THRESHOLD.fullmatch(text)
    if found is not None and found[1] in METRICS:
        try:
            most = float(found[2])
        except ValueError:
            most = math.nan
        if math.isfinite(most):
            return Threshold(METRICS[METRICS.index(found[1])], most)
    expected = f"METRIC>NUMBER, METRIC one of {', '.join(METRICS)}"
    raise InputError(f"{text!r} is no threshold", expected=expected)
