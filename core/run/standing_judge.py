"""Judges that live through a run: each judges one answer after the other in a process of its own.

An answer is plain data, so that nothing of it is left behind: a judge forks from the same server as
all workers, is sent every case once, and is replaced when it dies, hangs or has grown.
"""

from __future__ import annotations

import pickle
import sys
import time
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, Generic, cast

from femubench.core.child.confinement import Confinement, address_space
from femubench.core.child.guarded_child import Ending, GuardedChild
from femubench.core.child.limits import FORKS, MIB, Limits
from femubench.core.child.server import search_path
from femubench.core.child.spawned_child import start_child
from femubench.core.child.workers import JOBS, Key
from femubench.core.run.judging import Dossier, run_judge

_MOST_CASES = 20  # that a judge holds
_CASE_BYTES = 128 * MIB  # of them together, pickled
_GROWTH = 192 * MIB  # of its memory, after which it is replaced
_GOES_ON, _IS_DONE = b"\0", b"\1"
_LOOK = 0.5  # s between two looks at its memory


@dataclass(frozen=True)
class _Request:
    """What a judge is asked, all of it written by this program but the answer in it.

    Arguments:
        case: digest of the case; `Dossier.case` is empty where the judge has it already.
        forget: digests of cases that are sent anew should they come up again.
        memory: bytes that judging may take; None for no limit.
    """

    case: bytes
    forget: tuple[bytes, ...]
    verdict: Dossier
    memory: int | None


def judge_next(request: _Request) -> bytes:
    """Judge an answer, and say first whether the process is good for another; runs in a judge."""
    first, cases = _first_peak(), _cases()
    for digest in request.forget:
        cases.pop(digest, None)
    with _limit_memory(request.memory):
        if request.case not in cases:
            cases[request.case] = pickle.loads(request.verdict.case)
        data = run_judge(request.verdict, *cases[request.case])
    return (_IS_DONE if _peak() - first > _GROWTH else _GOES_ON) + data


@cache
def _cases() -> dict[bytes, Any]:
    """Return the cases that this judge has, by digest."""
    return {}


@cache
def _first_peak() -> int:
    return _peak()


def _peak() -> int:
    """Return the largest resident memory that this process has had so far in bytes."""
    if not FORKS:
        import psutil

        return int(getattr(psutil.Process().memory_info(), "peak_wset", 0))  # of Windows
    import resource

    found = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return found if sys.platform == "darwin" else 1024 * found


@contextmanager
def _limit_memory(allowed: int | None) -> Iterator[None]:
    """Limit what the block may take beyond what the process has."""
    if not FORKS:  # the parent looks at it
        yield
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    if allowed is not None:
        most = address_space() + allowed
        if before[1] != resource.RLIM_INFINITY:
            most = min(most, before[1])
        resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


@dataclass(eq=False)
class _Judge:
    """A judge's process.

    Arguments:
        held: sizes of the cases that it has, by digest; what was used last comes last.
    """

    process: GuardedChild
    held: OrderedDict[bytes, int] = field(default_factory=OrderedDict)

    def ask(self, case: bytes, verdict: Dossier, limits: Limits) -> None:
        """Send an answer to be judged, the case too where it is not there yet."""
        sent = replace(verdict, answer=cast(bytes, pickle.PickleBuffer(verdict.answer)))
        if case in self.held:
            sent = replace(sent, case=b"")
        self.held[case] = self.held.pop(case, len(verdict.case))
        forget = []
        while len(self.held) > 1 and (
            len(self.held) > _MOST_CASES or sum(self.held.values()) > _CASE_BYTES
        ):
            forget.append(self.held.popitem(last=False)[0])
        request = _Request(case, tuple(forget), sent, limits.memory)
        self.process.ask(judge_next, request, limits)

    def end(self) -> None:
        """End the process; what it is at is lost."""
        self.process.kill()
        self.process.bury()


class Judges(Generic[Key]):
    """Judges answers, as many at a time as are asked for."""

    def __init__(self) -> None:
        self._idle: list[_Judge] = []
        self._at_work: list[tuple[Key, _Judge]] = []
        self._looked = 0.0

    def __enter__(self) -> Judges[Key]:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def stop(self) -> None:
        """End those that are at work."""
        for _, judge in self._at_work:
            judge.end()
        self._at_work = []

    def end(self) -> None:
        """End all judges."""
        self.stop()
        while self._idle:
            self._idle.pop().end()

    @property
    def busy(self) -> int:
        """Return how many are at work."""
        return len(self._at_work)

    @property
    def at_work(self) -> list[GuardedChild]:
        """Return the processes of those that are at work."""
        return [judge.process for _, judge in self._at_work]

    def start(self, key: Key, case: bytes, verdict: Dossier, limits: Limits) -> Ending | None:
        """Have an answer judged; return how it ended where no process could be started.

        Arguments:
            key: by which `ended` names it.
            case: digest of `verdict.case`.
        """
        try:
            judge = self._free(case)
        except OSError as error:
            return Ending("no-start", reason=f"no worker process could start: {error}")
        self._at_work.append((key, judge))
        judge.ask(case, verdict, limits)
        return None

    def _free(self, case: bytes) -> _Judge:
        """Return a judge without work, of several one that has the case."""
        self._idle.sort(key=lambda judge: case in judge.held)
        while self._idle:
            judge = self._idle.pop()
            if judge.process.alive:
                return judge
            judge.end()
        how = Confinement(Limits(None), search_path(), own=False, once=False, secret=True)
        return _Judge(start_child(how, JOBS))

    def take_ended(self) -> list[tuple[Key, Ending]]:
        """Return what has been judged since, or could not be."""
        look = time.monotonic() - self._looked >= _LOOK
        if look:
            self._looked = time.monotonic()
        found = []
        for key, judge in tuple(self._at_work):
            ending = judge.process.progress(look=look)
            if ending is None:
                continue
            self._at_work.remove((key, judge))
            if ending.how == "answer" and ending.answer[:1] == _GOES_ON:
                self._idle.append(judge)
            else:
                judge.end()
            found.append((key, replace(ending, answer=ending.answer[1:])))
        return found
