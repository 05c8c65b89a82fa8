"""The line that shows how far something is, and the time left in it, by a clock of our own."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Sequence
from threading import Event

import pytest
from rich.console import Console
from rich.progress import Progress

from femubench.core.cli.progress import say_progress, show_progress
from femubench.core.inference.effort import Effort, Kind
from femubench.core.pace import Advance
from femubench.core.run.jobs_left import JobsLeft
from femubench.results import JobResult


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def result(case: str, strategy: str, seconds: float, seed: int = 0) -> JobResult:
    return JobResult(case, strategy, seed, "ok", seconds=seconds)


def ran(
    left: JobsLeft, clock: Clock, jobs: Sequence[JobResult], workers: int, overhead: float = 0.0
) -> Iterator[tuple[float, Advance]]:
    """Yield the true time left after each job, and what is said; jobs begin in their order."""
    free, ends = [0.0] * workers, []
    for job in jobs:
        first = free.index(min(free))
        free[first] += job.seconds + overhead
        ends.append((free[first], job))
    begin = clock.now
    for end, job in sorted(ends, key=lambda pair: pair[0]):
        clock.now = begin + end
        yield max(free) - end, left.after(job)


def pairs(jobs: Iterable[JobResult]) -> Iterator[tuple[str, str]]:
    return ((job.case, job.strategy) for job in jobs)


@pytest.mark.parametrize(("workers", "overhead"), [(1, 0.0), (4, 3.0)])
def test_steady_jobs(clock: Clock, workers: int, overhead: float) -> None:
    """Right from the first round of all workers on."""
    jobs = [result(f"case{k}", "a", 5.0) for k in range(40)]
    left = JobsLeft(pairs(jobs), (), workers, clock)
    said = list(ran(left, clock, jobs, workers, overhead))
    assert [advance.done for _, advance in said] == list(range(1, 41))
    assert {advance.total for _, advance in said} == {40}
    for true, advance in said[workers - 1 :]:
        assert advance.left == pytest.approx(true, abs=5.0 + overhead if workers > 1 else 1e-6)
    assert said[-1][1].left == 0.0


def test_jobs_of_different_lengths(clock: Clock) -> None:
    """What the strategies and the cases took tells what the pairs will take that are left.

    The slow one comes last in every case, and the large case last: said before any of that is done.
    """
    sizes = {"small": 1.0, "middle": 2.0, "large": 40.0}
    jobs = [
        result(case, name, seconds * size, seed)
        for seed in (1, 2, 3)
        for case, size in sizes.items()
        for name, seconds in {"quick": 0.1, "usual": 1.0, "slow": 9.0}.items()
    ]
    said = list(ran(JobsLeft(pairs(jobs), (), 1, clock), clock, jobs, 1))
    for true, advance in said[7:-1]:
        assert advance.left == pytest.approx(true, rel=0.2, abs=1.0)


def test_a_run_that_goes_on_counts_what_is_to_be_done(clock: Clock) -> None:
    """A thousand kept results are no speed, but tell that the slow jobs are those that are left."""
    kept = [result("a", "quick", 0.1, seed) for seed in range(1000)]
    kept += [result("a", "slow", 60.0)]
    jobs = [result("a", "quick", 0.1, 1000), *(result("a", "slow", 60.0, k) for k in (1, 2))]
    left = JobsLeft(pairs(jobs), kept, 1, clock)
    said = list(ran(left, clock, jobs, 1))
    assert [(advance.done, advance.total) for _, advance in said] == [(1, 3), (2, 3), (3, 3)]
    for true, advance in said:
        assert advance.left == pytest.approx(true, abs=1e-6)


class TestEffort:
    def said(self, clock: Clock) -> tuple[Effort, list[Advance]]:
        said: list[Advance] = []
        return Effort(None, said.append, clock), said

    def work(self, effort: Effort, clock: Clock, kind: Kind, seconds: float) -> None:
        with effort.piece(kind):
            clock.now += seconds

    def test_no_time_is_said_before_it_is_known(self, clock: Clock) -> None:
        effort, said = self.said(clock)
        with effort.scope({"single": (1, 3)}):
            self.work(effort, clock, "single", 4.0)
            assert [advance.left for advance in said] == [None, None]
            assert said[-1].what == "single causes"
            effort.note_adequacy(False)
            self.work(effort, clock, "single", 4.0)
            assert said[-1].left == pytest.approx(4.0)
            effort.note_adequacy(True)
            self.work(effort, clock, "single", 4.0)
            assert said[-1].left == 0.0
        assert (said[-1].done, said[-1].total) == (3, 3)

    def test_a_piece_that_is_overdue_takes_no_time_from_others(self, clock: Clock) -> None:
        effort, said = self.said(clock)
        effort.note_adequacy(True)
        with effort.scope({"single": 3}):
            self.work(effort, clock, "single", 5.0)
            with effort.piece("single"):
                assert said[-1].left == pytest.approx(10.0)
                clock.now += 2.0
                effort.step(7, 40)
                assert said[-1].what == "single causes 7/40"
                assert said[-1].left == pytest.approx(8.0)
                clock.now += 50.0
                effort.step(8, 40)
                assert said[-1].left == pytest.approx(5.0)

    def test_a_budget_is_spent_by_its_clock(self, clock: Clock) -> None:
        effort = Effort(10.0, clock=clock)
        clock.now += 9.0
        assert not effort.stops()
        clock.now += 1.0
        assert effort.stops()
        assert effort.cut == {"unseen"}

    def test_a_budget_keeps_what_the_proof_takes(self, clock: Clock) -> None:
        effort = Effort(100.0, clock=clock)
        for kind in ("single", "unseen", "drawing", "advice"):
            self.work(effort, clock, kind, 3.0)
        clock.now += 87.0  # 99 s
        assert not effort.stops()  # nothing is to come
        with effort.scope({"unseen": 1, "drawing": 1, "advice": 1}):
            assert effort.stops()
            assert not effort.stops("drawing")  # which may end at 110 s
            clock.now += 9.0
            assert effort.stops("drawing")
        assert effort.cut == {"unseen", "drawing"}

    def test_advice_has_the_budget_to_its_end(self, clock: Clock) -> None:
        effort = Effort(10.0, clock=clock)
        with effort.scope({"advice": 1}), effort.piece("advice"):
            clock.now += 9.9
            assert not effort.stops("advice")
            clock.now += 0.1
            assert effort.stops("advice")


def test_a_line_every_ten_seconds_where_there_is_no_terminal(clock: Clock) -> None:
    lines: list[str] = []
    written = Event()

    def write(line: str) -> None:
        lines.append(line)
        written.set()

    with say_progress("case", write, clock, every=0.01) as stated:
        stated(Advance(3, 12, "single causes", 130.0, 5.0))
        clock.now += 65.0
        assert written.wait(60.0)  # the thread's first line may be older than the clock's move
        lines.clear()
        written.clear()
        assert written.wait(60.0)
    assert lines[-1] == "case: single causes, 3/12, 0:01:05 gone, 0:02:05 left"


def shown(file: io.StringIO) -> str:
    """Return the last line of a terminal."""
    return re.sub(r"\x1b\[\??[\d;]*[a-zA-Z]", "", file.getvalue()).split("\r")[-1]


def test_one_line_that_takes_itself_away(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = Progress.update
    monkeypatch.setattr(
        Progress, "update", lambda self, *a, **words: plain(self, *a, **words, refresh=True)
    )
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=80)
    with show_progress("[red]frame", console, clock) as stated:
        clock.now += 65.0
        stated(Advance(3, 12, "single causes", 130.0, 5.0))
        line = shown(file)
        assert line.startswith("[red]frame: single causes ")
        assert re.search(r" 3/12 +0:01:05 0:02:10 left *$", line)
        assert len(line) <= 80
        stated(Advance(4, 12, "a name that is so long that it would never go into a line of these"))
        assert re.search(r" 4/12 +0:01:05 -:--:-- left *$", shown(file))
        stated(Advance(12, 12, "end", 0.0))
    assert file.getvalue().endswith("\x1b[1A\x1b[2K")
    assert not shown(file).strip()
