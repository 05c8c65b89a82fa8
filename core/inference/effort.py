"""How far a search is with what it knows of, how long the rest takes, whether its time is spent."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Literal

from femubench.core.inference.settings import settings
from femubench.core.pace import LATE, Advance, OnAdvance, Pace

Kind = Literal[
    "faults", "typed", "single", "together", "more", "values", "unseen", "drawing", "advice"
]  # fmt: skip
# So many pieces; or so many where what was found leaves no more than noise, and where not.
Number = float | tuple[float, float]

# What is shown of each kind of piece; what they take is `settings.work_of_pieces`, in this order.
_KINDS: dict[Kind, str] = {
    "faults": "faults of the data",
    "typed": "faults of the input",
    "single": "single causes",
    "together": "causes together",
    "more": "more causes together",
    "values": "a value each direction",
    "unseen": "unseen data",
    "drawing": "what the drawing lacks",
    "advice": "what to measure next",
}


def of_a_search(bases: int, several: bool) -> dict[Kind, Number]:
    """Return the pieces that one search mostly takes.

    Arguments:
        bases: textbook sets that there are; causes are sought on the best of them.
        several: whether more than one cause is sought.
    """
    tried, exchanged = settings.candidates, 2  # either cause of a pair
    pairs = several * (settings.seeds + exchanged)
    return {
        "single": (min(bases, tried), min(bases, tried + 1)),
        "together": (several * exchanged, pairs),
        "more": (0, several * (settings.most_causes - 2)),
        "values": several * settings.candidates,
    }


class Effort:
    """Pieces of work that are done, those that are known to come, and the time they may take.

    Arguments:
        budget: seconds from now on, after which what is not needed is left; None for no end.
        on_advance: called when a piece begins or ends.
        clock: seconds from any time on.
    """

    def __init__(
        self,
        budget: float | None = None,
        on_advance: OnAdvance | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.budget, self._on_advance, self._clock = budget, on_advance, clock
        self._begin, self.cut = clock(), set[Kind]()
        self._pace = Pace(dict(zip(_KINDS, settings.work_of_pieces, strict=True)))
        self._done = 0
        self._piece: tuple[Kind, float] | None = None
        self._ahead: list[dict[Kind, Number]] = []
        self._adequate: bool | None = None

    @contextmanager
    def scope(self, ahead: Mapping[Kind, Number] | None = None) -> Iterator[None]:
        """Expect pieces inside; those it can do without are not expected after it."""
        self._ahead.append(dict(ahead or {}))
        try:
            yield
        finally:
            self._ahead.pop()

    def expect(self, kind: Kind, number: Number) -> None:
        """Expect so many pieces of a kind from now on, in the innermost scope."""
        if self._ahead:
            self._ahead[-1][kind] = number

    def expect_alike(self, searches: int, several: bool) -> None:
        """Expect as many searches more, of several causes or of single ones."""
        each = of_a_search(settings.candidates + 1, several)
        for kind in ("single", "together", "more"):
            self.expect(kind, _times(searches, each[kind]))

    def note_adequacy(self, adequate: bool) -> None:
        """Say whether what was found leaves no more than noise, which decides on what follows."""
        self._adequate = adequate

    @contextmanager
    def piece(self, kind: Kind) -> Iterator[None]:
        """Do one piece of a kind."""
        for ahead in reversed(self._ahead):
            if number := ahead.get(kind):
                ahead[kind] = _less(number)
                break
        self._piece = kind, self._clock()
        self._tell(1)
        yield
        self._pace.took(kind, self._clock() - self._piece[1])
        self._done += 1
        self._tell(0)

    def step(self, done: int, total: int) -> None:
        """Say how far the piece that is being done is, in steps of its own."""
        self._tell(1, f" {done}/{total}")

    def _tell(self, current: int, step: str = "") -> None:
        if self._on_advance is None or self._piece is None:
            return
        kind, begin = self._piece
        numbers = dict.fromkeys(_KINDS, 0.0)
        for ahead in self._ahead:
            for name, number in ahead.items():
                numbers[name] += self._number(number)
        here = current * max(self._pace.of(kind) - (self._clock() - begin), 0.0)
        known = self._adequate is not None
        left = here + sum(n * self._pace.of(name) for name, n in numbers.items())
        total = self._done + current + round(sum(numbers.values()))
        what = f"{_KINDS[kind]}{step}"
        self._on_advance(Advance(self._done, total, what, left if known else None, here))

    def _number(self, number: Number) -> float:
        if isinstance(number, tuple):
            return number[0] if self._adequate else number[1]
        return number

    @property
    def spent(self) -> float:
        """Return the seconds since the begin."""
        return self._clock() - self._begin

    def stops(self, kind: Kind = "unseen") -> bool:
        """Tell whether the time is spent but for what is to come of a kind and of those after it.

        Anyone who asks leaves the rest, which is remembered.
        """
        last = [*_KINDS][[*_KINDS].index(kind) :]
        kept = sum(self._pace.of(k) for k in last if any(own.get(k) for own in self._ahead))
        # Of the drawing more is said than of anything: it may be as late as a diagnosis may.
        late = LATE if kind == "drawing" else 1.0
        spent = self.budget is not None and self.spent >= late * self.budget - kept
        self.cut |= {kind} if spent else set()
        return spent


def _times(factor: int, number: Number) -> Number:
    if isinstance(number, tuple):
        return factor * number[0], factor * number[1]
    return factor * number


def _less(number: Number) -> Number:
    """Return a number of pieces once one of them has begun."""
    if isinstance(number, tuple):
        return max(number[0] - 1.0, 0.0), max(number[1] - 1.0, 0.0)
    return max(number - 1.0, 0.0)
