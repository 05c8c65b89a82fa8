"""Judges that live through a run: each judges one answer after the other in a process of its own.

An answer is plain data, so that nothing of it is left behind: a judge forks from the same server as
all workers, is told every case once, and is replaced when it dies, hangs or has grown.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import resource
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from multiprocessing import connection, get_context
from typing import Any, Generic

from femubench.core.run.judging import Dossier, run_judge
from femubench.core.run.limits import MIB, Limits
from femubench.core.run.worker import LENGTH_BYTES, address_space, stand_alone, write_all
from femubench.core.run.workers import Ending, Key, Task, end_group, forked, parts_of, progress_of

_MOST_CASES = 20  # that a judge holds
_CASE_BYTES = 128 * MIB  # of them together, pickled
_GROWTH = 192 * MIB  # of its memory, after which it is replaced
_AT_ONCE = 60_000  # bytes that a pipe takes at once
_GOES_ON, _IS_DONE = b"\0", b"\1"
_LAST_BREATH = 5.0  # s that a process may take to end
_LOOK = 0.5  # s between two looks at its memory
_PR_SET_DUMPABLE = 4


@dataclass(frozen=True)
class _Request:
    """What a judge is asked, all of it written by this program; the answer follows as it came.

    Arguments:
        case: digest of the case; `Dossier.case` is empty where the judge has it already.
        forget: digests of cases that are sent anew should they come up again.
        memory: bytes that judging may take; None for no limit.
    """

    case: bytes
    forget: tuple[bytes, ...]
    verdict: Dossier
    memory: int | None


def serve(
    requests: connection.Connection, answer: connection.Connection, output: connection.Connection
) -> None:
    """Judge until nobody asks; the body of a judge's process."""
    stand_alone(output, requests.fileno(), answer.fileno())
    if sys.platform == "linux":  # strategies run under the same account: its memory has the data
        ctypes.CDLL(None).prctl(_PR_SET_DUMPABLE, 0)
    cases: dict[bytes, Any] = {}
    first, grown = _peak(), False
    while not grown:
        try:
            request: _Request = pickle.loads(requests.recv_bytes())
            verdict = replace(request.verdict, answer=requests.recv_bytes())
        except EOFError:
            return
        for digest in request.forget:
            cases.pop(digest, None)
        with _memory(request.memory):
            if request.case not in cases:
                cases[request.case] = pickle.loads(verdict.case)
            data = run_judge(verdict, *cases[request.case])
        grown = _peak() - first > _GROWTH
        data = (_IS_DONE if grown else _GOES_ON) + data
        write_all(answer.fileno(), len(data).to_bytes(LENGTH_BYTES, "big") + data)
        del request, verdict, data


@contextmanager
def _memory(allowed: int | None) -> Iterator[None]:
    """Limit what the block may take beyond what the process has."""
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


def _peak() -> int:
    """Return the largest resident memory that this process has had so far in bytes."""
    found = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return found if sys.platform == "darwin" else 1024 * found


@dataclass
class _Judge:
    """A judge's process.

    Arguments:
        held: sizes of the cases that it has, by digest; what was used last comes last.
    """

    process: Any
    requests: connection.Connection
    answer: connection.Connection
    output: connection.Connection
    held: OrderedDict[bytes, int] = field(default_factory=OrderedDict)

    def ask(self, case: bytes, verdict: Dossier, memory: int | None) -> None:
        """Send an answer to be judged, the case too where it is not there yet."""
        answer, verdict = verdict.answer, replace(verdict, answer=b"")
        if case in self.held:
            verdict = replace(verdict, case=b"")
        self.held[case] = self.held.pop(case, len(verdict.case))
        forget = []
        while len(self.held) > 1 and (
            len(self.held) > _MOST_CASES or sum(self.held.values()) > _CASE_BYTES
        ):
            forget.append(self.held.popitem(last=False)[0])
        request = _Request(case, tuple(forget), verdict, memory)
        parts = pickle.dumps(request, protocol=pickle.HIGHEST_PROTOCOL), answer
        # With an end of its own, which stays open however long it takes.
        way = connection.Connection(os.dup(self.requests.fileno()), readable=False)
        if sum(map(len, parts)) <= _AT_ONCE:
            _send(way, parts)
        else:  # one that was stopped must not stop its parent
            threading.Thread(target=_send, args=(way, parts), daemon=True).start()

    def end(self) -> None:
        """End the process; what it is at is lost."""
        end_group(self.process.pid)
        for end in (self.requests, self.answer, self.output):
            with suppress(OSError):
                end.close()
        # The server tells of its end, and may have been stopped.
        self.process.join(_LAST_BREATH)
        with suppress(ValueError):
            self.process.close()


def _send(way: connection.Connection, parts: Sequence[bytes]) -> None:
    with way, suppress(OSError):  # it died: whoever waits for its answer learns of it
        for part in parts:
            way.send_bytes(part)


class Judges(Generic[Key]):
    """Judges answers, as many at a time as are asked for."""

    def __init__(self) -> None:
        self._idle: list[_Judge] = []
        self._at_work: list[tuple[Task[Key], _Judge]] = []
        self._looked = 0.0

    def __enter__(self) -> Judges[Key]:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    @contextmanager
    def at_hand(self) -> Iterator[None]:
        """Let no work go on after the block."""
        try:
            yield
        finally:
            for _, judge in self._at_work:
                judge.end()
            self._at_work = []

    def end(self) -> None:
        """End all judges."""
        for judge in (*self._idle, *(judge for _, judge in self._at_work)):
            judge.end()
        self._idle, self._at_work = [], []

    @property
    def busy(self) -> int:
        """Return how many are at work."""
        return len(self._at_work)

    @property
    def parts(self) -> list[Any]:
        """Return what there is to wait for."""
        return [part for task, _ in self._at_work for part in parts_of(task)]

    def start(self, key: Key, case: bytes, verdict: Dossier, limits: Limits) -> Ending | None:
        """Have an answer judged; return how it ended where no process could be started.

        Arguments:
            key: by which `ended` tells of it.
            case: digest of `verdict.case`.
            limits: what judging may take.
        """
        try:
            judge = self._free(case)
        except (OSError, EOFError) as error:
            return Ending("no-start", reason=f"no worker process could start: {error}")
        judge.ask(case, verdict, limits.memory)
        task = Task(key, judge.process, judge.answer, judge.output, limits, "")
        task.ready = time.monotonic()
        self._at_work.append((task, judge))
        return None

    def _free(self, case: bytes) -> _Judge:
        """Return a judge without work, of several one that has the case."""
        self._idle.sort(key=lambda judge: case in judge.held)
        while self._idle:
            judge = self._idle.pop()
            if judge.process.is_alive():
                return judge
            judge.end()
        context = get_context("forkserver")
        taken, requests = context.Pipe(duplex=False)
        answer, given = context.Pipe(duplex=False)
        output, printed = context.Pipe(duplex=False)
        try:
            process = forked(serve, taken, given, printed)
        except (OSError, EOFError):
            for end in (requests, answer, output):
                end.close()
            raise
        finally:
            for end in (taken, given, printed):
                end.close()
        for end in (answer, output):
            os.set_blocking(end.fileno(), False)
        return _Judge(process, requests, answer, output)

    def ended(self) -> list[tuple[Key, Ending]]:
        """Return what has been judged since, or could not be."""
        look = time.monotonic() - self._looked >= _LOOK
        if look:
            self._looked = time.monotonic()
        found = []
        for pair in tuple(self._at_work):
            task, judge = pair
            ending = progress_of(task, look=look)
            if ending is None:
                continue
            self._at_work.remove(pair)
            if ending.how == "answer" and ending.answer[:1] == _GOES_ON:
                self._idle.append(judge)
            else:
                judge.end()
            found.append((task.key, replace(ending, answer=ending.answer[1:])))
        return found
