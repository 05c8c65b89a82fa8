"""Jobs through the workers: run in one process, judged in another."""

from __future__ import annotations

import json
import pickle
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from femubench.core.case.case import Case
from femubench.core.harness.answers import AnswerError, head_of
from femubench.core.harness.jobs import JobOutcome
from femubench.core.harness.judging import Verdict, judged, run_judge, run_strategy
from femubench.core.harness.limits import Limits
from femubench.core.harness.results import JobResult, Status
from femubench.core.harness.scoring import Reference
from femubench.core.harness.serial import result_from_json
from femubench.core.harness.slots import Slot
from femubench.core.harness.task import Ending, How
from femubench.core.harness.workers import Workers

_STATUS: Mapping[How, Status] = {
    "timeout": "timeout",
    "memory": "crashed",
    "output": "crashed",
    "answer-size": "crashed",
    "died": "crashed",
    "no-start": "crashed",
}
_LEAST_JUDGING = 300.0  # s
_ATTEMPTS = 3  # to start a process


def computed(
    slots: Sequence[Slot],
    wanted: Sequence[int],
    references: Mapping[str, Reference],
    limits: Mapping[str, Limits],
    count: int,
) -> Iterator[tuple[int, JobResult]]:
    """Yield the result of every wanted slot as it comes."""

    def result_of(index: int, outcome: JobOutcome) -> tuple[int, JobResult]:
        slot = slots[index]
        reference = references[slot.case.name]
        return index, judged(slot.case, reference, slot.strategy, slot.seed, outcome)

    for index in wanted:
        fault = slots[index].fault
        if fault is not None:
            yield result_of(index, fault)
    waiting = deque(index for index in wanted if slots[index].job is not None)
    if not waiting:
        return
    bench = _Bench(slots, references, limits)
    with Workers[tuple[int, bytes]](count).open() as workers:
        while waiting or bench.answers or workers.busy:
            while workers.free and (waiting or bench.answers):
                lost = bench.start(workers, waiting)
                if lost is not None:
                    yield result_of(*lost)
            for (index, answer), ending in workers.wait():
                found = bench.taken(index, answer, ending, waiting)
                if isinstance(found, JobResult):
                    yield index, found
                elif found is not None:
                    yield result_of(index, found)


class _Bench:
    """What happens to a job: run in one process, judged in another."""

    def __init__(
        self,
        slots: Sequence[Slot],
        references: Mapping[str, Reference],
        limits: Mapping[str, Limits],
    ) -> None:
        self._slots, self._references, self._limits = slots, references, limits
        self._cases: dict[str, bytes] = {}
        self._attempts: dict[int, int] = {}
        self.answers: deque[tuple[int, bytes]] = deque()

    def start(
        self, workers: Workers[tuple[int, bytes]], waiting: deque[int]
    ) -> tuple[int, JobOutcome] | None:
        """Start judging an answer or running a job; return a job that cannot be started."""
        if self.answers:
            index, answer = self.answers.popleft()
            slot = self._slots[index]
            verdict = Verdict(self._case(slot.case), answer, slot.strategy, slot.seed)
            ending = workers.start(
                (index, answer), run_judge, verdict, self._judging(slot.strategy)
            )
        else:
            index = waiting.popleft()
            slot = self._slots[index]
            ending = workers.start(
                (index, b""), run_strategy, slot.job, self._limits[slot.strategy]
            )
        return None if ending is None else (index, JobOutcome("crashed", ending.reason))

    def taken(
        self, index: int, answer: bytes, ending: Ending, waiting: deque[int]
    ) -> JobResult | JobOutcome | None:
        """Return the result of a task that has ended, or its outcome; None while it goes on."""
        if answer:
            return self._judgement(ending)
        if ending.how == "answer":
            try:
                outcome = head_of(ending.answer)
            except AnswerError as error:
                return JobOutcome("failed", str(error), seconds=ending.seconds)
            if outcome.status != "ok":
                return outcome
            self.answers.append((index, ending.answer))
            return None
        self._attempts[index] = self._attempts.get(index, 0) + 1
        if ending.how == "no-start" and self._attempts[index] < _ATTEMPTS:
            waiting.append(index)
            return None
        return JobOutcome(_STATUS[ending.how], ending.reason, seconds=ending.seconds)

    @staticmethod
    def _judgement(ending: Ending) -> JobResult | JobOutcome:
        if ending.how != "answer":
            return JobOutcome("failed", f"its model could not be judged: {ending.reason}")
        return result_from_json(json.loads(ending.answer))

    def _case(self, case: Case) -> bytes:
        if case.name not in self._cases:
            pair = (case, self._references[case.name])
            self._cases[case.name] = pickle.dumps(pair, protocol=pickle.HIGHEST_PROTOCOL)
        return self._cases[case.name]

    def _judging(self, strategy: str) -> Limits:
        limits = self._limits[strategy]
        seconds = None if limits.seconds is None else max(_LEAST_JUDGING, limits.seconds)
        return replace(limits, seconds=seconds)
