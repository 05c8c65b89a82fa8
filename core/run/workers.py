"""Every task in a fresh process of its own, stopped when it takes more than its limits.

Workers fork from a server that has the libraries loaded and nothing else: no case, no strategy, and
nothing of what an earlier job did to its process.
"""

from __future__ import annotations

import ctypes
import multiprocessing.process
import os
import secrets
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import connection, forkserver, get_context, resource_tracker
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import ModuleType
from typing import Any, Generic, Literal, TypeVar

import psutil

from femubench.core.run.limits import Limits, spoken_bytes
from femubench.core.run.namespaces import FOLDER, Walls
from femubench.core.run.provenance import source_digest
from femubench.core.run.sandbox import enclosure, walls_around
from femubench.core.run.worker import LENGTH_BYTES, READY, environment, scratch_root, serve

MARK = "FEMUBENCH_WORKERS"
_PR_SET_CHILD_SUBREAPER, _PR_GET_CHILD_SUBREAPER = 36, 37


@contextmanager
def adopting() -> Iterator[None]:
    """Make orphans of the workers children of this process as long as the block runs (Linux).

    What a job detaches from itself would else become a child of init and could not be found.
    """
    if sys.platform != "linux":
        yield
        return
    libc = ctypes.CDLL(None)
    before = ctypes.c_int()
    libc.prctl(_PR_GET_CHILD_SUBREAPER, ctypes.byref(before))
    libc.prctl(_PR_SET_CHILD_SUBREAPER, 1)
    try:
        yield
    finally:
        libc.prctl(_PR_SET_CHILD_SUBREAPER, before.value)


def end_group(leader: int) -> None:
    """End a worker and everything in its session's first process group."""
    for end in (os.killpg, os.kill):
        with suppress(ProcessLookupError, PermissionError):
            end(leader, signal.SIGKILL)


def processes_of(leader: int, *, walled: bool) -> list[psutil.Process]:
    """Return a worker and all processes below it.

    Arguments:
        leader: the worker.
        walled: whether it only waits for the one in its sandbox.
    """
    with suppress(psutil.Error):
        top = psutil.Process(leader)
        below = top.children(recursive=True)
        return below if walled else [top, *below]
    return []


def memory_of(processes: Iterable[psutil.Process], root: str | None) -> int:
    """Return the bytes that processes hold in memory, with files that exist there alone.

    Arguments:
        root: of their sandbox, whose temporary folder is in memory; None for none.
    """
    total, seen = 0, set[int]()
    for process in processes:
        with suppress(psutil.Error, OSError):
            total += _resident(process)
            total += sum(_unmapped(f"/proc/{process.pid}/fd", seen))
    with suppress(OSError):
        # As a worker starts its root is still that of this process.
        if root is not None and not os.path.samefile(root, "/"):
            held = os.statvfs(root + FOLDER)
            total += (held.f_blocks - held.f_bfree) * held.f_frsize
    return total


def _resident(process: psutil.Process) -> int:
    """Return the bytes of a process in memory; on Linux without pages of files, which it shares."""
    if sys.platform != "linux":
        return int(process.memory_info().rss)
    with open(f"/proc/{process.pid}/status", "rb") as lines:
        known = [line.split() for line in lines if line.startswith((b"RssAnon", b"RssShmem"))]
    return sum(1024 * int(words[1]) for words in known)


def _unmapped(folder: str, seen: set[int]) -> Iterator[int]:
    """Yield the sizes of anonymous files that are open, which count in no process (memfd)."""
    if sys.platform != "linux":
        return
    for name in os.listdir(folder):
        path = f"{folder}/{name}"
        with suppress(OSError):
            if os.readlink(path).startswith(("/memfd:", "/dev/shm/")):
                found = os.stat(path)
                if found.st_ino not in seen:
                    seen.add(found.st_ino)
                    yield 512 * found.st_blocks


def alive(process: int | None) -> bool:
    """Tell whether a process runs, without taking its exit status from whoever waits for it."""
    with suppress(psutil.Error):
        return process is not None and psutil.Process(process).status() != psutil.STATUS_ZOMBIE
    return False


def end_orphans(server: int | None) -> None:
    """End what jobs have left to the server of all workers, which adopts it (Linux)."""
    if server is None or sys.platform != "linux":
        return
    with _starting, suppress(psutil.Error, ProcessLookupError):
        known = {process.pid for process in multiprocessing.process._children}  # type: ignore[attr-defined]
        family = os.getpgid(server)
        for child in psutil.Process(server).children():
            with suppress(psutil.Error, ProcessLookupError):
                # One that was forked just now, for another thread, is of the server's group yet.
                if child.pid not in known and os.getpgid(child.pid) != family:
                    for process in (child, *_below(child)):
                        end_group(process.pid)


_starting = threading.Lock()


def end_strays(mark: str, root: Path, spared: frozenset[int]) -> None:
    """End the children of this process that were started by workers of a mark.

    Arguments:
        mark: value of `MARK` in the environment of the workers.
        root: holds the folders where they were started; for those with another environment.
        spared: processes of ours that carry the mark too.
    """
    with suppress(psutil.Error):
        for child in psutil.Process().children():
            if child.pid not in spared and _is_stray(child, mark, root):
                for process in (child, *_below(child)):
                    end_group(process.pid)
                with suppress(ChildProcessError):
                    os.waitpid(child.pid, 0)


def _below(process: psutil.Process) -> list[psutil.Process]:
    try:
        return list(process.children(recursive=True))
    except psutil.Error:
        return []


def _is_stray(process: psutil.Process, mark: str, root: Path) -> bool:
    with suppress(psutil.Error, OSError):
        if process.status() == psutil.STATUS_ZOMBIE:
            # Its environment is gone; a child of ours that nobody waits for is an orphan of a job
            # or a process of a caller, who keeps the right to its exit code.
            return False
        marked = process.environ().get(MARK) == mark
        return marked or Path(process.cwd()).is_relative_to(root)
    return False


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
    walled: bool = False
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
    excess = _excess(task) if look else None
    return None if excess is None else Ending("memory", reason=excess, seconds=seconds)


def _excess(task: Task[Key]) -> str | None:
    """Return of what a task has more than it may, None where it keeps its limits."""
    limits, leader = task.limits, task.process.pid
    processes = processes_of(leader, walled=task.walled)
    if len(processes) > limits.processes:
        return f"has {len(processes)} processes, allowed {limits.processes}"
    if limits.memory is not None:
        used = memory_of(processes, f"/proc/{leader}/root" if task.walled else None)
        if used > limits.memory + _BASE:
            return f"used {spoken_bytes(used)} of memory, allowed {spoken_bytes(limits.memory)}"
    return None


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
        self._around: dict[tuple[tuple[str, ...], tuple[str, ...]], Walls] = {}

    @property
    def running(self) -> int:
        """Return how many tasks are running."""
        return len(self._running)

    @property
    def free(self) -> bool:
        """Tell whether another task can start."""
        return self.running < self.count

    @property
    def busy(self) -> bool:
        """Tell whether a task is running."""
        return self.running > 0

    @contextmanager
    def open(self) -> Iterator[Workers[Key]]:
        """Start what the workers need, and leave no process and no file behind."""
        self._root = scratch_root()
        if _source != source_digest():
            _end_server()
        self._mark = _server_mark()
        with adopting(), repeating(_wake_server, _TICK):
            try:
                yield self
            finally:
                while self._running:
                    self._close(self._running[-1])
                self._bury(wait=True)
                end_orphans(_server())
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
        context, walls = get_context("forkserver"), self._walls(limits)
        # Without a sandbox a job may have removed the one above.
        try:
            scratch = tempfile.mkdtemp(dir=self._root)
        except FileNotFoundError:
            self._root.mkdir(mode=0o700, parents=True)
            scratch = tempfile.mkdtemp(dir=self._root)
        answer, send = context.Pipe(duplex=False)
        output, printed = context.Pipe(duplex=False)
        arguments = (function, argument, send, printed, limits, scratch, walls)
        try:
            process = forked(serve, *arguments)
        except (OSError, EOFError) as error:
            for end in (answer, output):
                end.close()
            return Ending("no-start", reason=f"no worker process could start: {error}")
        finally:
            send.close()
            printed.close()
        for end in (answer, output):
            os.set_blocking(end.fileno(), False)
        walled = walls is not None
        task = Task(key, process, answer, output, limits, scratch, walled, _server())
        self._running.append(task)
        return None

    def _walls(self, limits: Limits) -> Walls | None:
        if limits.sandbox == "off" or enclosure(limits.sandbox).sandbox == "none":
            return None
        parts = limits.hidden, limits.shown
        if parts not in self._around:
            self._around[parts] = walls_around(*parts)
        return self._around[parts]

    def wait(self, beside: Sequence[Any] = ()) -> list[tuple[Key, Ending]]:
        """Wait until some task has ended, and return those that have; none after a short while.

        Arguments:
            beside: what else there is to wait for, as `connection.wait` takes it.
        """
        now = time.monotonic()
        until = [task.deadline for task in self._running]
        known = [moment - now for moment in until if moment is not None]
        pause = max(min([_TICK, *known]), 0.0)
        own = [part for task in self._running for part in parts_of(task)]
        connection.wait([*own, *beside], pause)
        look = time.monotonic() - self._looked >= _TICK
        if look:
            self._looked = time.monotonic()
        ended = []
        for task in tuple(self._running):
            ending = progress_of(task, look=look)
            if ending is not None:
                self._close(task)
                ended.append((task.key, ending))
        self._bury(wait=False)
        if look:
            end_orphans(_server())
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


def forked(body: Callable[..., None], *arguments: object) -> BaseProcess:
    """Start a process from the server of all workers.

    Arguments:
        body, arguments: what it runs, importable by name, and with what; pickled.

    Raises:
        OSError, EOFError: when there is none to be had.
    """
    process = get_context("forkserver").Process(target=body, args=arguments)
    _server_mark()  # a job may have ended the server
    with _starting, no_script():
        process.start()
    return process


def _server_mark() -> str:
    """Start the server from which workers fork where there is none; return its mark."""
    global _mark, _source
    _mark = _mark or secrets.token_hex(8)
    if not alive(_server()):
        _source = source_digest()
        get_context("forkserver").set_forkserver_preload(["femubench.core.run.preload"])
        resource_tracker.ensure_running()  # it lets Ctrl-C through again
        with environment(**{MARK: _mark}), _ctrl_c_later():
            forkserver.ensure_running()
    return _mark


@contextmanager
def _ctrl_c_later() -> Iterator[None]:
    """Keep Ctrl-C back while the block runs; from what it starts until `preload` is through."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_mark = ""
_source = ""  # what the server has loaded


def _end_server() -> None:
    if alive(_server()):
        forkserver._forkserver._stop()  # type: ignore[attr-defined]


@contextmanager
def repeating(action: Callable[[], object], seconds: float) -> Iterator[None]:
    """Call a function every so many seconds, in another thread, while the block runs."""
    done = threading.Event()

    def watch() -> None:
        while not done.wait(seconds):
            action()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


def _wake_server() -> None:
    """Let the server go on where a job has stopped it; a start may be waiting for its answer."""
    server = _server()
    with suppress(psutil.Error, ProcessLookupError):
        if server is not None and psutil.Process(server).status() == psutil.STATUS_STOPPED:
            os.kill(server, signal.SIGCONT)


_hiding = threading.Lock()
_hidden: list[ModuleType] = []


@contextmanager
def no_script() -> Iterator[None]:
    """Hide the script or notebook from a worker that starts, which would run it once more."""
    with _hiding:
        _hidden.append(sys.modules["__main__"])
        sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        with _hiding:
            # Blocks of several threads overlap; what the first of them found comes back last.
            script = _hidden.pop()
            if not _hidden:
                sys.modules["__main__"] = script


def _server() -> int | None:
    """Return the process from which workers fork."""
    server: int | None = getattr(forkserver._forkserver, "_forkserver_pid", None)
    return server


def _ours() -> frozenset[int]:
    """Return the processes of multiprocessing itself."""
    tracker = getattr(resource_tracker._resource_tracker, "_pid", None)
    return frozenset(pid for pid in (_server(), tracker) if pid is not None)
