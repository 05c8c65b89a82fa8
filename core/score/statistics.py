"""Do two strategies differ by more than chance? Signed ranks over structures, Holm's correction.

The one answer of `bench compare` and of the tiers and groups in the reports of a run.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal, TypeVar

import numpy as np

from femubench.core.schema.results import JobResult, Run
from femubench.core.score.counting import (
    References,
    Weights,
    block_weights,
    choose_blocks,
)
from femubench.core.score.ranking import OFFSET_PERCENT, score_in
from femubench.core.typing import FloatArray

_Item = TypeVar("_Item", bound=Hashable)
Verdict = Literal["better", "worse", "no difference shown", "same", "too few structures"]
FEWEST = 6  # structures that differ; five can at best give p = 0.06
LEVEL = 0.05
METHOD = (
    "Wilcoxon's signed rank test on the errors of both on unseen data, paired by structure: seeds, "
    "blocks and "
    "cases of one structure are averaged first (geometric mean), since they say nothing about "
    "other structures. Holm's correction over the comparisons. With fewer than "
    f"{FEWEST} structures that differ no difference is claimed, however large it is."
)
_NOTE = (
    "Tier 1: no difference from the first strategy is shown at the 5 % level (Holm's correction "
    "over the comparisons with it), so that the best one is among them; of many that are equally "
    "good one or another may still be below. Tier 2: the same among the others, and so on. "
    "Strategies that share a letter: no difference between them is shown when all pairs are "
    f"compared, which takes more to show one. {METHOD}"
)
_DIGITS = 6  # of the logarithm of a ratio; what two machines round differently is a tie
_MOST_EXACT = 50  # structures up to which all signs are counted out
_RESAMPLES = 4999
_MOST_GROUPS = 26  # more overlapping groups than letters say nothing to a reader


@dataclass(frozen=True)
class Significance:
    """What the structures of one comparison say.

    Arguments:
        strategy: the one that is judged.
        structures, differing: those that both have results of, and those whose scores differ.
        ratio: geometric mean over the structures of the ratios B / A; None without any.
        low, high: its 95 % bootstrap interval over structures; None with few structures.
        p: of the signed rank test, after Holm's correction; None with few structures.
        verdict: in words.
    """

    strategy: str
    structures: int
    differing: int
    ratio: float | None
    low: float | None
    high: float | None
    p: float | None
    verdict: Verdict


@dataclass(frozen=True)
class Groups:
    """Which strategies of a run no difference is shown of.

    Arguments:
        tiers: the strategies of which no difference from the best one is shown, then those of which
            none from the best one of the others is shown, and so on; each in the order of the
            leaderboard; none without a test.
        pairs: two strategies and p after Holm's correction over all pairs; 1 where too few
            structures differ.
        groups: strategies without a difference among them, each group and the groups in the order
            of the leaderboard; none without a test.
        note: in words for a reader.
    """

    tiers: tuple[tuple[str, ...], ...]
    pairs: tuple[tuple[str, str, float], ...]
    groups: tuple[tuple[str, ...], ...]
    note: str

    def tier_of(self) -> dict[str, int]:
        """Return the number of every strategy's tier; the first one is 1."""
        return {name: place for place, tier in enumerate(self.tiers, start=1) for name in tier}

    def letters(self) -> dict[str, str]:
        """Return the letters of a strategy's groups."""
        found: dict[str, list[str]] = {}
        for place, group in enumerate(self.groups):
            for name in group:
                found.setdefault(name, []).append(_letter(place))
        return {name: " ".join(letters) for name, letters in found.items()}


@dataclass(frozen=True)
class ScoreTable:
    """The scores of strategies on what counts: the unseen blocks of structures.

    Arguments:
        logs: logarithms of the scores of all blocks, nan where there is no result; (columns,
            blocks, seeds).
        structures: how much a block of a structure counts, else 0; (structures, blocks).
    """

    logs: FloatArray
    structures: FloatArray

    @classmethod
    def of(
        cls,
        columns: Sequence[Iterable[JobResult]],
        references: References,
        structures: Mapping[str, str],
        floor_percent: float = OFFSET_PERCENT,
    ) -> ScoreTable:
        """Return the scores of results.

        A job without a model scores as in the ranking; it is left out where the nominal error is
        not known.

        Arguments:
            columns: the results of a strategy each.
            references: rms error of the nominal model in percent by case and block.
            structures: by case; one that is not named is a structure of its own.
            floor_percent: what is added to the errors and to the nominal ones.
        """
        weights = block_weights(references, structures)
        found: list[dict[tuple[str, str, int], float]] = []
        for results in columns:
            found.append({})
            for result in results:
                known = references.get(result.case) or {}
                for name, score in _scores(result, known, weights, floor_percent).items():
                    found[-1][result.case, name, result.seed] = math.log(score)
        units = list(dict.fromkeys(unit for scores in found for unit in scores))
        blocks = _places(unit[:2] for unit in units)
        seeds = _places(unit[2] for unit in units)
        logs = np.full((len(columns), len(blocks), len(seeds)), np.nan)
        for column, values in enumerate(found):
            for (case, name, seed), value in values.items():
                logs[column, blocks[case, name], seeds[seed]] = value
        names = _places(structures.get(case, case) for case, _ in blocks)
        member = np.zeros((len(names), len(blocks)))
        for (case, name), place in blocks.items():
            own = names[structures.get(case, case)]
            member[own, place] = weights.get((case, name), 1.0)
        return cls(logs, member)

    def ratios(self, before: int, after: int) -> FloatArray:
        """Return the ratios of the scores, after / before, of the structures that both have.

        Seeds are averaged first, then the blocks of all cases of a structure, as geometric means.

        Arguments:
            before, after: columns.
        """
        change = self.logs[after] - self.logs[before]
        there = np.isfinite(change)
        seeds = there.sum(axis=1)
        means = np.where(there, change, 0.0).sum(axis=1) / np.maximum(seeds, 1)
        blocks = self.structures @ (seeds > 0)
        shared = blocks > 0.0
        return np.asarray(np.exp((self.structures @ means)[shared] / blocks[shared]))


def _scores(
    result: JobResult, known: Mapping[str, float], weights: Weights, floor_percent: float
) -> dict[str, float]:
    """Return the scores of a result in every block that counts."""
    if known:
        counted = (name for name in known if (result.case, name) in weights)
        return {name: score_in(result, name, known, floor_percent) for name in counted}
    if result.status != "ok":
        return {}
    # The unknown nominal error is a factor of both sides of every pair.
    return {
        name: result.blocks[name].rms_percent + floor_percent
        for name in choose_blocks(result.blocks)
    }


def structures_of(run: Run) -> dict[str, str]:
    """Return the structure of every case as the run tells; a case that is not there is its own.

    Examples:
        >>> list(results.structures_of(run).values())
        ['ladder']
    """
    return dict(run.meta.get("structures") or {})


def interval_over_structures(logs: FloatArray) -> tuple[float, float]:
    """Return the 95 % interval of a geometric mean by resampling structures.

    Arguments:
        logs: logarithm of the mean of every structure.

    Source: percentile bootstrap; Hesterberg (2015), American Statistician 69, 371-386.
    """
    count = len(logs)
    drawn = np.random.default_rng(0).integers(0, count, (_RESAMPLES, count))
    means = logs[drawn].mean(axis=1)
    tail = interval_tail(count)
    low, high = np.exp(np.quantile(means, (tail, 1.0 - tail)))
    return float(low), float(high)


def interval_tail(count: int) -> float:
    """Return the share of resamples beyond either end of the 95 % interval.

    The fewer structures, the less it is, as with Student's t: a share of 0.025 would make the
    interval of ten structures too narrow by a fifth.

    Arguments:
        count: number of structures, at least 2.

    Examples:
        >>> [round(results.interval_tail(count), 3) for count in (6, 10, 1000)]
        [0.002, 0.009, 0.025]

    Source: Hesterberg (2015), section on expanded percentile intervals.
    """
    from scipy.special import ndtr, stdtrit

    return float(ndtr(math.sqrt(count / (count - 1)) * stdtrit(count - 1, 0.025)))


def evidence_of(ratios: Mapping[str, Sequence[float] | FloatArray]) -> tuple[Significance, ...]:
    """Return what every comparison says, with Holm's correction over those that can be tested.

    Arguments:
        ratios: of the scores, B / A, one for every structure, by the strategy that is judged.
    """
    logs = {name: np.log(np.array(values, dtype=float)) for name, values in ratios.items()}
    found = []
    corrected = _corrected([_test(values) for values in logs.values()])
    for (name, values), p in zip(logs.items(), corrected, strict=True):
        differing = _differing(values)
        ratio = float(np.exp(values.mean())) if len(values) else None
        low = high = None
        verdict: Verdict = "same" if len(values) and not len(differing) else "too few structures"
        if p is not None:
            verdict = "no difference shown"
            if p < LEVEL:
                verdict = "worse" if _signed_rank(differing)[1] else "better"
        if p is not None or (verdict == "same" and len(values) >= FEWEST):
            low, high = interval_over_structures(values)
        found.append(Significance(name, len(values), len(differing), ratio, low, high, p, verdict))
    return tuple(found)


def tell_apart(run: Run, order: Sequence[str]) -> Groups:
    """Return between which strategies of a run a difference is shown.

    Arguments:
        order: the strategies, best first.

    Examples:
        >>> results.tell_apart(run, [scaled.name, nominal.name]).groups
        ()
    """
    columns: dict[str, list[JobResult]] = {name: [] for name in order}
    for result in run.ranked:
        columns[result.strategy].append(result)
    table = ScoreTable.of(
        list(columns.values()), run.meta.get("reference") or {}, structures_of(run)
    )
    places = list(combinations(range(len(order)), 2))
    logs = {(i, j): np.log(table.ratios(i, j)) for i, j in places}
    most = max((len(_differing(values)) for values in logs.values()), default=0)
    if most < FEWEST:
        note = (
            f"Ranks are not tested: no two strategies differ on {FEWEST} structures or more; with "
            "fewer no difference is claimed, however large it is, and seeds do not count for them."
        )
        return Groups((), (), (), note)
    raw = {pair: _test(values) for pair, values in logs.items()}
    found = [1.0 if p is None else p for p in _corrected(list(raw.values()))]
    # Every pair that does not differ is in one of the sets; with too many of them only those of
    # strategies that follow one another in the ranking are shown.
    apart, others = [0] * len(order), len(order) - 1
    for (i, j), p in zip(places, found, strict=True):
        if p < LEVEL:
            apart[i] |= 1 << j
            apart[j] |= 1 << i
    cliques = _cliques(apart)
    listed = _stretches(apart) if cliques is None else cliques
    sets = sorted([place for place in range(len(order)) if one >> place & 1] for one in listed)
    # Pairs with the first strategy come first.
    tested, least = [p is not None for p in raw.values()], 2.0 ** (1 - most)
    kinds = {"pairs": sum(tested), "comparisons with the first strategy": sum(tested[:others])}
    named = [f"{count} {kind}" for kind, count in kinds.items() if least * count >= LEVEL]
    note = _NOTE
    if named:
        note += (
            f" With {most} structures the test gives no p below {least:.2g}, too much for "
            f"{' and for '.join(named)}: none can be shown there, however large the difference."
        )
    if cliques is None:
        note += " Of many overlapping groups those of neighbours in the ranking are shown."
    return Groups(
        tuple(tuple(order[place] for place in tier) for tier in _tiers(len(order), raw)),
        tuple((order[i], order[j], p) for (i, j), p in zip(places, found, strict=True)),
        tuple(tuple(order[place] for place in members) for members in sets),
        note,
    )


def holm(p: Sequence[float]) -> FloatArray:
    """Return p values corrected for their number, step by step from the smallest one.

    Source: Holm (1979), Scand. J. Statist. 6, 65-70.
    """
    raw = np.array(p, dtype=float)
    order = np.argsort(raw, kind="stable")
    steps = np.arange(len(raw), 0, -1) * raw[order]
    corrected = np.empty_like(raw)
    corrected[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return corrected


def _tiers(count: int, raw: Mapping[tuple[int, int], float | None]) -> Iterator[tuple[int, ...]]:
    """Yield those that do not differ from the first, then the same of those that are left.

    Arguments:
        count: number of strategies, best first.
        raw: p of every pair (i, j) with i < j, not corrected; None where few structures differ.

    Source: Hsu (1981), Annals of Statistics 9, 1026-1034, on comparisons with the best one alone.
    """
    left = list(range(count))
    while left:
        best, *others = left
        p = _corrected([raw[best, one] for one in others])
        below = [
            one for one, value in zip(others, p, strict=True) if value is not None and value < LEVEL
        ]
        yield tuple(one for one in left if one not in below)
        left = below


def _test(logs: FloatArray) -> float | None:
    """Return p of one comparison before any correction; None where few structures differ."""
    differing = _differing(logs)
    return _signed_rank(differing)[0] if len(differing) >= FEWEST else None


def _corrected(raw: Sequence[float | None]) -> list[float | None]:
    """Return p of every comparison by Holm's method; None counts as no comparison.

    Source: Tarone (1990), Biometrics 46, 515-522: what can never be significant costs nothing.
    """
    corrected = iter(holm([p for p in raw if p is not None]))
    return [None if p is None else float(next(corrected)) for p in raw]


def _differing(logs: FloatArray) -> FloatArray:
    """Return what is no tie, rounded so that the ranks are the same on all machines."""
    rounded = np.round(logs, _DIGITS)
    return np.asarray(rounded[rounded != 0.0])


def _signed_rank(logs: FloatArray) -> tuple[float, bool]:
    """Return p of the two-sided test and whether the ranks say that scores grew.

    Source: Wilcoxon (1945), Biometrics Bull. 1, 80-83; equal sizes share their mean rank.
    """
    _, place, counts = np.unique(np.abs(logs), return_inverse=True, return_counts=True)
    twice = (2 * np.cumsum(counts) - counts + 1)[place]  # the mean rank is half an integer
    total, up = int(twice.sum()), int(twice[logs > 0.0].sum())
    if len(logs) > _MOST_EXACT:
        z = (up - 0.5 * total) / (0.5 * math.sqrt(float(np.sum(twice.astype(float) ** 2))))
        return math.erfc(abs(z) / math.sqrt(2.0)), up > total - up
    chances = np.zeros(total + 1)
    chances[0] = 1.0
    for rank in twice:
        chances[rank:] += chances[:-rank].copy()
        chances *= 0.5
    tail = float(chances[: min(up, total - up) + 1].sum())
    return min(1.0, 2.0 * tail), up > total - up


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
        kept: list[int] = []
        for best in sorted(set(split), key=lambda bits: -bits.bit_count()):
            if not any(best & ~other == 0 for other in kept):
                kept.append(best)
        sets = kept
        # Between two steps there may be more sets than in the end, but not by much.
        if len(sets) > 4 * _MOST_GROUPS:
            return None
    return sets if len(sets) <= _MOST_GROUPS else None


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


def _places(items: Iterable[_Item]) -> dict[_Item, int]:
    """Return the place of every item in the order of their first appearance."""
    return {item: place for place, item in enumerate(dict.fromkeys(items))}


def _letter(place: int) -> str:
    """Return a, b, ... z, aa, ab ..."""
    text = ""
    place += 1
    while place:
        place, rest = divmod(place - 1, 26)
        text = chr(ord("a") + rest) + text
    return text
