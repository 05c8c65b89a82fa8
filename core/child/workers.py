"""Every task in a fresh process of its own, stopped when it takes more than its limits."""

from __future__ import annotations

import ctypes
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Generic, TypeVar

import psutil

from femubench.core.child import server
from femubench.core.child.confinement import Confinement
from femubench.core.child.guarded_child import Ending, GuardedChild, processes_of, wait_for
from femubench.core.child.limits import FORKS, Limits
from femubench.core.child.sandbox import enclosure, walls_around
from femubench.core.child.spawned_child import start_child

JOBS = "femubench.core.run.preload"  # what children that run strategies or judge need
Key = TypeVar("Key")
_PR_SET_CHILD_SUBREAPER, _PR_GET_CHILD_SUBREAPER = 36, 37
_TICK = 0.5  # s between two looks at the memory of a worker
_ATTEMPTS = 3  # to start a process


class Workers(Generic[Key]):
    """Runs tasks, at most `count` at a time, in processes with a module of ours loaded."""

    def __init__(self, count: int, module: str = JOBS) -> None:
        self.count, self._module = count, module
        self._running: list[tuple[Key, GuardedChild]] = []
        self._dying: list[GuardedChild] = []
        self._root = Path()
        self._looked = 0.0
        self._servers: dict[tuple[tuple[str, ...], ...], server.WalledServer] = {}
        self._apart = True  # whether a namespace of processes alone is to be had, as far as known

    @property
    def running(self) -> int:
        """Return how many tasks are running."""
        return len(self._running)

    @contextmanager
    def open(self) -> Iterator[Workers[Key]]:
        """Start what the workers need, and leave no process and no file behind."""
        with _scratch_root() as self._root, adopt_orphans():
            if FORKS:
                if not server.fork_server().current:
                    server.end_server()
                with suppress(OSError):
                    server.fork_server().ask(self._module)
            try:
                yield self
            finally:
                self.stop()
                for within in self._servers.values():
                    within.end()
                self._servers.clear()
                self._end_strays()

    def stop(self) -> None:
        """End what runs."""
        for _, child in self._running:
            self._end(child)
        self._running = []
        self._bury(wait=True)

    def start(
        self, key: Key, function: Callable[[Any], bytes], argument: object, limits: Limits
    ) -> Ending | None:
        """Start a task; return how it ended where no process could be started.

        Arguments:
            key: by which `wait` names it.
            function: importable by name.
        """
        within = None
        try:
            how, within = self._confinement(limits)
            child = start_child(how, self._module, within)
        except OSError as error:
            if within is not None and not how.walled:  # no namespace of processes is to be had
                self._apart = False
                return self.start(key, function, argument, limits)
            why = (within and within.said) or error
            return Ending("no-start", reason=f"no worker process could start: {why}")
        self._running.append((key, child))  # first: what cannot be pickled raises
        child.ask(function, argument, limits)
        return None

    def _confinement(self, limits: Limits) -> tuple[Confinement, server.WalledServer | None]:
        """Return how a task runs, and the server from which it forks where that has walls."""
        path = server.search_path()
        if enclosure(limits.sandbox).sandbox != "none":
            within = self._server(limits.hidden, limits.shown)
            return Confinement(limits, path, own=False, walled=True), within
        mark = server.fork_server().mark if FORKS else ""
        environment = {**os.environ, **server.ONE_THREAD, server.MARK: mark}
        if limits.sandbox == "processes":
            how = Confinement(limits, path, os.getcwd(), own=False, environment=environment)
            return how, self._server() if FORKS and self._apart else None
        return Confinement(limits, path, self._scratch(), environment=environment), None

    def _server(self, *seen: tuple[str, ...]) -> server.WalledServer:
        """Return the server with the walls for `walls_around`: one for all jobs of a run."""
        found = self._servers.get(seen)
        if found is None or not found.alive:
            walls = walls_around(*seen) if seen else None
            found = server.WalledServer(self._module, walls, self._scratch())
            self._servers[seen] = found
        return found

    def _scratch(self) -> str:
        """Make an empty folder."""
        self._root.mkdir(mode=0o700, parents=True, exist_ok=True)  # a job may have removed it
        return tempfile.mkdtemp(dir=self._root)

    def wait(self, others: Sequence[GuardedChild] = ()) -> list[tuple[Key, Ending]]:
        """Wait until some task has ended, and return those that have; none after a short while.

        Arguments:
            others: children that may end the waiting too.
        """
        wait_for([*(child for _, child in self._running), *others], _TICK)
        look = time.monotonic() - self._looked >= _TICK
        if look:
            self._looked = time.monotonic()
        ended = []
        for key, child in tuple(self._running):
            ending = child.progress(look=look)
            if ending is not None:
                self._running.remove((key, child))
                self._end(child)
                ended.append((key, ending))
        self._bury(wait=False)
        if look:
            self._end_strays()
        return ended

    def _end(self, child: GuardedChild) -> None:
        child.kill()
        self._dying.append(child)

    def _bury(self, *, wait: bool) -> None:
        """Remove what is left of children that were ended; ending takes its time."""
        for child in tuple(self._dying):
            if wait:
                child.bury()
            if child.gone:
                self._dying.remove(child)
                if child.confinement.own:
                    shutil.rmtree(child.confinement.folder, ignore_errors=True)

    def _end_strays(self) -> None:
        """End what workers have left to this process, which adopts it when their server has ended.

        It is known by the mark in its environment, or by its folder.
        """
        if not FORKS:  # what has lost its parent is nobody's child there
            return
        running = server.fork_server()
        running.wake()
        with suppress(psutil.Error):
            for child in psutil.Process().children():
                if child.pid != running.process.pid and self._is_stray(child, running.mark):
                    for process in processes_of(child.pid):
                        server.end_group(process.pid)
                    with suppress(ChildProcessError):
                        os.waitpid(child.pid, 0)

    def _is_stray(self, process: psutil.Process, mark: str) -> bool:
        with suppress(psutil.Error, OSError):
            if process.status() == psutil.STATUS_ZOMBIE:
                # Its environment is gone; a child of ours that nobody waits for is an orphan of a
                # job or a process of a caller, who keeps the right to its exit code.
                return False
            marked = process.environ().get(server.MARK) == mark
            return marked or Path(process.cwd()).is_relative_to(self._root)
        return False


@contextmanager
def adopt_orphans() -> Iterator[None]:
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


@contextmanager
def _scratch_root() -> Iterator[Path]:
    """Have a folder for the scratch folders of this process; remove those of dead processes."""
    above = Path(tempfile.gettempdir())
    for left in above.glob("femubench-*-*"):
        number = left.name.split("-")[1]
        if number.isdigit() and not psutil.pid_exists(int(number)):
            with suppress(OSError), _locked(left):
                shutil.rmtree(left, ignore_errors=True)
    made = Path(tempfile.mkdtemp(prefix="femubench-new-", dir=above))
    with _locked(made):
        root = made.rename(made.with_name(made.name.replace("new", str(os.getpid()), 1)))
        try:
            yield root
        finally:
            shutil.rmtree(root, ignore_errors=True)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder in use, whose process may have no number in this namespace."""
    if not FORKS:  # there are no namespaces, and no locks of folders
        yield
        return
    import fcntl

    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


def run_apart(
    tasks: Mapping[Key, tuple[Callable[[Any], bytes], object]],
    limits: Limits,
    count: int,
    module: str = JOBS,
) -> dict[Key, Ending]:
    """Return how every task ended, each in a process of its own.

    Arguments:
        tasks: by key, a function that is importable by name and its argument.
        count: number of processes at a time.
        module: as for `Workers`.
    """
    found: dict[Key, Ending] = {}
    waiting, attempts = list(tasks), dict.fromkeys(tasks, 0)
    if not waiting:
        return found
    with Workers[Key](count, module).open() as workers:
        while waiting or workers.running:
            while workers.running < count and waiting:
                key = waiting.pop(0)
                attempts[key] += 1
                ending = workers.start(key, *tasks[key], limits)
                if ending is not None:
                    found[key] = ending
            for key, ending in workers.wait() if workers.running else ():
                if ending.how == "no-start" and attempts[key] < _ATTEMPTS:
                    waiting.append(key)
                else:
                    found[key] = ending
    # One of them has ended the server of all; alone it does so to itself.
    orphaned = [key for key in found if found[key].how == "orphaned" and len(tasks) > 1]
    for key in orphaned:
        found |= run_apart({key: tasks[key]}, limits, 1, module)
    return found


def call_apart(
    function: Callable[[Any], bytes], argument: object, seconds: float, memory: int, module: str
) -> Ending:
    """Return how a call of a function ended in a process of its own, from which it reads files.

    Arguments:
        function: importable by name; returns bytes.
        argument: its argument; pickled.
        seconds: that it may take.
        memory: bytes that it may take, libraries and answer among them.
        module: of femubench, which is loaded once for all calls.

    Examples:
        >>> fem.call_apart(str.encode, "beam", 60.0, 2**31, "femubench.fem").answer
        b'beam'
    """
    limits = Limits(seconds, memory, answer=memory, sandbox="processes")
    return run_apart({0: (function, argument)}, limits, 1, module)[0]
