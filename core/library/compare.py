"""Two runs side by side: ``bench compare``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from os import PathLike

from femubench.core.errors import InputError
from femubench.core.library.cases import as_list
from femubench.core.library.rank import read_run
from femubench.core.plugin.validation import choose_names
from femubench.core.run.store import Store
from femubench.core.schema.results import RunData
from femubench.core.score.comparison import (
    DEFAULT_THRESHOLDS,
    METRICS,
    Against,
    Comparison,
    Threshold,
    compare_runs,
)

_THRESHOLD = re.compile(r"\s*(\w+)\s*>\s*([0-9][0-9.eE+-]*)\s*")


def compare(
    before: RunData | str | PathLike[str],
    after: RunData | str | PathLike[str] | None = None,
    *,
    strategies: str | Iterable[str] = (),
    against: tuple[str, str] | None = None,
    fail: Iterable[str | Threshold] = (),
    store: Store | str | PathLike[str] | None = None,
) -> Comparison:
    """Compare run B with run A; `Comparison.worse` tells whether B is worse.

    Arguments:
        before, after: runs, files that ``bench run --json`` wrote, or run ids in the store; with
            `against`, one run will do.
        strategies: those to compare; all where there are none.
        against: strategy X of A and Y of B, to compare these two alone.
        fail: what counts as worse, as ``"loss>0.01"`` (the default, with ``"failures>0"``): the
            loss of gain, a ratio B / A of used, higher, modified or seconds, or the number of lost
            results.
        store: where runs are kept.

    Raises:
        InputError: when a run cannot be found, or they have no job in common.

    Examples:
        >>> femubench.compare(run, against=(nominal.name, scaled.name)).worse
        False
    """
    one = read_run(before, store)
    if after is None and against is None:
        raise InputError("one run alone", expected="two runs, or two strategies of one")
    other = one if after is None else read_run(after, store)
    known = [[result.strategy for result in run.results] for run in (one, other)]
    for name, there in zip(against or (), known, strict=False):
        choose_names("strategy", [name], there)
    wanted = choose_names("strategy", map(str, as_list(strategies)), (*known[0], *known[1]))
    limits = tuple(threshold_of(item) if isinstance(item, str) else item for item in as_list(fail))
    pair = None if against is None else Against(*against)
    limits = limits or DEFAULT_THRESHOLDS
    return compare_runs(one, other, thresholds=limits, strategies=wanted, against=pair)


def threshold_of(text: str) -> Threshold:
    """Return a threshold that is written as METRIC>NUMBER; raises InputError for anything else."""
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
