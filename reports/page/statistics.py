"""Which strategies can be told apart: Friedman's test, then Wilcoxon's with Holm's correction."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from femubench.fem import FloatArray
from femubench.reports.summary import cases_of, seeds_of, strategies_of
from femubench.results import SCORE_OF_FAILURE, Run

if TYPE_CHECKING:
    import pandas as pd

LEVEL = 0.05
LEAST_STRATEGIES, LEAST_CASES = 3, 5
# Cases up to which Wilcoxon's distribution is counted out; ties make its p a little too large.
_MOST_EXACT = 50
# More overlapping groups than letters tell a reader nothing.
_MOST_GROUPS = 26


@dataclass(frozen=True)
class Friedman:
    """Friedman's test: do the strategies rank alike on all cases?

    Arguments:
        chi2, p: its statistic, and the probability of one as large when they do not differ.
        cases, strategies: rows and columns of the table of scores.
    """

    chi2: float
    p: float
    cases: int
    strategies: int


@dataclass(frozen=True)
class Statistics:
    """What the ranks of a run are worth.

    Arguments:
        friedman: None where there is too little to test.
        pairs: two strategies by index and Wilcoxon's p after Holm's correction; none where
            Friedman's test sees no difference at all.
        groups: strategies by index that cannot be told apart, each group and the groups in the
            order of the leaderboard; none without a test.
        note: in words for a reader.
    """

    friedman: Friedman | None
    pairs: tuple[tuple[int, int, float], ...]
    groups: tuple[tuple[int, ...], ...]
    note: str

    def letters(self) -> dict[int, str]:
        """Return the letters of a strategy's groups; who shares one cannot be told apart."""
        found: dict[int, list[str]] = {}
        for place, group in enumerate(self.groups):
            for index in group:
                found.setdefault(index, []).append(_letter(place))
        return {index: " ".join(letters) for index, letters in found.items()}


def statistics(run: Run, board: pd.DataFrame) -> Statistics:
    """Return how far the strategies of a run, by their place in `strategies_of`, can be told apart.

    What is compared are the scores of the cases, with several seeds their medians. A result that
    is missing scores as a failure does.

    Arguments:
        board: the run's leaderboard, whose order the groups have.
    """
    table = scores_of(run)
    cases, count = table.shape
    if count < LEAST_STRATEGIES or cases < LEAST_CASES:
        note = (
            f"Ranks are not tested: that needs {LEAST_STRATEGIES} strategies and {LEAST_CASES} "
            f"cases, there are {count} and {cases}."
        )
        return Statistics(None, (), (), note)
    places = {name: index for index, name in enumerate(strategies_of(run))}
    order = [places[name] for name in board["strategy"]]
    found = _friedman(table)
    if found is None:
        note = "Ranks are not tested: all strategies score the same on every case."
        return Statistics(None, (), (tuple(order),), note)
    said = (
        f"Friedman's test on {cases} cases and {count} strategies: "
        f"chi-square {found.chi2:.1f}, {_chance(found.p)}"
    )
    if found.p >= LEVEL:
        note = f"{said}: no strategy can be told apart from the others."
        return Statistics(found, (), (tuple(order),), note)
    pairs = _pairs(table)
    groups, whole = _groups(order, {(i, j) for i, j, p in pairs if p < LEVEL})
    note = (
        f"{said}. Pairs by Wilcoxon's signed-rank test with Holm's correction: "
        "strategies that share a letter cannot be told apart at the 5 % level."
    )
    return Statistics(found, pairs, groups, note + _limits(cases, len(pairs), whole=whole))


def scores_of(run: Run) -> FloatArray:
    """Return the score of every strategy on every case, the median over the seeds; (cases, n)."""
    cases, names = cases_of(run), strategies_of(run)
    seeds = seeds_of(run)
    shape = (len(cases), len(names), max(len(seeds), 1))
    row, column, layer = (
        {name: place for place, name in enumerate(words)} for words in (cases, names, seeds)
    )
    table = np.full(shape, SCORE_OF_FAILURE)
    for result in run.results:
        if result.score is not None:
            place = (row[result.case], column[result.strategy], layer[result.seed])
            table[place] = result.score
    return np.asarray(np.median(table, axis=2))


def _friedman(table: FloatArray) -> Friedman | None:
    from scipy.stats import friedmanchisquare

    if bool(np.all(table == table[:, :1])):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outcome = friedmanchisquare(*table.T)
    chi2, p = float(outcome.statistic), float(outcome.pvalue)
    return Friedman(chi2, p, *table.shape) if math.isfinite(p) else None


def _pairs(table: FloatArray) -> tuple[tuple[int, int, float], ...]:
    """Return every pair of columns with its p after Holm's correction."""
    from scipy.stats import wilcoxon
    from statsmodels.stats.multitest import multipletests

    pairs = list(combinations(range(table.shape[1]), 2))
    first, second = np.array(pairs).T
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # Scores differ by factors. Equal ones, such as of two failures, speak for both sides.
        ratios = np.log(table[:, first] / table[:, second])
        method = "exact" if len(table) <= _MOST_EXACT else "approx"
        found = wilcoxon(ratios, axis=0, zero_method="zsplit", method=method).pvalue
    raw = np.where(np.isfinite(found), found, 1.0)
    corrected = multipletests(raw, alpha=LEVEL, method="holm")[1]
    return tuple((i, j, float(p)) for (i, j), p in zip(pairs, corrected, strict=True))


def _groups(
    order: Sequence[int], different: set[tuple[int, int]]
) -> tuple[tuple[tuple[int, ...], ...], bool]:
    """Return the largest sets without a pair that differs, and whether these are all of them.

    Every pair that does not differ is in one of the sets; with too many of them only those of
    strategies that follow one another in the ranking are returned.
    """
    place = {index: position for position, index in enumerate(order)}
    apart = [0] * len(order)
    for i, j in different:
        apart[place[i]] |= 1 << place[j]
        apart[place[j]] |= 1 << place[i]
    sets = _cliques(apart)
    whole = sets is not None
    listed = sorted(_members(found) for found in (sets or _stretches(apart)))
    return tuple(tuple(order[p] for p in positions) for positions in listed), whole


def _cliques(apart: Sequence[int]) -> list[int] | None:
    """Return all largest sets by bits, splitting at each difference; None where they are many."""
    sets = [(1 << len(apart)) - 1]
    for one, others in enumerate(apart):
        bit = 1 << one
        split = []
        for found in sets:
            if found & bit and found & others:
                split += [found & ~bit, found & ~others]
            else:
                split.append(found)
        sets = _largest(split)
        # Between two steps there may be more sets than in the end, but not by much.
        if len(sets) > 4 * _MOST_GROUPS:
            return None
    return sets if len(sets) <= _MOST_GROUPS else None


def _largest(sets: Sequence[int]) -> list[int]:
    """Return the sets that lie in no other one."""
    kept: list[int] = []
    for found in sorted(set(sets), key=lambda bits: -bits.bit_count()):
        if not any(found & ~other == 0 for other in kept):
            kept.append(found)
    return kept


def _stretches(apart: Sequence[int]) -> list[int]:
    """Return the longest stretches of the ranking without a pair that differs."""
    found, stop = [], 0
    for start in range(len(apart)):
        before = stop
        while stop < len(apart) and not apart[stop] & (((1 << stop) - 1) & ~((1 << start) - 1)):
            stop += 1
        if stop > before:
            found.append(((1 << stop) - 1) & ~((1 << start) - 1))
    return found


def _members(bits: int) -> list[int]:
    return [place for place in range(bits.bit_length()) if bits >> place & 1]


def _limits(cases: int, pairs: int, *, whole: bool) -> str:
    """Return what the tests cannot show, in words."""
    least = 2.0 ** (1 - cases)
    said = ""
    if least * pairs >= LEVEL:
        said = (
            f" With {cases} cases the test gives no p below {least:.2g}, too much for {pairs} "
            "pairs: no pair can be told apart, however large the difference."
        )
    if not whole:
        said += " Of many overlapping groups those of neighbours in the ranking are shown."
    return said


def _chance(p: float) -> str:
    return f"p = {p:.2g}" if p > 1e-99 else "p < 1e-99"


def _letter(place: int) -> str:
    """Return a, b, ... z, aa, ab ..."""
    text = ""
    place += 1
    while place:
        place, rest = divmod(place - 1, 26)
        text = chr(ord("a") + rest) + text
    return text
