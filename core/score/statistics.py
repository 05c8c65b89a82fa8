"""Whether ratios of errors differ from 1 by more than chance: signed ranks, Holm, bootstrap."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from femubench.core.typing import FloatArray

Verdict = Literal["better", "worse", "no difference shown", "same", "too few pairs"]
FEWEST = 6  # pairs that differ; five can at best give p = 0.06
LEVEL = 0.05
_SAME = 1e-6  # of a ratio: two machines round differently
_RESAMPLES = 999


@dataclass(frozen=True)
class Evidence:
    """What the pairs of one strategy say.

    Arguments:
        pairs, differing: (case, block, seed) in both runs, and those whose errors differ.
        ratio: geometric mean of the ratios B / A; None without a pair.
        low, high: its 95 % bootstrap interval; None with few pairs.
        p: of the Wilcoxon signed rank test, Holm's correction over the strategies; None with
            few pairs.
        verdict: in words.
    """

    strategy: str
    pairs: int
    differing: int
    ratio: float | None
    low: float | None
    high: float | None
    p: float | None
    verdict: Verdict


def evidence_of(ratios: Mapping[str, Sequence[float]]) -> tuple[Evidence, ...]:
    """Return the evidence of every strategy.

    Arguments:
        ratios: of the errors, by strategy, one for every (case, block, seed).
    """
    from statsmodels.stats.multitest import multipletests

    logs = {name: np.log(np.array(values, dtype=float)) for name, values in ratios.items()}
    found = {name: _untested(name, values) for name, values in logs.items()}
    tested = {name: _signed_rank(logs[name]) for name, item in found.items() if item.p is not None}
    if tested:
        corrected = multipletests([p for p, _ in tested.values()], method="holm")[1]
        for (name, (_, up)), p in zip(tested.items(), corrected, strict=True):
            says: Verdict = "worse" if up else "better"
            found[name] = replace(
                found[name], p=float(p), verdict=says if p < LEVEL else "no difference shown"
            )
    return tuple(found.values())


def _untested(strategy: str, logs: FloatArray) -> Evidence:
    """Return the evidence without the test; p is nan where one is worth making."""
    ratio = float(np.exp(logs.mean())) if len(logs) else None
    differing = int((np.abs(logs) > _SAME).sum())
    item = Evidence(strategy, len(logs), differing, ratio, None, None, None, "too few pairs")
    if len(logs) >= FEWEST and differing == 0:
        return replace(item, low=ratio, high=ratio, verdict="same")
    if differing < FEWEST:
        return replace(item, verdict="same" if len(logs) and not differing else "too few pairs")
    low, high = _interval(logs)
    return replace(item, low=low, high=high, p=float("nan"))


def _signed_rank(logs: FloatArray) -> tuple[float, bool]:
    """Return p of the two-sided test and whether the ranks say that errors grew."""
    from scipy.stats import rankdata, wilcoxon

    differing = logs[np.abs(logs) > _SAME]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of ties, for which the normal approximation is taken
        p = float(wilcoxon(differing).pvalue)
    up = float(np.sum(np.sign(differing) * rankdata(np.abs(differing)))) > 0.0
    return p, up


def _interval(logs: FloatArray) -> tuple[float, float]:
    from scipy.stats import bootstrap

    found = bootstrap(
        (logs,),
        np.mean,
        method="percentile",
        n_resamples=_RESAMPLES,
        random_state=np.random.default_rng(0),
    ).confidence_interval
    return float(np.exp(found.low)), float(np.exp(found.high))
