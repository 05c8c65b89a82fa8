"""Do strategies differ by more than chance? Sign flips of whole structures, for all of a family.

The one answer of `bench compare` and of the boards in the reports of a run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

import numpy as np

from femubench.core.typing import FloatArray

Verdict = Literal["better", "worse", "no difference shown", "same", "too few structures"]
FEWEST = 6  # structures; the flips of five can at best give p = 0.06
LEVEL = 0.05
METHOD = (
    "Gains of two strategies are compared structure by structure: seeds and cases of one structure "
    "are averaged first, since they say nothing about other structures. The signs of all "
    "differences on a structure are flipped together, at random, and the largest studentised mean "
    "of the family of comparisons says what chance gives (step by step, Westfall & Young). With "
    f"fewer than {FEWEST} structures no difference is claimed, however large it is."
)
_MOST_EXACT = 12  # structures up to which all signs are counted out
_RESAMPLES = 4999
_DIGITS = 6  # of a gain; what two machines round differently is a tie


@dataclass(frozen=True)
class Significance:
    """What the structures of one comparison say.

    Arguments:
        strategy: the one that is judged.
        structures, differing: those that both have results of, and those whose gains differ.
        difference: mean over the structures of the gain in B less that in A; None without any.
        low, high: its 95 % bootstrap interval over structures; None with few structures.
        p: corrected for all comparisons; None with few structures.
        verdict: in words.
    """

    strategy: str
    structures: int
    differing: int
    difference: float | None
    low: float | None
    high: float | None
    p: float | None
    verdict: Verdict


@dataclass(frozen=True)
class Differences:
    """Which strategies of a run are shown to differ.

    Arguments:
        pairs: two strategies, the one of the larger mean gain first, and p after the correction
            over all pairs; empty without a test.
        note: in words for a reader.
    """

    pairs: tuple[tuple[str, str, float], ...]
    note: str

    def better_than(self, name: str) -> tuple[str, ...]:
        """Return the strategies that one is shown to be better than."""
        return tuple(worse for better, worse, p in self.pairs if better == name and p < LEVEL)

    def worse_than(self, name: str) -> tuple[str, ...]:
        """Return the strategies that one is shown to be worse than."""
        return tuple(better for better, worse, p in self.pairs if worse == name and p < LEVEL)


def interval_of_mean(values: FloatArray) -> tuple[float, float]:
    """Return the 95 % interval of a mean by resampling; nan with less than two values.

    Arguments:
        values: one a structure.

    Source: percentile bootstrap; Hesterberg (2015), American Statistician 69, 371-386.
    """
    count = len(values)
    if count < 2:
        return math.nan, math.nan
    drawn = np.random.default_rng(0).integers(0, count, (_RESAMPLES, count))
    tail = interval_tail(count)
    low, high = np.quantile(values[drawn].mean(axis=1), (tail, 1.0 - tail))
    return float(low), float(high)


def interval_tail(count: int) -> float:
    """Return the share of resamples beyond either end of the 95 % interval.

    The fewer structures, the less it is, as with Student's t: a share of 0.025 would make the
    interval of ten structures too narrow by a fifth.

    Arguments:
        count: number of structures, at least 2.
    Source: Hesterberg (2015), section on expanded percentile intervals.

    Examples:
        >>> [round(results.Standings.interval_tail(count), 3) for count in (6, 10, 1000)]
        [0.002, 0.009, 0.025]
    """
    from scipy.special import ndtr, stdtrit

    return float(ndtr(math.sqrt(count / (count - 1)) * stdtrit(count - 1, 0.025)))


def flip_signs(differences: FloatArray) -> FloatArray:
    """Return p of every comparison of a family, corrected for all of them, (k,).

    The signs of a whole structure are flipped together, which keeps what the comparisons share.
    All signs are counted out for up to 12 structures, else 4999 are drawn. What is rejected leaves
    the family of the next step.

    Arguments:
        differences: of gains, (n structures, k comparisons).

    Source: Romano & Wolf (2005), Econometrica 73, 1237-1282; Westfall & Young (1993), step-down
    maxT.
    """
    found = np.round(differences, _DIGITS)
    n, k = found.shape
    if n <= _MOST_EXACT:
        signs = np.array(list(product((1.0, -1.0), repeat=n)))
    else:
        drawn = np.random.default_rng(0).integers(0, 2, (_RESAMPLES, n))
        signs = np.vstack([np.ones(n), 2.0 * drawn - 1.0])
    # Student's t grows with the mean over the root of the mean square: both have the same order.
    squares = np.square(found).sum(axis=0)
    units = found / np.sqrt(np.where(squares > 0.0, squares * n, 1.0))
    order = np.argsort(np.abs(units.sum(axis=0)), kind="stable")
    sizes = np.abs(signs @ units[:, order])
    largest = np.maximum.accumulate(sizes, axis=1)  # of a comparison and of those still in
    p = (largest >= sizes[0] * (1.0 - 1e-9)).mean(axis=0)
    corrected = np.ones(k)
    corrected[order] = np.maximum.accumulate(p[::-1])[::-1]
    return np.where(squares > 0.0, corrected, 1.0)


def weigh_evidence(
    differences: Mapping[str, Sequence[float] | FloatArray],
) -> tuple[Significance, ...]:
    """Return what every comparison says, corrected for those that can be tested.

    Arguments:
        differences: of the gains, B - A, one for every structure, by the strategy that is judged.
    """
    listed = {name: np.array(values, dtype=float) for name, values in differences.items()}
    # Flips are of whole structures: comparisons go together where they have the same number.
    counts = {name: len(values) for name, values in listed.items()}
    tested: dict[str, float] = {}
    for count in sorted({count for count in counts.values() if count >= FEWEST}):
        names = [
            name for name, own in counts.items() if own == count and _differ(listed[name]) >= FEWEST
        ]
        if names:
            p = flip_signs(np.column_stack([listed[name] for name in names]))
            tested |= dict(zip(names, p.tolist(), strict=True))
    families = len({counts[name] for name in tested})
    found = []
    for name, values in listed.items():
        differing, low, high = _differ(values), None, None
        p_of = min(1.0, families * tested[name]) if name in tested else None
        mean = float(values.mean()) if len(values) else None
        verdict: Verdict = "same" if len(values) and not differing else "too few structures"
        if p_of is not None:
            verdict = "no difference shown"
            if p_of < LEVEL:
                verdict = "better" if values.mean() > 0.0 else "worse"
        if p_of is not None or (verdict == "same" and len(values) >= FEWEST):
            low, high = interval_of_mean(values)
        found.append(Significance(name, len(values), differing, mean, low, high, p_of, verdict))
    return tuple(found)


def tell_apart(gains: Mapping[str, FloatArray]) -> Differences:
    """Return between which strategies a difference is shown.

    Arguments:
        gains: by strategy, one a structure, in the order of the leaderboard.
    """
    names = list(gains)
    table = np.column_stack([gains[name] for name in names]) if names else np.empty((0, 0))
    if len(names) < 2 or len(table) < FEWEST:
        note = (
            f"Ranks are not tested: that takes {FEWEST} structures or more; with fewer no "
            "difference is claimed, however large it is, and seeds do not count for them."
        )
        return Differences((), note)
    places = np.array(list(combinations(range(len(names)), 2)))
    differences = table[:, places[:, 0]] - table[:, places[:, 1]]
    turned = differences.mean(axis=0) < 0.0
    first, second = np.where(turned, places.T[::-1], places.T)
    listed = zip(first, second, flip_signs(differences).tolist(), strict=True)
    return Differences(tuple((names[a], names[b], p) for a, b, p in listed), METHOD)


def _differ(values: FloatArray) -> int:
    return int(np.count_nonzero(np.round(values, _DIGITS)))
