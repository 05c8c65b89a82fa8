"""Scores and ranks: every model against the textbook one of its case, on what nobody was given."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from femubench.core.garbage import pause_collection
from femubench.core.schema.results import DONE, JobResult, Nominal
from femubench.core.score.counting import WHOLE, choose_blocks

# A block that the nominal model already meets to the last digit must not decide a ranking.
OFFSET_PERCENT = 0.05
SCORE_OF_FAILURE = 10.0
SCORE_OF_NOTHING_DONE = 1.0
TIE = 1e-6  # relative; scores that differ by less share a rank: rounding differs by 1e-9 or so

_Item = TypeVar("_Item")


def score_of(
    result: JobResult, reference: Mapping[str, float], shares: Mapping[str, float] | None = None
) -> float:
    """Return how much of the nominal error on unseen data is left: 1 is all of it, less is better.

    It is the geometric mean over the unseen blocks of (rms + 0.05 %) / (nominal rms + 0.05 %); of
    a case that holds nothing back, over the block of the given modes. A job without a model scores
    10. A strategy that is not applicable scores as the model that it was given.

    Arguments:
        reference: rms error of the nominal model in percent by block name.
        shares: how much each block counts; alike by default.
    """
    fixed = _score_without_errors(result)
    if fixed is not None or not reference:
        return SCORE_OF_FAILURE if fixed is None else fixed
    known = shares or dict.fromkeys(choose_blocks(reference), 1.0)
    return geometric_mean(
        (score_in(result, name, reference) for name in known), weights=known.values()
    )


def score_in(
    result: JobResult,
    block: str,
    reference: Mapping[str, float],
    floor_percent: float = OFFSET_PERCENT,
) -> float:
    """Return (rms + floor) / (nominal rms + floor) of one block.

    Arguments:
        block: its name; empty for the score that the result comes with, where no nominal error
            is known.
        reference: rms error of the nominal model in percent by block name.
        floor_percent: what is added to both errors.
    """
    fixed = _score_without_errors(result)
    if fixed is not None:
        return fixed
    if block == WHOLE:
        return SCORE_OF_FAILURE if result.score is None else result.score
    error = result.start_percent.get(block)
    if result.status == "ok":
        error = result.blocks[block].rms_percent if block in result.blocks else None
    if error is None:
        return SCORE_OF_FAILURE
    return (error + floor_percent) / (reference[block] + floor_percent)


def _score_without_errors(result: JobResult) -> float | None:
    """Return the score of a job without model, or with the textbook model; None of any other."""
    if result.status not in DONE:
        return SCORE_OF_FAILURE
    idle = result.status == "not-applicable" and not result.start_percent
    return SCORE_OF_NOTHING_DONE if idle else None


def geometric_mean(values: Iterable[float], weights: Iterable[float] | None = None) -> float:
    """Return the weighted geometric mean of positive numbers."""
    numbers = np.array(list(values), dtype=float)
    shares = np.ones(len(numbers)) if weights is None else np.array(list(weights), dtype=float)
    return float(np.exp(np.average(np.log(numbers), weights=shares)))


def rank_items(
    items: Iterable[_Item], key: Callable[[_Item], tuple[tuple[float, ...], float, str]]
) -> list[tuple[int, _Item]]:
    """Return the items with their ranks, best first; equal ones share a rank: 1, 2, 2, 4.

    Sorted scores are split where the gap to the next one exceeds 1e-6 of it, so that anyone who is
    tied with one of a group is tied with all of it.

    Arguments:
        key: tier, score and name; the tier counts first, then the score, less being better. The
            name orders those that share a rank.

    Examples:
        >>> skills = {"b": 1.0, "a": 1.0, "c": 2.0}
        >>> results.rank_items(skills, lambda name: ((), skills[name], name))
        [(1, 'a'), (1, 'b'), (3, 'c')]
    """
    keyed = sorted(((*key(item), item) for item in items), key=lambda entry: entry[:3])
    found: list[tuple[int, str, _Item]] = []
    rank = 0
    for place, (tier, score, name, item) in enumerate(keyed):
        before = keyed[place - 1]
        if not rank or tier != before[0] or score - before[1] > TIE * abs(score):
            rank = place + 1
        found.append((rank, name, item))
    return [(rank, item) for rank, _, item in sorted(found, key=lambda entry: entry[:2])]


@pause_collection()
def rank_results(
    results: Iterable[JobResult],
    reference: Mapping[str, Mapping[str, float]] | None = None,
    baseline: str | None = None,
) -> tuple[JobResult, ...]:
    """Return the results with their ranks within case, seed and nominal model, and their scores.

    Physical models come first, then unphysical ones, then jobs without a model; within each the
    score counts. Equal scores share a rank.

    Arguments:
        results: in any order, which is kept.
        reference: from case to the nominal rms errors by block; scores are computed anew from
            them. None keeps the scores that the results have; one that has none scores against
            the result of the baseline in the same group, or 10 where there is none.
        baseline: name of the strategy that leaves the model as it is, where one ran.

    Examples:
        >>> [(round(one.score, 2), one.rank) for one in results.rank_results(run.results)]
        [(2.97, 2), (0.53, 1)]
    """
    listed = tuple(results)
    found = scores_and_ranks(listed, reference, baseline)
    return tuple(
        replace(result, score=score, rank=rank)
        for result, score, rank in zip(listed, *found, strict=True)
    )


def scores_and_ranks(
    results: Sequence[JobResult],
    reference: Mapping[str, Mapping[str, float]] | None = None,
    baseline: str | None = None,
) -> tuple[list[float], list[int]]:
    """Return the scores and ranks of results; arguments and order as for `rank_results`."""
    if reference is not None:
        scores = _scores_against(results, reference)
    else:
        given = {
            _group(item): {name: block.rms_percent for name, block in item.blocks.items()}
            for item in results
            if item.strategy == baseline
        }
        scores = [
            score_of(item, given.get(_group(item), {})) if item.score is None else item.score
            for item in results
        ]
    groups: dict[tuple[str, int, Nominal], int] = {}
    group = [groups.setdefault(_group(result), len(groups)) for result in results]
    names = {name: n for n, name in enumerate(sorted({result.strategy for result in results}))}
    parts = (
        [names[result.strategy] for result in results],
        scores,
        [result.unphysical for result in results],
        [result.status not in DONE for result in results],
        group,
    )
    keys = np.array([np.array(part, dtype=float) for part in parts])
    order = np.lexsort(keys)
    _, score, *tier, place = keys[:, order]
    # As `ranked` does in each group.
    first = np.ones(len(order), dtype=bool)
    first[1:] = place[1:] != place[:-1]
    apart = first.copy()
    for part in tier:
        apart[1:] |= part[1:] != part[:-1]
    apart[1:] |= score[1:] - score[:-1] > TIE * np.abs(score[1:])
    steps = np.arange(len(order))
    starts = [np.maximum.accumulate(np.where(new, steps, 0)) for new in (first, apart)]
    ranks = np.empty(len(order), dtype=int)
    ranks[order] = 1 + starts[1] - starts[0]
    return scores, ranks.tolist()


def _scores_against(
    results: Sequence[JobResult], reference: Mapping[str, Mapping[str, float]]
) -> list[float]:
    """Return what `score_of` gives for each result, many at a time."""
    scores = [SCORE_OF_FAILURE] * len(results)
    blocks = {case: choose_blocks(errors) for case, errors in reference.items()}
    by_count: dict[int, tuple[list[int], list[list[float]]]] = {}
    for place, result in enumerate(results):
        errors = reference.get(result.case) or {}
        fixed = _score_without_errors(result)
        if fixed is not None:
            scores[place] = fixed
        elif errors:
            row = [score_in(result, name, errors) for name in blocks[result.case]]
            places, rows = by_count.setdefault(len(row), ([], []))
            places.append(place)
            rows.append(row)
    for count, (places, rows) in by_count.items():
        means = np.exp(np.log(np.array(rows)).sum(axis=1) / count)
        for place, mean in zip(places, means.tolist(), strict=True):
            scores[place] = mean
    return scores


def _group(result: JobResult) -> tuple[str, int, Nominal]:
    return result.case, result.seed, result.nominal
