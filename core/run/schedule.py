"""Jobs through the workers: run in one process, judged in another."""

from __future__ import annotations

import hashlib
import json
import pickle
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any

from femubench.core.child.guarded_child import Ending
from femubench.core.child.limits import Limits
from femubench.core.child.workers import Workers
from femubench.core.errors import InputError
from femubench.core.run.answers import AnswerError, read_report
from femubench.core.run.jobs import JobOutcome
from femubench.core.run.judging import Dossier, JudgeAnswer, judge_outcome, run_strategy
from femubench.core.run.slots import Slot, Start, first_seed
from femubench.core.run.standing_judge import Judges
from femubench.core.schema.results import JobName, JobResult, Status
from femubench.core.schema.validation import read_plain
from femubench.core.score.scoring import Reference

_Task = tuple[int, bytes]  # place of a job, and its answer once it is there to be judged
Processes = tuple[Workers[_Task], Judges[_Task]]
Show = Callable[[Slot, Mapping[str, Any]], None]
Answers = Mapping[JobName, bytes]
_LEAST_JUDGING = 300.0  # s
_MOST_CASES = 100  # that are kept as the judge reads them
_ATTEMPTS = 3  # to start a process


@dataclass(frozen=True)
class Workload:
    """The jobs of a run with all that it takes to compute and to judge them.

    Arguments:
        references: what the results of a case are measured against, by its name.
        show: takes the exhibit of a job of the first seed, before its result comes.
        answers: that are there already; these jobs are not run, only judged.
        keep: takes every answer that has a model.
    """

    slots: Sequence[Slot]
    references: Mapping[str, Reference]
    limits: Mapping[str, Limits]
    show: Show | None = None
    answers: Answers = field(default_factory=dict)
    keep: Callable[[JobName, bytes], None] | None = None

    def task(self, index: int) -> _Task:
        """Return a job with its answer, where that is there already."""
        return index, self.answers.get(self.slots[index].job_name, b"")

    @cached_property
    def _first_seed(self) -> int:
        return first_seed(self.slots)

    def is_shown(self, slot: Slot) -> bool:
        """Tell whether the exhibit of a job is wanted."""
        return self.show is not None and slot.seed == self._first_seed and not slot.varied

    def make_unjudged(self, index: int, outcome: JobOutcome) -> JobResult:
        """Return the result of a job that has no model to be judged."""
        slot = self.slots[index]
        names = slot.strategy, slot.seed, slot.nominal
        return judge_outcome(slot.case, self.references[slot.case.name], names, outcome)


@contextmanager
def open_processes(count: int) -> Iterator[Processes]:
    """Give so many workers, and judges."""
    with Workers[_Task](count).open() as workers, Judges[_Task]() as judges:
        yield workers, judges


def compute_jobs(
    workload: Workload,
    wanted: Iterable[int],
    count: int,
    pulse: Callable[[], None] = lambda: None,
    processes: Processes | None = None,
) -> Iterator[tuple[int, JobResult]]:
    """Yield the result of every wanted job as it comes, from processes of this machine.

    Arguments:
        wanted: places of jobs; the next is asked for when there is a process for it.
        pulse: called twice a second and more; what it raises ends the jobs that run.
        processes: that are there already, and stay; else there are some for this time.
    """
    bench = _Bench(workload, iter(wanted))
    if not bench.has_work(0):
        return
    opened = open_processes(count) if processes is None else nullcontext(processes)
    with opened as (workers, judges):
        try:
            while True:
                pulse()
                while (busy := workers.running + judges.busy) < workers.count:
                    if not bench.has_work(busy):
                        break
                    yield from bench.start(workers, judges)
                if not (workers.running or judges.busy):
                    return
                for task, ending in (*workers.wait(judges.at_work), *judges.take_ended()):
                    yield from bench.take(task, ending)
        finally:
            workers.stop()
            judges.stop()


class _Bench:
    """What happens to a job: run in one process, judged in another."""

    def __init__(self, workload: Workload, wanted: Iterator[int]) -> None:
        self._load, self._wanted = workload, wanted
        self._case = lru_cache(_MOST_CASES)(self._pickled)
        self._attempts = Counter[int]()
        self._alone: set[int] = set()
        self.waiting: deque[_Task] = deque()
        self.answers: deque[_Task] = deque()
        # Ended by another job, or they ended others: they run last, one at a time.
        self.lonely: deque[_Task] = deque()

    def has_work(self, busy: int) -> bool:
        """Tell whether there is something to start while so many run."""
        if not (self.waiting or self.answers):
            self.waiting.extend(map(self._load.task, islice(self._wanted, 1)))
        return bool(self.waiting or self.answers or (self.lonely and not busy))

    def start(
        self, workers: Workers[_Task], judges: Judges[_Task]
    ) -> Iterator[tuple[int, JobResult]]:
        """Start judging an answer or running a job; yield the result of one that cannot start."""
        task = (self.answers or self.waiting or self.lonely).popleft()
        index, answer = task
        slot = self._load.slots[index]
        job = None if answer else slot.job
        if isinstance(job, JobOutcome):
            yield index, self._load.make_unjudged(index, job)
            return
        if answer:
            names = slot.strategy, slot.seed, slot.nominal
            digest, case = self._case(slot.start)
            verdict = Dossier(case, answer, *names, exhibited=self._load.is_shown(slot))
            limits = self._load.limits[slot.strategy]
            seconds = None if limits.seconds is None else max(_LEAST_JUDGING, limits.seconds)
            ending = judges.start(
                task, digest, verdict, replace(limits, seconds=seconds, sandbox="off")
            )
        else:
            ending = workers.start(task, run_strategy, job, self._load.limits[slot.strategy])
        if ending is not None and not self._again(task):
            yield index, self._load.make_unjudged(index, JobOutcome("crashed", ending.reason))

    def _again(self, task: _Task) -> bool:
        """Try a task once more for which there was no process; tell whether it may be tried."""
        index, answer = task
        self._attempts[index] += 1
        if self._attempts[index] >= _ATTEMPTS:
            return False
        (self.answers if answer else self.waiting).append(task)
        return True

    def take(self, task: _Task, ending: Ending) -> Iterator[tuple[int, JobResult]]:
        """Yield the result of a task that has ended, unless its job goes on."""
        index, answer = task
        if ending.how == "orphaned" and index not in self._alone:
            self._alone.add(index)
            self.lonely.append(task)
        elif ending.how == "no-start" and self._again(task):
            return
        elif answer and ending.how == "died" and self._again(task):
            return  # anyone who ended the judge has only delayed its judgement
        elif answer:
            found = self._judgement(self._load.slots[index], ending)
            yield (
                index,
                self._load.make_unjudged(index, found) if isinstance(found, JobOutcome) else found,
            )
        else:
            if ending.how != "answer":
                status: Status = "timeout" if ending.how == "timeout" else "crashed"
                outcome = JobOutcome(status, ending.reason, seconds=ending.seconds)
            else:
                try:
                    outcome = read_report(ending.answer)
                except AnswerError as error:
                    outcome = JobOutcome("failed", str(error), seconds=ending.seconds)
            if outcome.status == "ok":
                if self._load.keep is not None:
                    self._load.keep(self._load.slots[index].job_name, ending.answer)
                self.answers.append((index, ending.answer))
            else:
                yield index, self._load.make_unjudged(index, outcome)

    def _judgement(self, slot: Slot, ending: Ending) -> JobResult | JobOutcome:
        if ending.how != "answer":
            return JobOutcome("failed", f"its model could not be judged: {ending.reason}")
        try:
            found = read_plain(JudgeAnswer, json.loads(ending.answer))
        except InputError as error:
            return JobOutcome("failed", f"its result is out of bounds: {error}")
        if self._load.show is not None and found.exhibit is not None:
            self._load.show(slot, found.exhibit)
        return found.result

    def _pickled(self, start: Start) -> tuple[bytes, bytes]:
        """Return a case and its reference as the judge reads them, after their digest."""
        pair = start.case, self._load.references[start.case.name]
        data = pickle.dumps(pair, protocol=pickle.HIGHEST_PROTOCOL)
        return hashlib.blake2b(data, digest_size=16).digest(), data
