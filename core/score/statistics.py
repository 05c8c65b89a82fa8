"""Do two strategies differ by more than chance? Signed ranks over blocks, Holm's correction.

The one answer of `bench compare` and of the groups in the reports of a run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from femubench.core.schema.results import JobResult, Run
from femubench.core.score.ranking import OFFSET_PERCENT, score_of
from femubench.core.typing import FloatArray

Verdict = Literal["better", "worse", "no difference shown", "same", "too few pairs"]
FEWEST = 6  # pairs that differ; five can at best give p = 0.06
LEVEL = 0.05
METHOD = (
    "Wilcoxon's signed rank test on the scores of both, paired by block of each case (seeds "
    "averaged; in a run of one case every seed is a pair), Holm's correction over the comparisons. "
    f"Fewer than {FEWEST} pairs that differ say nothing."
)
_DIGITS = 6  # of the logarithm of a ratio; what two machines round differently is a tie
_MOST_EXACT = 50  # pairs up to which all signs are counted out
_RESAMPLES = 999
_MOST_GROUPS = 26  # more overlapping groups than letters say nothing to a reader


@dataclass(frozen=True)
class Evidence:
    """What the pairs of one comparison say.

    Arguments:
        strategy: the one that is judged.
        pairs, differing: blocks that both have, and those whose scores differ.
        ratio: geometric mean of the ratios B / A; None without a pair.
        low, high: its 95 % bootstrap interval; None with few pairs.
        p: of the signed rank test, after Holm's correction; None with few pairs.
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


@dataclass(frozen=True)
class Groups:
    """Which strategies of a run no difference is shown of.

    Arguments:
        pairs: two strategies and p after Holm's correction; 1 where too few pairs differ.
        groups: strategies without a difference among them, each group and the groups in the order
            of the leaderboard; none without a test.
        note: in words for a reader.
    """

    pairs: tuple[tuple[str, str, float], ...]
    groups: tuple[tuple[str, ...], ...]
    note: str

    def letters(self) -> dict[str, str]:
        """Return the letters of a strategy's groups."""
        found: dict[str, list[str]] = {}
        for place, group in enumerate(self.groups):
            for name in group:
                found.setdefault(name, []).append(_letter(place))
        return {name: " ".join(letters) for name, letters in found.items()}


def log_scores(
    columns: Sequence[Iterable[JobResult]], references: Mapping[str, Mapping[str, float]]
) -> FloatArray:
    """Return the logarithm of the score of every block; (columns, blocks of the cases, seeds).

    A job without a model scores as in the ranking; nan where there is no result, and for such a job
    where the nominal error is not known. The seeds of one case alone are blocks of their own.

    Arguments:
        columns: the results of a strategy each.
        references: rms error of the nominal model in percent by case and block.
    """
    found: list[dict[tuple[str, str, int], float]] = []
    for results in columns:
        found.append({})
        for result in results:
            known = references.get(result.case) or {}
            scores = {name: score_of(result, {name: rms}) for name, rms in known.items()}
            if not known and result.status == "ok":
                # The unknown nominal error is a factor of both sides of every pair.
                scores = {name: b.rms_percent + OFFSET_PERCENT for name, b in result.blocks.items()}
            for name, score in scores.items():
                found[-1][result.case, name, result.seed] = math.log(score)
    units = list(dict.fromkeys(unit for scores in found for unit in scores))
    blocks = {block: place for place, block in enumerate(dict.fromkeys(unit[:2] for unit in units))}
    seeds = {seed: place for place, seed in enumerate(dict.fromkeys(unit[2] for unit in units))}
    table = np.full((len(columns), len(blocks), len(seeds)), np.nan)
    for column, values in enumerate(found):
        for (case, name, seed), value in values.items():
            table[column, blocks[case, name], seeds[seed]] = value
    alone = len({case for case, _ in blocks}) == 1
    return table.reshape(len(columns), -1, 1) if alone else table


def block_ratios(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the ratios of the scores, after / before, of the blocks that both have.

    Arguments:
        before, after: logarithms; (blocks, seeds).
    """
    change = after - before
    there = np.isfinite(change)
    shared = there.any(axis=1)
    sums = np.where(there, change, 0.0).sum(axis=1)
    return np.asarray(np.exp(sums[shared] / there.sum(axis=1)[shared]))


def evidence_of(ratios: Mapping[str, Sequence[float] | FloatArray]) -> tuple[Evidence, ...]:
    """Return what every comparison says, with Holm's correction over those that can be tested.

    Arguments:
        ratios: of the scores, B / A, one for every block, by the strategy that is judged.
    """
    logs = {name: np.log(np.array(values, dtype=float)) for name, values in ratios.items()}
    found = []
    for (name, values), p in zip(logs.items(), _corrected(logs.values()), strict=True):
        differing = _differing(values)
        ratio = float(np.exp(values.mean())) if len(values) else None
        low = high = None
        verdict: Verdict = "same" if len(values) and not len(differing) else "too few pairs"
        if p is not None:
            verdict = "no difference shown"
            if p < LEVEL:
                verdict = "worse" if _signed_rank(differing)[1] else "better"
        if p is not None or (verdict == "same" and len(values) >= FEWEST):
            low, high = _interval(values)
        found.append(Evidence(name, len(values), len(differing), ratio, low, high, p, verdict))
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
    for result in run.results:
        columns[result.strategy].append(result)
    logs = log_scores(list(columns.values()), run.meta.get("reference") or {})
    places = list(combinations(range(len(order)), 2))
    ratios = [block_ratios(logs[i], logs[j]) for i, j in places]
    differing = [len(_differing(np.log(values))) for values in ratios]
    tested = sum(count >= FEWEST for count in differing)
    if not tested:
        note = f"Ranks are not tested: no two strategies differ in {FEWEST} blocks or more."
        return Groups((), (), note)
    found = [1.0 if p is None else p for p in _corrected(np.log(values) for values in ratios)]
    sets, whole = _groups(
        len(order), [pair for pair, p in zip(places, found, strict=True) if p < LEVEL]
    )
    note = f"Strategies that share a letter: no difference shown at the 5 % level. {METHOD}"
    least = 2.0 ** (1 - max(differing))
    if least * tested >= LEVEL:
        note += (
            f" With {max(differing)} pairs the test gives no p below {least:.2g}, too much for "
            f"{tested} comparisons: none can be shown, however large the difference."
        )
    if not whole:
        note += " Of many overlapping groups those of neighbours in the ranking are shown."
    return Groups(
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


def _corrected(logs: Iterable[FloatArray]) -> list[float | None]:
    """Return p of every comparison; None, and no part in the correction, where few pairs differ.

    Source: Tarone (1990), Biometrics 46, 515-522: what can never be significant costs nothing.
    """
    listed = [_differing(values) for values in logs]
    tested = [_signed_rank(values)[0] for values in listed if len(values) >= FEWEST]
    corrected = iter(holm(tested))
    return [float(next(corrected)) if len(values) >= FEWEST else None for values in listed]


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


def _interval(logs: FloatArray) -> tuple[float, float]:
    """Return the 95 % interval of the mean ratio by the percentiles of resamples."""
    drawn = np.random.default_rng(0).integers(0, len(logs), (_RESAMPLES, len(logs)))
    low, high = np.exp(np.quantile(logs[drawn].mean(axis=1), (0.025, 0.975)))
    return float(low), float(high)


def _groups(count: int, different: Iterable[tuple[int, int]]) -> tuple[list[list[int]], bool]:
    """Return the largest sets without a pair that differs, and whether these are all of them.

    Every pair that does not differ is in one of the sets; with too many of them only those of
    strategies that follow one another in the ranking are returned.
    """
    apart = [0] * count
    for i, j in different:
        apart[i] |= 1 << j
        apart[j] |= 1 << i
    sets = _cliques(apart)
    listed = _stretches(apart) if sets is None else sets
    members = ([place for place in range(count) if found >> place & 1] for found in listed)
    return sorted(members), sets is not None


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


def _letter(place: int) -> str:
    """Return a, b, ... z, aa, ab ..."""
    text = ""
    place += 1
    while place:
        place, rest = divmod(place - 1, 26)
        text = chr(ord("a") + rest) + text
    return text
