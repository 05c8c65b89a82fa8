"""How long the jobs that are left of a run take, from those that are done and the stored ones."""

from __future__ import annotations

import time
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterable
from math import exp, log
from statistics import fmean

from femubench.core.pace import Advance
from femubench.core.schema.results import JobResult

Pair = tuple[str, str]  # case and strategy

_OFTEN, _MANY = 1.0, 100  # s after which the time is estimated anew, once so many jobs are done
_SWEEPS, _LEAST = 10, 1e-4  # s


class JobsLeft:
    """Jobs that are to be done in their order, each as long as such jobs were.

    Arguments:
        jobs: case and strategy of each.
        known: results that are there before, which tell how long jobs are.
        workers: number of jobs that run at once.
        clock: seconds from any time on; the jobs begin now.
    """

    def __init__(
        self,
        jobs: Iterable[Pair],
        known: Iterable[JobResult],
        workers: int,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._waiting = deque(jobs)
        self._total, self._done = len(self._waiting), 0
        self._workers, self._clock = workers, clock
        self._sizes = _Sizes()
        for result in known:
            self._sizes.add((result.case, result.strategy), result.seconds)
        # What jobs take as well: processes to start, judging, and waiting for either.
        self._overhead = 0.0
        now = clock()
        self._running = [(pair, now) for pair in self._taken(workers)]
        self._estimate = now, 0.0

    def _taken(self, count: int) -> list[Pair]:
        return [self._waiting.popleft() for _ in range(min(count, len(self._waiting)))]

    def after(self, result: JobResult) -> Advance:
        """Return how far the jobs are when one more is done."""
        now, pair = self._clock(), (result.case, result.strategy)
        self._sizes.add(pair, result.seconds)
        alike = [job for job in self._running if job[0] == pair] or self._running
        if alike:
            self._running.remove(alike[0])
            self._overhead += max(now - alike[0][1] - result.seconds, 0.0)
        self._running += [(following, now) for following in self._taken(1)]
        self._done += 1
        rest = self._total - self._done
        if now - self._estimate[0] >= _OFTEN or self._done <= _MANY or not rest:
            self._estimate = now, self._seconds(now)
        left = max(self._estimate[1] - (now - self._estimate[0]), 0.0)
        return Advance(self._done, self._total, " ".join(pair), left, left / max(rest, 1))

    def _seconds(self, now: float) -> float:
        """Return the seconds until all are done."""
        overhead, sizes = self._overhead / self._done, self._sizes.fit()
        ahead = [max(sizes(pair) + overhead - (now - begin), 0.0) for pair, begin in self._running]
        later = sum(n * (sizes(pair) + overhead) for pair, n in Counter(self._waiting).items())
        return max((sum(ahead) + later) / self._workers, max(ahead, default=0.0))


class _Sizes:
    """Seconds of jobs by case and strategy."""

    def __init__(self) -> None:
        self._seconds, self._count = dict[Pair, float](), Counter[Pair]()

    def add(self, pair: Pair, seconds: float) -> None:
        self._seconds[pair] = self._seconds.get(pair, 0.0) + seconds
        self._count[pair] += 1

    def fit(self) -> Callable[[Pair], float]:
        """Return what gives the seconds of a job: those of such jobs, else case times strategy."""
        known = {pair: total / self._count[pair] for pair, total in self._seconds.items()}
        logs = {pair: log(max(seconds, _LEAST)) for pair, seconds in known.items()}
        case, strategy = dict.fromkeys((c for c, _ in logs), 0.0), dict[str, float]()
        for _ in range(_SWEEPS):
            strategy = _means((s, x - case[c]) for (c, s), x in logs.items())
            case = _means((c, x - strategy[s]) for (c, s), x in logs.items())
        # Nobody knows which of the others a new one is like: their mean, not that of logarithms.
        others = [log(fmean(map(exp, by.values()))) if by else 0.0 for by in (case, strategy)]

        def size(pair: Pair) -> float:
            if pair in known:
                return known[pair]
            return exp(case.get(pair[0], others[0]) + strategy.get(pair[1], others[1]))

        return size


def _means(rows: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Return the mean of the figures of each name."""
    found = defaultdict[str, list[float]](list)
    for name, figure in rows:
        found[name].append(figure)
    return {name: fmean(figures) for name, figures in found.items()}
