"""One task in its process, seen from the parent: what it has sent, and how it ended."""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import connection
from typing import Any, Generic, Literal, TypeVar

from femubench.core.harness.limits import Limits, spoken_bytes
from femubench.core.harness.strays import alive, descendants_memory
from femubench.core.harness.worker import LENGTH_BYTES, READY

Key = TypeVar("Key")
How = Literal[
    "answer", "timeout", "memory", "output", "answer-size", "died", "no-start", "orphaned"
]
_START = 120.0  # s that a process may take until it is ready
_CHUNK = 2**20
_LOST = 255  # what multiprocessing returns where nobody is left to tell the exit code
_LAST_BREATH = 0.2  # s between the closed files of a process and its end
_BASE = 256 * 2**20  # bytes of a fresh worker, most of them shared with the server


@dataclass(frozen=True)
class Ending:
    """How a task ended.

    Arguments:
        how: ``answer`` when it handed back its bytes.
        answer: the bytes.
        reason: one line on any other end.
        seconds: wall time since the process was ready.
    """

    how: How
    answer: bytes = b""
    reason: str = ""
    seconds: float = 0.0


@dataclass
class Task(Generic[Key]):
    """A running task."""

    key: Key
    process: Any
    answer: connection.Connection
    output: connection.Connection
    limits: Limits
    scratch: str
    server: int | None = None
    started: float = field(default_factory=time.monotonic)
    ready: float | None = None
    received: bytearray = field(default_factory=bytearray)
    printed: int = 0

    @property
    def deadline(self) -> float | None:
        """Return when it is stopped, on the monotonic clock."""
        if self.ready is None:
            return self.started + _START
        return None if self.limits.seconds is None else self.ready + self.limits.seconds

    @property
    def complete(self) -> bool:
        """Tell whether the whole answer is there."""
        return len(self.received) >= LENGTH_BYTES and len(self.received) == self.length

    @property
    def length(self) -> int:
        """Return the length that the answer with its head is said to have."""
        return LENGTH_BYTES + int.from_bytes(self.received[:LENGTH_BYTES], "big")


def parts_of(task: Task[Key]) -> list[Any]:
    """Return what there is to wait for."""
    ends = [end for end in (task.answer, task.output) if not end.closed]
    return [task.process.sentinel, *ends]


def progress_of(task: Task[Key], *, look: bool) -> Ending | None:
    """Take what a task has sent; return how it ended, None while it goes on."""
    gone = bool(connection.wait([task.process.sentinel], 0.0))
    _take(task)
    limits, now = task.limits, time.monotonic()
    seconds = now - (task.ready or now)
    if task.complete:
        return Ending("answer", bytes(task.received[LENGTH_BYTES:]), seconds=seconds)
    if task.printed > limits.output:
        what = f"printed more than {spoken_bytes(limits.output)}"
        return Ending("output", reason=what, seconds=seconds)
    if len(task.received) >= LENGTH_BYTES and task.length > limits.answer:
        what = f"its result is larger than {spoken_bytes(limits.answer)}"
        return Ending("answer-size", reason=what, seconds=seconds)
    if gone and _orphaned(task):
        what = "the process from which all workers are started was ended"
        return Ending("orphaned", reason=what, seconds=seconds)
    if gone:
        how: How = "died" if task.ready is not None else "no-start"
        return Ending(how, reason=_death(task), seconds=seconds)
    if task.deadline is not None and now >= task.deadline:
        if task.ready is None:
            return Ending("no-start", reason=f"the worker process was not ready in {_START:g} s")
        limit = limits.seconds or 0.0
        return Ending("timeout", reason=f"no result within {limit:g} s", seconds=limit)
    if look and limits.memory is not None:
        used = descendants_memory(task.process.pid)
        if used > limits.memory + _BASE:
            what = f"used {spoken_bytes(used)} of memory, allowed {spoken_bytes(limits.memory)}"
            return Ending("memory", reason=what, seconds=seconds)
    return None


def _take(task: Task[Key]) -> None:
    for end in (task.output, task.answer):
        while not end.closed:
            try:
                data = os.read(end.fileno(), _CHUNK)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            if not data:
                end.close()
            elif end is task.output:
                task.printed += len(data)
                if task.printed > task.limits.output:
                    break
            elif _receive(task, data):
                break


def _receive(task: Task[Key], data: bytes) -> bool:
    """Take a part of the answer; tell whether there is no use in reading on."""
    if task.ready is None:
        task.ready = time.monotonic()
        data = data[len(READY) :]
    task.received += data
    return len(task.received) > task.limits.answer + LENGTH_BYTES


def _orphaned(task: Task[Key]) -> bool:
    """Tell whether a process ended because its server did, which ends all of them."""
    task.process.join()
    until = time.monotonic() + _LAST_BREATH
    while task.process.exitcode == _LOST and alive(task.server):
        if time.monotonic() > until:
            return False
        time.sleep(0.01)
    return bool(task.process.exitcode == _LOST)


def _death(task: Task[Key]) -> str:
    task.process.join()
    code = task.process.exitcode
    when = "" if task.ready is not None else " before it was ready"
    if code is None or code >= 0:
        return f"the worker process ended with exit code {code}{when}"
    with suppress(ValueError):
        return f"the worker process was ended by {signal.Signals(-code).name}{when}"
    return f"the worker process was ended by signal {-code}{when}"
