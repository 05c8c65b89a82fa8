"""What is believed before any datum is seen: how many causes, where, which textbook physics."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import factorial, log

import numpy as np

from femubench.core.fit.projection import Projection
from femubench.core.inference.settings import settings


@dataclass(frozen=True)
class Base:
    """Effects of the textbook that are in the model before causes are sought.

    Arguments:
        parts: at their textbook coordinates.
        log_prior: ln of the probability of this set.
    """

    parts: tuple[Projection, ...]
    log_prior: float

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the slugs."""
        return tuple(part.hypothesis.name for part in self.parts)

    @cached_property
    def x(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Return the textbook coordinates, (k,)."""
        found = [part.hypothesis.textbook for part in self.parts]
        return np.concatenate([x for x in found if x is not None] or [np.zeros(0)])


def textbook_bases(projections: Iterable[Projection]) -> list[Base]:
    """Return every set of textbook effects that the model lacks, the empty one first."""
    known = [p for p in projections if p.hypothesis.textbook is not None]
    if not known:
        return [Base((), 0.0)]
    some = max(2 ** len(known) - 2, 1)
    # Physics that every beam has need not earn its place: a model lacks all of it, most likely.
    drawn, whole = settings.prior_as_drawn, settings.prior_whole_textbook
    shares, rest = {0: drawn, len(known): whole}, (1.0 - drawn - whole) / some
    return [
        Base(parts, log(shares.get(count, rest)))
        for count in range(len(known) + 1)
        for parts in combinations(known, count)
    ]


def log_prior(parts: Sequence[Projection], names: int, counts: Sequence[float]) -> float:
    """Return ln of the prior probability of causes at places.

    Arguments:
        parts: the causes.
        names: number of effects that were candidates.
        counts: prior probability of so many causes.
    """
    count = len(parts)
    result = log(counts[min(count, len(counts) - 1)]) + log(factorial(count))
    for part in parts:
        result -= log(names) + log(part.hypothesis.places)
    return result


def outside_odds(count: int, counts: Sequence[float]) -> float:
    """Return the odds that so many causes together imitate one outside the catalogue.

    Arguments:
        count: of the causes; nothing imitates nothing.
        counts: prior probability of so many causes.
    """
    if not count:
        return 0.0
    imitated = settings.prior_imitated[count > 1]
    return imitated / counts[min(count, len(counts) - 1)]


def selection_cost(names: int, places: float) -> float:
    """Return by how much chi-square must fall for one more cause to be worth its prior."""
    _, one, two, *_ = settings.prior_of_causes
    return 2.0 * (log(names) + log(max(places, 1.0)) + log(one / two))
