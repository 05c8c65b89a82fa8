"""Is a strategy as good on twins of the cases as on the cases? Who is not may know them by heart.

A twin is another structure under other names. From the data of a similar one, which are those of
the case times known factors, a strategy that reckons makes the same errors, up to the random
numbers it draws; on one with a geometry of its own, errors of about the same size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femubench.core.schema.results import JobResult, RunData, origins_of
from femubench.core.score.leaderboard import GainTable
from femubench.core.score.ranking import Scale
from femubench.core.score.statistics import weigh_evidence

# How much more it gains on cases than on twins: on a quarter of the structures, since not all have
# stretched twins, with a small p; and, as a multiple of what is left of the error, on every twin of
# a case, where there is nothing to test: on stretched ones what was good left 2.4 times as much.
CLEAR, KNOWN = 0.1, 3.0
_LEVEL = 0.01  # of p, that a search by chance is not marked where it was lucky
_GOOD = 0.5  # of the error is left on a case at most, where somebody knows it
_FEWEST_TWINS = 2  # of a single case
_STOPPED = frozenset({"timeout", "crashed"})  # what they say is of the machine


@dataclass(frozen=True)
class TwinGain:
    """What the twins say of a strategy.

    Arguments:
        gain: on the twins, mean over structures.
        original_gain: the same on the cases that have twins.
        p: that they differ by chance, corrected for all strategies; None with few structures.
        worse: whether it is shown to gain less on the twins, by 0.1 at least on a quarter of them.
        known: cases on which it leaves less than half of the error, and on each of the twins more
            than three times as much.
    """

    gain: float
    original_gain: float
    p: float | None
    worse: bool
    known: tuple[str, ...]

    @property
    def suspicious(self) -> bool:
        """Tell whether the strategy is clearly better on cases than on their twins."""
        return self.worse or bool(self.known)


def twin_gains(run: RunData) -> dict[str, TwinGain]:
    """Return what the twins say of every strategy; nothing of a run without twins.

    Raises:
        InputError: when the run keeps too little to be scored.

    Examples:
        >>> results.twin_gains(run)
        {}
    """
    origins = origins_of(run.meta, "of")
    if not origins:
        return {}
    ran = [r for r in run.companions if r.case in origins and r.status not in _STOPPED]
    twins = GainTable.of(run, ran, run.nominals[0], origins)
    first = [r for r in run.ranked if r.status not in _STOPPED]
    own = GainTable.of(run, first, run.nominals[0], {case: case for case in origins.values()})
    pairs = {name: np.array([own.gains(name), twins.gains(name)]) for name in own.names}
    pairs = {name: both[:, np.isfinite(both).all(axis=0)] for name, both in pairs.items()}
    lost = {name: both[0] - both[1] for name, both in pairs.items() if both.size}
    scale = Scale.of(run.meta)
    return {
        item.strategy: TwinGain(
            gain=float(pairs[item.strategy][1].mean()),
            original_gain=float(pairs[item.strategy][0].mean()),
            p=item.p,
            worse=item.p is not None
            and item.p < _LEVEL
            and float(np.quantile(lost[item.strategy], 0.75)) > CLEAR,
            known=_known(run, scale, item.strategy, ran),
        )
        for item in weigh_evidence(lost)
    }


def _known(run: RunData, scale: Scale, strategy: str, ran: Sequence[JobResult]) -> tuple[str, ...]:
    """Return the cases on which a strategy is good, and on each of their twins much worse.

    Arguments:
        ran: results on twins.
    """
    origins = origins_of(run.meta, "of")
    # Frequencies and changes apart: who knows one of the two by heart need not know the other.
    left: dict[tuple[str, str], list[float]] = {}
    for result in (*run.ranked, *ran):
        if result.strategy == strategy and result.case in scale.textbook:
            own, given = scale.errors(result), scale.textbook[result.case]
            for part in ("error", "change"):
                e, r = (max(getattr(errors, part), scale.rule.floor) for errors in (own, given))
                left.setdefault((result.case, part), []).append(e / r)
    means = {key: float(np.mean(values)) for key, values in left.items()}
    known: dict[str, None] = {}
    for (case, part), here in means.items():
        twins = [name for name, of in origins.items() if of == case and (name, part) in means]
        far = all(means[name, part] > KNOWN * here for name in twins)
        if len(twins) >= _FEWEST_TWINS and here < _GOOD and far:
            known[case] = None
    return tuple(known)
