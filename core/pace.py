"""How far something is, and how long the rest takes, from pieces of each kind that are done."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass

LATE = 1.1  # of a budget of seconds: up to here it counts as kept


@dataclass(frozen=True)
class Advance:
    """How far something is.

    Arguments:
        done, total: pieces of work, as far as they are known.
        left: seconds that the rest takes; None where that is not known.
        current: seconds of those that the present piece takes: for so long, time that goes by is
            time less.
    """

    done: int
    total: int
    what: str = ""
    left: float | None = None
    current: float = 0.0


OnAdvance = Callable[[Advance], None]


class Pace:
    """Seconds that a piece of each kind takes.

    Arguments:
        weights: what a piece of each kind takes, in any unit: of a kind none of which is done, and
            as much as one that is done of every other.
    """

    def __init__(self, weights: Mapping[str, float]) -> None:
        self._weights = weights
        self._seconds, self._count = dict.fromkeys(weights, 0.0), Counter[str]()
        self._expected = 0.0

    def took(self, kind: str, seconds: float) -> None:
        """Take note of a piece that is done."""
        self._seconds[kind] += seconds
        self._count[kind] += 1
        self._expected += self._weights[kind]

    def of(self, kind: str) -> float:
        """Return the seconds that a piece of a kind takes; 0 where nothing is done yet."""
        if not self._expected:
            return 0.0
        foreseen = self._weights[kind] * sum(self._seconds.values()) / self._expected
        return (foreseen + self._seconds[kind]) / (1 + self._count[kind])
