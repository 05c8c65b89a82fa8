"""A child where no process can fork, as on Windows: a fresh interpreter, asked by its streams.

There is no sandbox, and a process cannot be limited: its parent watches time, memory, number of
processes and volume as it does everywhere, and ends what takes more.
"""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from typing import IO, NoReturn

import psutil

from femubench.core.child import confinement
from femubench.core.child.confinement import Confinement
from femubench.core.child.guarded_child import NEWS, GuardedChild, processes_of
from femubench.core.child.limits import FORKS
from femubench.core.child.server import LAST_BREATH, ONE_THREAD, WalledServer, search_path

_CODE = """
import sys
sys.path[:] = sys.argv[2:]
from femubench.core.child.spawned_child import answer_spawned
answer_spawned(sys.argv[1])
"""
_CHUNK, _CHUNKS = 2**16, 64  # bytes that are read at a time, and how often before they are taken
_FULL = 0.1  # s between two looks whether a reader that nobody listens to is to end
_LATE = 1.0  # s that what a process sent may come after its end
_HERE = 0  # in place of a descriptor that is open, with -1 for one that is closed


def start_child(how: Confinement, module: str, within: WalledServer | None = None) -> GuardedChild:
    """Start a child as this system can; see `GuardedChild.start`."""
    return (GuardedChild if FORKS else SpawnedChild).start(how, module, within)


@dataclass(eq=False)
class SpawnedChild(GuardedChild):
    """A child process that shares nothing with a server; a thread for each of its streams."""

    _process: subprocess.Popen[bytes] = field(kw_only=True)
    _ended: float | None = None  # when it was first seen to have ended

    def __post_init__(self) -> None:
        """Begin to listen."""
        self._to_write = queue.SimpleQueue[memoryview | None]()
        self._came = {name: queue.Queue[bytes](_CHUNKS) for name in ("answers", "output")}
        process = self._process
        streams = zip(self._came, (process.stdout, process.stderr), strict=True)
        self._readers = [_begin(self._listen, name, stream) for name, stream in streams]
        _begin(self._write, process.stdin)

    @classmethod
    def start(
        cls, confinement: Confinement, module: str, within: WalledServer | None = None
    ) -> GuardedChild:
        """Start a child; `within` is None, for there are no walls."""
        flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
        process = subprocess.Popen(
            [sys.executable, *flags, "-c", _CODE, module, *search_path()],
            env={**os.environ, **ONE_THREAD},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            # Else Ctrl-C in a console would go to it too.
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        ends = (_HERE,) * 4
        child = cls(process.pid, *ends, confinement, confinement.limits, _process=process)
        child._send(confinement)
        return child

    def _listen(self, name: str, stream: IO[bytes]) -> None:
        """Take what comes through a stream until its end; the body of a thread."""
        data = b"begun"
        while data:
            try:
                data = os.read(stream.fileno(), _CHUNK)
            except OSError:  # as a pipe ends, too
                data = b""
            while getattr(self, name) == _HERE:
                with suppress(queue.Full):
                    self._came[name].put(data, timeout=_FULL)
                    break
            NEWS.set()
        stream.close()

    def _write(self, stream: IO[bytes]) -> None:
        """Write what is to be sent until there is no more; the body of a thread."""
        with suppress(OSError), stream:  # it died, as its exit code will tell
            while (part := self._to_write.get()) is not None:
                stream.write(part)
                stream.flush()

    def _push(self) -> None:
        """Hand on what is to be sent."""
        for part in self._unsent:
            self._to_write.put(part)
        self._unsent.clear()

    def _read(self, name: str) -> bytes:
        came, parts = self._came[name], []
        with suppress(queue.Empty):
            while part := came.get_nowait():
                parts.append(part)
            if not parts:
                return b""
            came.put(part)  # the end, for the next time
        if not parts:
            raise BlockingIOError
        return b"".join(parts)

    def _look(self) -> None:
        """Learn whether it has ended, and all has come that it sent."""
        if self.status < 0 or (code := self._process.poll()) is None:
            return
        self._ended = self._ended or time.monotonic()
        # What it started may hold its streams open.
        if time.monotonic() > self._ended + _LATE or not any(r.is_alive() for r in self._readers):
            self.code, self.status = code, -1

    def _end(self) -> None:
        for process in reversed(processes_of(self.pid)):
            with suppress(psutil.Error):
                process.kill()

    def bury(self) -> None:
        """Wait until nothing is left of a child that was ended."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(LAST_BREATH)
        self._close("status")

    def _close(self, *names: str) -> None:
        for name in names:
            setattr(self, name, -1)
        if "requests" in names:
            self._to_write.put(None)


def answer_spawned(module: str) -> NoReturn:
    """Be a child that loads a module first: answer requests, and end."""
    requests, answers = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)  # what is printed comes by one stream
    with suppress(Exception):  # a child that needs it says what is wrong with it
        import_module(module)
    confinement.answer_all(requests, answers, end_with_stream)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def end_with_stream(requests: int) -> None:
    """Let this process end when its parent, who asks nothing more, ends or ceases to listen."""
    _begin(lambda: os._exit(len(os.read(requests, 1))))


def _begin(function: Callable[..., None], *words: object) -> threading.Thread:
    thread = threading.Thread(target=function, args=words, daemon=True)
    thread.start()
    return thread
