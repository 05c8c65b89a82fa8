"""Every task in a fresh process of its own, stopped when it takes more than its limits.

Workers fork from a server that has the libraries loaded and nothing else: no case, no strategy, and
nothing of what an earlier job did to its process.
"""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import connection, forkserver, get_context, resource_tracker
from pathlib import Path
from typing import Any, Generic

import psutil

from femubench.core.harness.limits import Limits
from femubench.core.harness.strays import (
    MARK,
    adopting,
    alive,
    end_group,
    end_strays,
)
from femubench.core.harness.task import Ending, Key, Task, parts_of, progress_of
from femubench.core.harness.worker import (
    environment,
    scratch_root,
    serve,
)

_TICK = 0.5  # s between two looks at the memory of a worker


class Workers(Generic[Key]):
    """Runs tasks, at most `count` at a time.

    Arguments:
        count: number of processes.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._running: list[Task[Key]] = []
        self._dying: list[Task[Key]] = []
        self._mark = ""
        self._root = Path()
        self._looked = 0.0

    @property
    def free(self) -> bool:
        """Tell whether another task can start."""
        return len(self._running) < self.count

    @property
    def busy(self) -> bool:
        """Tell whether a task is running."""
        return bool(self._running)

    @contextmanager
    def open(self) -> Iterator[Workers[Key]]:
        """Start what the workers need, and leave no process and no file behind."""
        self._root = scratch_root()
        self._mark = _server_mark()
        with adopting():
            try:
                yield self
            finally:
                while self._running:
                    self._close(self._running[-1])
                self._bury(wait=True)
                end_strays(self._mark, self._root, _ours())
                shutil.rmtree(self._root, ignore_errors=True)

    def start(
        self, key: Key, function: Callable[[Any], bytes], argument: object, limits: Limits
    ) -> Ending | None:
        """Start a task; return how it ended where no process could be started.

        Arguments:
            key: by which `wait` tells of it.
            function: importable by name.
            argument: its argument; pickled.
            limits: what it may take.
        """
        context = get_context("forkserver")
        scratch = tempfile.mkdtemp(dir=self._root)
        answer, send = context.Pipe(duplex=False)
        output, printed = context.Pipe(duplex=False)
        arguments = (function, argument, send, printed, limits, scratch)
        process = context.Process(target=serve, args=arguments)
        try:
            _server_mark()  # a job may have ended the server,
            _wake_server()  # or stopped it
            process.start()
        except (OSError, EOFError) as error:
            for end in (answer, output):
                end.close()
            return Ending("no-start", reason=f"no worker process could start: {error}")
        finally:
            send.close()
            printed.close()
        for end in (answer, output):
            os.set_blocking(end.fileno(), False)
        self._running.append(Task(key, process, answer, output, limits, scratch, _server()))
        return None

    def wait(self) -> list[tuple[Key, Ending]]:
        """Wait until some task has ended, and return those that have; none after a short while."""
        now = time.monotonic()
        until = [task.deadline for task in self._running]
        known = [moment - now for moment in until if moment is not None]
        pause = max(min([_TICK, *known]), 0.0)
        connection.wait([part for task in self._running for part in parts_of(task)], pause)
        look = time.monotonic() - self._looked >= _TICK
        if look:
            self._looked = time.monotonic()
            _wake_server()
        ended = []
        for task in tuple(self._running):
            ending = progress_of(task, look=look)
            if ending is not None:
                self._close(task)
                ended.append((task.key, ending))
        self._bury(wait=False)
        if look:
            end_strays(self._mark, self._root, _ours())
        return ended

    def _close(self, task: Task[Key]) -> None:
        self._running.remove(task)
        end_group(task.process.pid)
        for end in (task.answer, task.output):
            with suppress(OSError):
                end.close()
        self._dying.append(task)

    def _bury(self, *, wait: bool) -> None:
        """Remove what is left of processes that were ended; ending takes its time."""
        for task in tuple(self._dying):
            if wait:
                task.process.join()
            if task.process.exitcode is not None:
                self._dying.remove(task)
                task.process.close()
                shutil.rmtree(task.scratch, ignore_errors=True)


def _server_mark() -> str:
    """Start the server from which workers fork where there is none; return its mark."""
    global _mark
    _mark = _mark or secrets.token_hex(8)
    if not alive(_server()):
        get_context("forkserver").set_forkserver_preload(["femubench.core.harness.preload"])
        with environment(**{MARK: _mark}):
            forkserver.ensure_running()
    return _mark


_mark = ""


def _wake_server() -> None:
    """Let the server go on where a job has stopped it."""
    server = _server()
    with suppress(psutil.Error, ProcessLookupError):
        if server is not None and psutil.Process(server).status() == psutil.STATUS_STOPPED:
            os.kill(server, signal.SIGCONT)


def _server() -> int | None:
    """Return the process from which workers fork."""
    server: int | None = getattr(forkserver._forkserver, "_forkserver_pid", None)
    return server


def _ours() -> frozenset[int]:
    """Return the processes of multiprocessing itself."""
    tracker = getattr(resource_tracker._resource_tracker, "_pid", None)
    return frozenset(pid for pid in (_server(), tracker) if pid is not None)
