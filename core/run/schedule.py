"""Jobs through the workers: run in one process, judged in another."""

from __future__ import annotations

import json
import pickle
import sys
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from femubench.core.case.case import Case
from femubench.core.errors import InputError
from femubench.core.roles import Strategy
from femubench.core.run.answers import AnswerError, head_of
from femubench.core.run.jobs import Job, JobOutcome, one_line, seed_words, sent
from femubench.core.run.judging import Verdict, judged, run_judge, run_strategy
from femubench.core.run.limits import Limits
from femubench.core.run.provenance import (
    comes_along,
    job_key,
    provenance,
    strategy_version,
)
from femubench.core.run.workers import Ending, Workers
from femubench.core.schema.records import result_from_json
from femubench.core.schema.results import JobResult, Nominal, Status
from femubench.core.score.scoring import Reference


@dataclass(frozen=True)
class Slot:
    """One job of the run: who and what, and the job or why there is none.

    Arguments:
        case, strategy, seed: the job; the case has the nominal model that is started from.
        nominal: which one that is.
        key: of everything that decides on its result.
        provenance: of its result, in plain data.
        job: what a worker is given; None where it could not be made.
        fault: why.
        version: returns that of the strategy as its source is now; None where workers import no
            source of it.
    """

    case: Case
    strategy: str
    seed: int
    nominal: Nominal
    key: str
    provenance: Mapping[str, Any]
    job: Job | None
    fault: JobOutcome | None = None
    version: Callable[[], str] | None = None

    @property
    def stale(self) -> bool:
        """Tell whether the source of the strategy has changed since the key was made."""
        return self.version is not None and self.version() != self.provenance["strategy"]

    def made_by(self, meta: Mapping[str, Any]) -> Slot:
        """Return the job with the whole provenance of a run's results."""
        version = str(self.provenance["strategy"])
        digest = meta["cases"][self.case.name]["digest"]
        return replace(self, provenance=provenance(meta, digest, version, self.seed))


def slots_of(
    starts: Iterable[tuple[Nominal, Case]], strategies: Sequence[Strategy], seeds: Sequence[int]
) -> Iterator[Slot]:
    """Yield the jobs of a run, case by case and seed by seed.

    Arguments:
        starts: cases, each with a nominal model to start from.
    """
    pickled = [_pickled(strategy, sent) for strategy in strategies]
    versions = [strategy_version(strategy) for strategy in strategies]
    for nominal, case in starts:
        model = _pickled(case.model)
        for seed in seeds:
            measurement = _pickled(case.used_measurement(seed))
            for strategy, code, version in zip(strategies, pickled, versions, strict=True):
                parts = (code, model, measurement)
                fault = next((part for part in parts if isinstance(part, JobOutcome)), None)
                words = seed_words(case.name, strategy.name, seed)
                job = None if fault else Job(*parts, words)  # type: ignore[arg-type]
                known = _identity(strategy, code)
                key = job_key(case, strategy.name, known, version, seed)
                plain = {"strategy": version}
                # Workers have what comes along from the start: it is as it was all the run.
                now = None if comes_along(strategy) else partial(strategy_version, strategy)
                yield Slot(case, strategy.name, seed, nominal, key, plain, job, fault, now)


def _identity(strategy: Strategy, code: bytes | JobOutcome) -> bytes:
    """Return bytes that tell a strategy and its options from others, in this session and later.

    What was typed into a notebook has no file whose digest would tell a later version apart:
    there the code itself is what counts.
    """
    if getattr(sys.modules["__main__"], "__file__", None):
        with suppress(Exception):
            return _bytes(strategy)
    return code if isinstance(code, bytes) else repr(type(strategy)).encode()


_bytes = partial(pickle.dumps, protocol=pickle.HIGHEST_PROTOCOL)


def _pickled(thing: object, turned: Callable[[object], bytes] = _bytes) -> bytes | JobOutcome:
    try:
        return turned(thing)
    except Exception as error:
        reason = f"{type(thing).__name__} cannot be sent to a worker process: {one_line(error)}"
        return JobOutcome("failed", reason, traceback.format_exc())


_Task = tuple[int, bytes]  # place of a job, and its answer once it is there to be judged
Show = Callable[[Slot, Mapping[str, Any]], None]
_LEAST_JUDGING = 300.0  # s
_ATTEMPTS = 3  # to start a process


def computed(
    slots: Sequence[Slot],
    wanted: Sequence[int],
    references: Mapping[str, Reference],
    limits: Mapping[str, Limits],
    count: int,
    show: Show | None = None,
) -> Iterator[tuple[int, JobResult]]:
    """Yield the result of every wanted slot as it comes.

    Arguments:
        show: takes the exhibit of a job of the first seed, before its result comes.
    """

    bench = _Bench(slots, references, limits, show)
    for index in wanted:
        fault = slots[index].fault
        if fault is not None:
            yield index, bench.unjudged(index, fault)
        else:
            bench.waiting.append((index, b""))
    if not bench.waiting:
        return
    with Workers[_Task](count).open() as workers:
        while bench.waiting or bench.answers or bench.lonely or workers.busy:
            while workers.free and bench.has_work(workers):
                yield from bench.start(workers)
            for task, ending in workers.wait():
                yield from bench.taken(task, ending)


class _Bench:
    """What happens to a job: run in one process, judged in another."""

    def __init__(
        self,
        slots: Sequence[Slot],
        references: Mapping[str, Reference],
        limits: Mapping[str, Limits],
        show: Show | None,
    ) -> None:
        self._slots, self._references, self._limits = slots, references, limits
        self._show, self._shown = show, min((slot.seed for slot in slots), default=0)
        self._cases: dict[tuple[str, Nominal], bytes] = {}
        self._attempts = Counter[int]()
        self._alone: set[int] = set()
        self.waiting: deque[_Task] = deque()
        self.answers: deque[_Task] = deque()
        # Ended by another job, or they ended others: they run last, one at a time.
        self.lonely: deque[_Task] = deque()

    def has_work(self, workers: Workers[_Task]) -> bool:
        """Tell whether there is something to start now."""
        return bool(self.waiting or self.answers or (self.lonely and not workers.busy))

    def start(self, workers: Workers[_Task]) -> Iterator[tuple[int, JobResult]]:
        """Start judging an answer or running a job; yield the result of one that cannot start."""
        task = (self.answers or self.waiting or self.lonely).popleft()
        index, answer = task
        slot = self._slots[index]
        if answer:
            shown = self._show is not None and slot.seed == self._shown
            job = slot.strategy, slot.seed, slot.nominal
            verdict = Verdict(self._case(slot), answer, *job, exhibited=shown)
            ending = workers.start(task, run_judge, verdict, self._judging(slot.strategy))
        else:
            ending = workers.start(task, run_strategy, slot.job, self._limits[slot.strategy])
        if ending is not None and not self._again(task):
            yield index, self.unjudged(index, JobOutcome("crashed", ending.reason))

    def _again(self, task: _Task) -> bool:
        """Try a task once more for which there was no process; tell whether it may be tried."""
        index, answer = task
        self._attempts[index] += 1
        if self._attempts[index] >= _ATTEMPTS:
            return False
        (self.answers if answer else self.waiting).append(task)
        return True

    def taken(self, task: _Task, ending: Ending) -> Iterator[tuple[int, JobResult]]:
        """Yield the result of a task that has ended, unless its job goes on."""
        index, answer = task
        if ending.how == "orphaned" and index not in self._alone:
            self._alone.add(index)
            self.lonely.append(task)
        elif ending.how == "no-start" and self._again(task):
            return
        elif answer:
            found = self._judgement(self._slots[index], ending)
            yield index, self.unjudged(index, found) if isinstance(found, JobOutcome) else found
        else:
            outcome = _outcome_of(ending)
            if outcome.status == "ok":
                self.answers.append((index, ending.answer))
            else:
                yield index, self.unjudged(index, outcome)

    def unjudged(self, index: int, outcome: JobOutcome) -> JobResult:
        """Return the result of a job that has no model to be judged."""
        slot = self._slots[index]
        reference = self._references[slot.case.name]
        return judged(slot.case, reference, (slot.strategy, slot.seed, slot.nominal), outcome)

    def _judgement(self, slot: Slot, ending: Ending) -> JobResult | JobOutcome:
        if ending.how != "answer":
            return JobOutcome("failed", f"its model could not be judged: {ending.reason}")
        data = json.loads(ending.answer)
        try:
            result = result_from_json(data["result"])
        except InputError as error:
            return JobOutcome("failed", f"its result is out of bounds: {error}")
        if self._show is not None and data["exhibit"] is not None:
            self._show(slot, data["exhibit"])
        return result

    def _case(self, slot: Slot) -> bytes:
        start = slot.case.name, slot.nominal
        if start not in self._cases:
            pair = (slot.case, self._references[slot.case.name])
            self._cases[start] = pickle.dumps(pair, protocol=pickle.HIGHEST_PROTOCOL)
        return self._cases[start]

    def _judging(self, strategy: str) -> Limits:
        limits = self._limits[strategy]
        seconds = None if limits.seconds is None else max(_LEAST_JUDGING, limits.seconds)
        return replace(limits, seconds=seconds)


def _outcome_of(ending: Ending) -> JobOutcome:
    """Return how a strategy's process says that its job ended, or what ended the process."""
    if ending.how != "answer":
        status: Status = "timeout" if ending.how == "timeout" else "crashed"
        return JobOutcome(status, ending.reason, seconds=ending.seconds)
    try:
        return head_of(ending.answer)
    except AnswerError as error:
        return JobOutcome("failed", str(error), seconds=ending.seconds)
