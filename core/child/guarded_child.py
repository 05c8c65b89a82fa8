"""A child process in its limits, seen from its parent: started, asked, watched, ended."""

from __future__ import annotations

import ctypes
import errno
import math
import os
import select
import signal
import socket
import stat
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal

import psutil

from femubench.core.child.confinement import LENGTH_BYTES, READY, Confinement, object_frames
from femubench.core.child.control_group import put_in_group, was_full
from femubench.core.child.limits import FORKS, Limits, format_bytes
from femubench.core.child.namespaces import FOLDER, libc
from femubench.core.child.server import LAST_BREATH, NUMBER, WalledServer, end_group, fork_server

How = Literal[
    "answer", "timeout", "memory", "output", "answer-size", "died", "no-start", "orphaned"
]
_START = 120.0  # s that a process may take until it is ready
_CHUNK = 2**20
_CHUNKS = 16  # that are read before anybody looks at the clock again
_LONGEST = 500  # bytes of what a child says that does not get ready
_TICK = 0.5  # s between two looks at a server that may have been stopped
_PIDFD_GETFD = 438
_SO_MEMINFO, _FIGURES = 55, 9  # of SK_MEMINFO
_BUFFERS = "ipv4/tcp_rmem", "ipv4/tcp_wmem", "core/rmem_max", "core/wmem_max"
NEWS = threading.Event()  # something has come of a child that did not fork
_BASE = 256 * 2**20  # bytes of a fresh child, most of them shared with the server


@dataclass(frozen=True)
class Ending:
    """How a request to a child ended.

    Arguments:
        how: ``answer`` when it handed back its bytes.
        seconds: wall time since the process was ready.
    """

    how: How
    answer: bytes = b""
    reason: str = ""
    seconds: float = 0.0


@dataclass(eq=False)
class GuardedChild:
    """A child process.

    Arguments:
        requests, answers, output, status: our ends of its pipes.
        first: number of the first process of its namespace of processes, 0 where it has none.
    """

    pid: int
    requests: int
    answers: int
    output: int
    status: int
    confinement: Confinement
    limits: Limits
    first: int = 0
    code: int | None = None
    _started: float = field(default_factory=time.monotonic)
    _asked: float = 0.0
    _ready: float | None = None
    _killed: float = math.inf
    _received: bytearray = field(default_factory=bytearray)
    _printed: int = 0
    _said: bytes = b""
    _unsent: list[memoryview] = field(default_factory=list)
    _group: Path | None = None

    @classmethod
    def start(
        cls, confinement: Confinement, module: str, within: WalledServer | None = None
    ) -> GuardedChild:
        """Start a child.

        Arguments:
            module: of ours, which the fork server loads first.
            within: from which it forks; None for the fork server itself. One that fails is ended.

        Raises:
            OSError: when there is none to be had.
        """
        ours, theirs = list[int](), list[int]()
        with ExitStack() as kept, ExitStack() as given:
            for order in (1, -1, -1, -1):  # requests are read there, all else here
                its, mine = os.pipe()[::order]
                given.callback(os.close, its)
                kept.callback(os.close, mine)
                theirs.append(its)
                ours.append(mine)
            server = within or fork_server()
            try:
                server.ask(module, theirs)
                given.close()
                pid, first = _numbers(ours[-1])
            except OSError:
                server.end()
                raise
            for end in ours:
                os.set_blocking(end, False)
            limits = confinement.limits
            child = cls(pid, ours[0], ours[1], ours[2], ours[3], confinement, limits, first)
            child._send(confinement)
            kept.pop_all()  # else the child, where there is one, ends for want of a request
        return child

    def ask(self, function: Callable[[Any], bytes], argument: object, limits: Limits) -> None:
        """Have a function called there; `progress` tells of its answer.

        Arguments:
            function: importable by name.
            limits: until the answer is there.
        """
        self.limits, self._asked = limits, time.monotonic()
        self._received, self._printed = bytearray(), 0
        self._group = put_in_group(self.pid, limits.memory and limits.memory + _BASE)
        self._send((function, argument))

    def _send(self, what: object) -> None:
        self._unsent += map(memoryview, object_frames(what))
        self._push()

    def _push(self) -> None:
        """Send on what the child takes now: one that was stopped must not stop its parent."""
        try:
            while self._unsent:
                view = self._unsent[0]
                sent = os.write(self.requests, view[:_CHUNK]) if view else 0
                self._unsent[0] = view[sent:]
                if not self._unsent[0]:
                    del self._unsent[0]
        except BlockingIOError:
            return
        except OSError:  # it died, as its status will tell
            self._unsent.clear()

    @property
    def deadline(self) -> float | None:
        """Return when it is stopped, on the monotonic clock."""
        if self._ready is None:
            return self._started + _START
        return None if self.limits.seconds is None else self._begun + self.limits.seconds

    @property
    def _begun(self) -> float:
        return max(self._asked, self._ready or self._asked)

    @property
    def _length(self) -> int:
        """Return the length that the answer with its head is said to have; 0 before that."""
        head = self._received[:LENGTH_BYTES]
        return LENGTH_BYTES + int.from_bytes(head, "big") if len(head) == LENGTH_BYTES else 0

    @property
    def alive(self) -> bool:
        """Tell whether it has not ended yet."""
        self._look()
        return self.code is None and self.status >= 0

    @property
    def gone(self) -> bool:
        """Tell whether nothing of it is left, nor of what it started, or there was time to end."""
        self._look()
        # What starts others faster than they end is never gone; the server goes on to end it.
        if time.monotonic() > self._killed + LAST_BREATH:
            self._close("status")
        if self.status < 0 and self._group is not None:
            with suppress(OSError):
                self._group.rmdir()
        return self.status < 0

    def progress(self, *, look: bool) -> Ending | None:
        """Take what it has sent; return how the request ended, None while it goes on.

        Arguments:
            look: whether memory and number of its processes are looked at too.
        """
        ended = not self.alive
        self._push()
        for name in ("output", "answers"):
            self._take(name)
        limits, now = self.limits, time.monotonic()
        end = partial(Ending, seconds=now - self._begun if self._ready else 0.0)
        if 0 < self._length <= min(len(self._received), limits.answer + LENGTH_BYTES):
            return end("answer", bytes(self._received[LENGTH_BYTES : self._length]))
        if self._printed > limits.output:
            return end("output", reason=f"printed more than {format_bytes(limits.output)}")
        if self._length > limits.answer + LENGTH_BYTES:
            what = f"its result is larger than {format_bytes(limits.answer)}"
            return end("answer-size", reason=what)
        if ended and self.code is None:
            what = "the process from which all workers are started was ended"
            return end("orphaned", reason=what)
        if ended and self._group is not None and was_full(self._group):
            what = f"used more memory than allowed, {format_bytes(limits.memory or 0)}"
            return end("memory", reason=what)
        if ended:
            return end("no-start" if self._ready is None else "died", reason=self._death())
        if self.deadline is not None and now >= self.deadline:
            if self._ready is None:
                return end("no-start", reason=f"the worker process was not ready in {_START:g} s")
            limit = limits.seconds or 0.0
            return Ending("timeout", reason=f"no result within {limit:g} s", seconds=limit)
        excess = self._excess() if look else None
        return None if excess is None else end("memory", reason=excess)

    def _take(self, name: str) -> None:
        """Take what has come through a pipe, but not much more than is allowed."""
        for _ in range(_CHUNKS):
            try:
                data = self._read(name)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if not data:
                self._close(name)
                return
            if name == "output":
                if self._ready is None:
                    self._said = (self._said + data)[-_LONGEST:]
                self._printed += len(data)
                if self._printed > self.limits.output:
                    return
                continue
            if self._ready is None:
                self._ready, data = time.monotonic(), data[len(READY) :]
            self._received += data
            if len(self._received) > self.limits.answer + LENGTH_BYTES:
                return

    def _read(self, name: str) -> bytes:
        """Return what has come through a pipe; BlockingIOError for nothing so far."""
        return os.read(getattr(self, name), _CHUNK)

    def _look(self) -> None:
        """Learn whether it has ended, and what it started too."""
        while self.status >= 0:
            try:
                data = os.read(self.status, NUMBER)
            except BlockingIOError:
                return
            if data:
                self.code = int.from_bytes(data, "big", signed=True)
            else:
                self._close("status")

    def _death(self) -> str:
        when = ""
        if self._ready is None:
            why = self._said.decode(errors="replace").strip().rpartition("\n")[2]
            when = " before it was ready" + f": {why}" * bool(why)
        assert self.code is not None
        if self.code >= 0:
            return f"the worker process ended with exit code {self.code}{when}"
        with suppress(ValueError):
            return f"the worker process was ended by {signal.Signals(-self.code).name}{when}"
        return f"the worker process was ended by signal {-self.code}{when}"

    def _excess(self) -> str | None:
        """Return of what it has more than it may, None where it keeps its limits."""
        limits, walled = self.limits, self.confinement.walled
        processes = processes_of(self.pid, self.first)
        if len(processes) > limits.processes:
            return f"has {len(processes)} processes, allowed {limits.processes}"
        if limits.memory is not None and self._group is None:
            used = memory_of(processes, f"/proc/{self.pid}/root" if walled else None)
            if used > limits.memory + _BASE:
                return f"used {format_bytes(used)} of memory, allowed {format_bytes(limits.memory)}"
        return None

    def kill(self) -> None:
        """End the process and its group; what they are at is lost."""
        self._killed = min(self._killed, time.monotonic())
        if self.alive:
            self._end()
        self._close("requests", "answers", "output")

    def _end(self) -> None:
        end_group(self.pid)

    def bury(self) -> None:
        """Wait until nothing is left of a child that was ended."""
        while not self.gone:
            if not select.select([self.status], [], [], _TICK)[0]:
                fork_server().wake()

    def _close(self, *names: str) -> None:
        for name in names:
            end = getattr(self, name)
            setattr(self, name, -1)
            if end >= 0:
                os.close(end)

    def watch(self, poll: select.poll) -> None:
        """Have a poll tell when there is something for `progress` to do."""
        for end in (self.status, self.answers, self.output):
            if end >= 0:
                poll.register(end, select.POLLIN)
        if self._unsent:
            poll.register(self.requests, select.POLLOUT)


def wait_for(children: Iterable[GuardedChild], seconds: float) -> None:
    """Wait until there is something to do for one of some children, some seconds at most."""
    children, now = list(children), time.monotonic()
    deadlines = [child.deadline for child in children]
    seconds = max(min([seconds, *(d - now for d in deadlines if d is not None)]), 0.0)
    if not FORKS:
        NEWS.wait(seconds)
        NEWS.clear()
        return
    poll = select.poll()
    for child in children:
        child.watch(poll)
    poll.poll(1000.0 * seconds)


def _numbers(status: int) -> tuple[int, int]:
    """Wait for the numbers of a child that was asked for and of the first of its namespace."""
    until = time.monotonic() + _START
    while not select.select([status], [], [], _TICK)[0]:
        if time.monotonic() > until:
            raise TimeoutError("the process from which all workers are started does not answer")
        fork_server().wake()
    data = os.read(status, 2 * NUMBER)
    if not data:
        raise BrokenPipeError("the process from which all workers are started was ended")
    return int.from_bytes(data[:NUMBER], "big"), int.from_bytes(data[NUMBER:], "big")


def processes_of(*leaders: int) -> list[psutil.Process]:
    """Return processes by their numbers, and all below them; a number may be 0 for none."""
    found = list[psutil.Process]()
    for leader in filter(None, leaders):
        with suppress(psutil.Error):
            top = psutil.Process(leader)
            found += [top, *top.children(recursive=True)]
    return found


def memory_of(processes: Iterable[psutil.Process], root: str | None) -> int:
    """Return the bytes that processes hold: theirs, and those of files, pipes and sockets.

    Arguments:
        root: of their sandbox, whose temporary folder is in memory, and in whose network there is
            no socket but theirs; None for none.
    """
    total, sockets, before = 0, 0, 0
    seen = set[tuple[int, int]]()
    walled = False
    if root is not None:
        with suppress(OSError):  # it may have ended
            # As a worker starts its root is still that of this process.
            walled = not os.path.samefile(root, "/")
            before = _count_sockets(root) if walled else 0
    for process in processes:
        with suppress(psutil.Error, OSError):
            total += _resident(process)
            for is_socket, held in _held_open(process.pid, seen) if sys.platform == "linux" else ():
                total, sockets = total + held, sockets + is_socket
    if walled:
        # Sockets that wait in others, or to be accepted, are in no list of open files.
        waiting = min(before, _count_sockets(str(root))) - sockets
        total += max(0, waiting) * _largest_socket()
        with suppress(OSError):
            folder = os.statvfs(f"{root}{FOLDER}")
            total += (folder.f_blocks - folder.f_bfree) * folder.f_frsize
    return total


def _resident(process: psutil.Process) -> int:
    """Return the bytes of a process in memory; on Linux without pages of files, which it shares."""
    if sys.platform != "linux":
        return int(process.memory_info().rss)
    with open(f"/proc/{process.pid}/status", "rb") as lines:
        known = [line.split() for line in lines if line.startswith((b"RssAnon", b"RssShmem"))]
    return sum(1024 * int(words[1]) for words in known)


def _held_open(process: int, seen: set[tuple[int, int]]) -> Iterator[tuple[bool, int]]:
    """Yield of its open files that count in no process whether it is a socket, and the bytes held.

    Arguments:
        seen: files that were counted; takes those that are.
    """
    import fcntl  # which Windows lacks

    # A thread may have a table of open files of its own.
    for task in sorted(map(int, os.listdir(f"/proc/{process}/task")), key=process.__ne__):
        for name in os.listdir(f"/proc/{process}/task/{task}/fd"):
            with suppress(OSError):
                path = f"/proc/{process}/task/{task}/fd/{name}"
                found = os.stat(path)
                if (found.st_dev, found.st_ino) in seen:
                    continue
                seen.add((found.st_dev, found.st_ino))
                if stat.S_ISSOCK(found.st_mode):
                    yield True, _held_in_socket(task, int(name))
                elif stat.S_ISFIFO(found.st_mode):
                    with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb", 0) as pipe:
                        yield False, fcntl.fcntl(pipe, fcntl.F_GETPIPE_SZ)
                elif os.readlink(path).startswith(("/memfd:", "/dev/shm/")):
                    yield False, 512 * found.st_blocks


def _held_in_socket(task: int, number: int) -> int:
    """Return the bytes of a socket of another process, the most where nobody may look."""
    try:
        with os.fdopen(os.pidfd_open(task), "rb", 0) as opened:
            copy = libc().syscall(_PIDFD_GETFD, opened.fileno(), number, 0)
        if copy < 0:
            if ctypes.get_errno() in (errno.EBADF, errno.ESRCH):  # closed, or ended, since
                return 0
            return _largest_socket()
        with socket.socket(fileno=copy) as known:
            figures = known.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 4 * _FIGURES)
    except OSError:
        return _largest_socket()
    received, _, sent, _, _, queued, options, backlog, _ = struct.unpack(f"{_FIGURES}I", figures)
    return int(received + sent + queued + options + backlog)


@cache
def _largest_socket() -> int:
    """Return the bytes that a socket can hold at most: what TCP lets grow, or anybody may ask."""
    sizes = [0, 0, 0, 0]
    for place, name in enumerate(_BUFFERS):
        with suppress(OSError), open(f"/proc/sys/net/{name}", "rb") as stream:
            sizes[place] = int(stream.read().split()[-1])
    return max(sum(sizes[:2]), 2 * sum(sizes[2:]))


def _count_sockets(root: str) -> int:
    """Return the number of sockets in the network of a sandbox; 0 where it has ended."""
    with suppress(OSError), open(f"{os.path.dirname(root)}/net/sockstat", "rb") as lines:
        return int(lines.readline().split()[-1])
    return 0
