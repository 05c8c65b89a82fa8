"""How long the jobs that are left will take, from what the same ones took before."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from femubench.core.schema.results import JobResult
from femubench.core.study.axes import StudyAxes

Pair = tuple[str, str]  # case and strategy without conditions and options


@dataclass(frozen=True)
class Forecast:
    """What a study will take.

    Arguments:
        jobs, done: in all, and in the store already.
        seconds: of strategies and of judging them, for the jobs that are left and known.
        unknown: how many jobs of which case and strategy nothing is known of.
    """

    jobs: int
    done: int
    seconds: float
    longest: float
    unknown: Mapping[Pair, int]

    def wall(self, workers: int) -> float:
        """Return the seconds that so many workers take for what is known."""
        return max(self.seconds / workers, self.longest)


def forecast(
    jobs: int,
    left: Sequence[tuple[str, str]],
    axes: StudyAxes,
    before: Iterable[JobResult],
    judging: Mapping[str, float],
) -> Forecast:
    """Return what a study will take.

    Arguments:
        left: case and strategy of those that are left, as the run names them.
        judging: seconds that it takes to judge a model, by case without conditions.
    """
    exact: dict[Pair, list[float]] = defaultdict(list)
    alike: dict[Pair, list[float]] = defaultdict(list)
    origins = {setting.case: setting.case for setting in axes.cases.values()}
    origins |= {name: setting.case for name, setting in axes.cases.items()}
    for result in before:
        if result.status == "ok" and result.case in origins:
            case, name = origins[result.case], result.strategy
            exact[case, name].append(result.seconds)
            alike[case, name.partition(":")[0]].append(result.seconds)
    total, longest, unknown = 0.0, 0.0, Counter[Pair]()
    for (case, strategy), count in Counter(left).items():
        plain, base = axes.cases[case].case, axes.strategies[strategy].strategy
        known = exact.get((plain, strategy)) or alike.get((plain, base))
        if not known:
            unknown[plain, base] += count
            continue
        one = median(known) + judging[plain]
        total, longest = total + count * one, max(longest, one)
    return Forecast(jobs, jobs - len(left), total, longest, unknown)
