"""Scores and ranks: every model against the nominal one of its case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from femubench.core.schema.results import JobResult

# A block that the nominal model already meets to the last digit must not decide a ranking.
OFFSET_PERCENT = 0.05
SCORE_OF_FAILURE = 10.0
SCORE_OF_NOTHING_DONE = 1.0


def score_of(result: JobResult, reference: Mapping[str, float]) -> float:
    """Return the geometric mean over blocks of (rms + 0.05 %) / (rms of `unchanged` + 0.05 %).

    A job without a model scores 10. Where a strategy is not applicable the model stays as it
    was, which scores 1.

    Arguments:
        reference: rms error of the nominal model in percent by block name.
    """
    if result.status == "not-applicable":
        return SCORE_OF_NOTHING_DONE
    if result.status != "ok" or not reference:
        return SCORE_OF_FAILURE
    ratios = [
        (result.blocks[name].rms_percent + OFFSET_PERCENT) / (rms + OFFSET_PERCENT)
        if name in result.blocks
        else SCORE_OF_FAILURE
        for name, rms in reference.items()
    ]
    return geometric_mean(ratios)


def geometric_mean(values: Iterable[float], weights: Iterable[float] | None = None) -> float:
    """Return the weighted geometric mean of positive numbers."""
    numbers = np.array(list(values), dtype=float)
    shares = np.ones(len(numbers)) if weights is None else np.array(list(weights), dtype=float)
    return float(np.exp(np.average(np.log(numbers), weights=shares)))


def rank_results(
    results: Iterable[JobResult], reference: Mapping[str, Mapping[str, float]] | None = None
) -> tuple[JobResult, ...]:
    """Return the results with their ranks within case and seed, and scores where missing.

    Physical models come first, then unphysical ones, then jobs without a model; within each the
    score counts, then the name, so that no two ranks are equal.

    Arguments:
        results: in any order, which is kept.
        reference: from case to the nominal rms errors by block; scores are computed anew from
            them. None keeps the scores that the results have; one that has none scores against
            the result of `unchanged` in the same case and seed, or 10 where there is none.
    """
    listed = tuple(results)
    given = _of_unchanged(listed) if reference is None else {}
    scored = []
    for result in listed:
        if reference is not None:
            score = score_of(result, reference.get(result.case, {}))
        elif result.score is not None:
            score = result.score
        else:
            score = score_of(result, given.get((result.case, result.seed), {}))
        scored.append(replace(result, score=score))
    ranks: dict[tuple[str, int, str], int] = {}
    places: dict[tuple[str, int], int] = {}
    for result in sorted(scored, key=_order):
        group = (result.case, result.seed)
        places[group] = places.get(group, 0) + 1
        ranks[*group, result.strategy] = places[group]
    return tuple(replace(r, rank=ranks[r.case, r.seed, r.strategy]) for r in scored)


def _of_unchanged(results: Iterable[JobResult]) -> dict[tuple[str, int], dict[str, float]]:
    return {
        (result.case, result.seed): {name: b.rms_percent for name, b in result.blocks.items()}
        for result in results
        if result.strategy == "unchanged"
    }


def _order(result: JobResult) -> tuple[bool, bool, float, str]:
    assert result.score is not None
    nothing = result.status not in ("ok", "not-applicable")
    return nothing, result.unphysical, result.score, result.strategy
