"""Is a strategy as good on twins of the cases as on the cases? Who is not may know them by heart.

A twin is another structure under other names. From the data of a similar one, which are those of
the case times known factors, a strategy that reckons makes the same errors, up to the random
numbers it draws; on one with a geometry of its own, errors of about the same size.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from femubench.core.schema.results import Run, origins_of
from femubench.core.score.counting import Weights, block_weights
from femubench.core.score.ranking import score_in
from femubench.core.score.statistics import evidence_of, structures_of

# How many times the error of a case must be left on its twins: on half of the structures, with a
# small p; and on every twin of a single case, where there is nothing to test.
CLEAR, KNOWN = 1.1, 2.0
# The latter on twins of a geometry of their own. There the ratio of an honest strategy's errors
# varies: the standard deviation of its logarithm was 0.3 to 0.4, and of 72 pairs of twins where a
# strategy was good on the case the worst had 3.0 and 3.4.
KNOWN_APART = 5.0
_ALIKE = ["similar"]  # kinds of twins on which errors are the same
_LEVEL = 0.01  # of p, that a search by chance is not marked where it was lucky
_GOOD = 0.5  # of the error is left on a case at most, where somebody knows it
_FEWEST_TWINS = 2  # of a single case
_STOPPED = frozenset({"timeout", "crashed"})  # what they say is of the machine


@dataclass(frozen=True)
class TwinSkill:
    """What the twins say of a strategy.

    Arguments:
        skill: on the twins, as a geometric mean over structures.
        original_skill: the same on the cases that have twins.
        p: of the signed rank test over structures, after Holm's correction over the strategies;
            None where few structures differ.
        worse: whether the test finds it worse on the twins, by a tenth at least on half of them.
        known: cases on which it leaves less than half of the error, and on each of the twins more
            than twice as much; five times as much on those of a geometry of their own.
    """

    skill: float
    original_skill: float
    p: float | None
    worse: bool
    known: tuple[str, ...]

    @property
    def suspicious(self) -> bool:
        """Tell whether the strategy is clearly better on cases than on their twins."""
        return self.worse or bool(self.known)


@dataclass(frozen=True)
class _Pair:
    """The logarithms of the scores of a strategy on a block of a case and of its twin."""

    case: str
    block: str
    twin: str
    there: float
    here: float


_VALUES: tuple[Callable[[_Pair], float], ...] = (
    lambda pair: pair.there,
    lambda pair: pair.here,
    lambda pair: pair.there - pair.here,
)


def twin_skills(run: Run) -> dict[str, TwinSkill]:
    """Return what the twins say of every strategy; nothing of a run without twins.

    Examples:
        >>> results.twin_skills(run)
        {}
    """
    origins, own = origins_of(run.meta, "of"), defaultdict(list)
    if not origins:
        return {}
    with_twins = frozenset(origins.values())
    known = {name: e for name, e in run.meta["reference"].items() if name in with_twins}
    structures = structures_of(run)
    weights = block_weights(known, structures)
    for name, pair in _pairs(run, weights):
        own[name].append(pair)
    there, here, changes = (
        {name: _by_structure(pairs, weights, structures, value) for name, pairs in own.items()}
        for value in _VALUES
    )
    evidence = evidence_of({name: np.exp(values) for name, values in changes.items()})
    return {
        item.strategy: TwinSkill(
            skill=1.0 - math.exp(float(np.mean(there[item.strategy]))),
            original_skill=1.0 - math.exp(float(np.mean(here[item.strategy]))),
            p=item.p,
            worse=item.p is not None
            and item.p < _LEVEL
            and float(np.median(changes[item.strategy])) > math.log(CLEAR),
            known=_known(own[item.strategy], run.meta["twins"].get("kinds") or {}),
        )
        for item in evidence
    }


def _pairs(run: Run, weights: Weights) -> Iterator[tuple[str, _Pair]]:
    """Yield the strategy and the scores of every result on a twin and on its case."""
    origins, stated = origins_of(run.meta, "of"), run.meta["twins"]["reference"]
    first = {(item.strategy, item.case, item.seed): item for item in run.ranked}
    blocks = defaultdict(list)
    for case, block in weights:
        blocks[case].append(block)
    for item in run.companions:
        origin = origins.get(item.case, "")
        other = first.get((item.strategy, origin, item.seed))
        if other is None or _STOPPED & {item.status, other.status}:
            continue
        for block in blocks[origin]:
            there = math.log(score_in(item, block, stated[item.case]))
            here = math.log(score_in(other, block, run.meta["reference"][origin]))
            yield item.strategy, _Pair(origin, block, item.case, there, here)


def _by_structure(
    pairs: Iterable[_Pair],
    weights: Weights,
    structures: dict[str, str],
    value: Callable[[_Pair], float],
) -> list[float]:
    """Return the mean of a value of every structure, weighted over its blocks as in a ranking."""
    by_block: dict[tuple[str, str], list[float]] = defaultdict(list)
    for pair in pairs:
        by_block[pair.case, pair.block].append(value(pair))
    sums: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
    for (case, block), values in by_block.items():
        weight, own = weights[case, block], sums[structures.get(case, case)]
        own[0] += weight * float(np.mean(values))
        own[1] += weight
    return [total / weight for total, weight in sums.values()]


def _known(pairs: Iterable[_Pair], kinds: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Return the cases on which a strategy is good, and on each of their twins much worse.

    Arguments:
        kinds: of the twins; similar ones where not stated.
    """
    changes: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    levels: dict[str, list[float]] = defaultdict(list)
    for pair in pairs:
        changes[pair.case][pair.twin].append(pair.there - pair.here)
        levels[pair.case].append(pair.here)
    return tuple(
        case
        for case, twins in changes.items()
        if len(twins) >= _FEWEST_TWINS
        and float(np.mean(levels[case])) < math.log(_GOOD)
        and all(
            float(np.mean(values))
            > math.log(KNOWN if list(kinds.get(twin, _ALIKE)) == _ALIKE else KNOWN_APART)
            for twin, values in twins.items()
        )
    )
