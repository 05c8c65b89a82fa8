"""How far a search is with the fits it knows of, and whether its time is spent."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Told = Callable[[int, int], None]


class Effort:
    """Fits that are done, of how many, and the time they may take.

    Arguments:
        budget: seconds from now on for the search for several causes; None for no end.
        told: called with the number of fits that are done and that of all known so far.
    """

    def __init__(self, budget: float | None = None, told: Told | None = None) -> None:
        self.budget, self.told = budget, told
        self.begin = time.perf_counter()
        self.done = self.known = self._end = 0
        self.cut = False

    @contextmanager
    def stage(self, fits: int) -> Iterator[None]:
        """Count what is done inside as at most so many fits; those it can do without count too."""
        outer, end = self._end, self.done + fits
        self._end, self.known = end, max(self.known, end)
        yield
        self._end = outer
        self._reach(end)

    def step(self) -> None:
        """Count one fit."""
        self._reach(min(self.done + 1, self._end))

    def _reach(self, done: int) -> None:
        self.done = max(self.done, done)
        if self.told is not None:
            self.told(self.done, self.known)

    def stops(self) -> bool:
        """Tell whether the time is spent; whoever asks leaves the rest, which is remembered."""
        spent = self.budget is not None and time.perf_counter() - self.begin >= self.budget
        self.cut = self.cut or spent
        return spent
