"""The process from which children fork: it has libraries loaded and no case, strategy or secret.

It is started once, without variables of the environment that may be secrets, and ends with the
process that started it. A message asks for a child: the module that is loaded first, and the ends
of the child's pipes. The server reaps its children and ends what they leave behind (Linux).
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import os
import secrets
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import NoReturn

from femubench.core.child.confinement import answer_requests
from femubench.core.source_files import stamps

MARK = "FEMUBENCH_WORKERS"
NUMBER = 8  # bytes of the number of a process, and of an exit code
_MESSAGE = 128  # bytes with the name of a module
_CODE = """
import sys
sys.path[:] = sys.argv[2:]
from femubench.core.child.server import serve_forks
serve_forks(int(sys.argv[1]))
"""
_VARIABLES = frozenset(
    {"PATH", "LANG", "LANGUAGE", "TZ", "LD_LIBRARY_PATH", "VIRTUAL_ENV", "CONDA_PREFIX", "TERM"}
)
_FAMILIES = ("LC_", "PYTHON", "OMP_", "OPENBLAS_", "MKL_", "BLIS_", "VECLIB_", "NUMEXPR_")
_LIBRARIES = ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR")
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in _LIBRARIES} | {"VECLIB_MAXIMUM_THREADS": "1"}
_PR_SET_CHILD_SUBREAPER = 36
_TICK = 0.5  # s between two looks at what children have left behind
_PAUSE = 0.01  # s between two looks at what was ended
LAST_BREATH = 5.0  # s that the end of a process may take
_exit = os._exit  # before anybody puts something else there


class ForkServer:
    """The fork server of this process, seen from here."""

    def __init__(self) -> None:
        self.mark = secrets.token_hex(8)
        self.source = stamps("femubench")
        self._control, its = socket.socketpair()
        flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
        plain = {
            name: value
            for name, value in os.environ.items()
            if name in _VARIABLES or name.startswith(_FAMILIES)
        }
        with its, _interrupts_later():
            self.process = subprocess.Popen(
                [sys.executable, *flags, "-c", _CODE, str(its.fileno()), *search_path()],
                env={**plain, **ONE_THREAD, MARK: self.mark},
                cwd="/",
                pass_fds=[its.fileno()],
                stdin=subprocess.DEVNULL,
                start_new_session=True,
            )

    @property
    def alive(self) -> bool:
        """Tell whether it runs."""
        return self.process.poll() is None

    @property
    def current(self) -> bool:
        """Tell whether the source of femubench is as it was when it started."""
        return self.source == stamps("femubench")

    def ask(self, module: str, ends: Sequence[int] = ()) -> None:
        """Ask for a child, or without ends of its pipes only to load a module.

        Arguments:
            module: of ours, which is loaded first.
            ends: the child's, of the pipes with requests, answers and output, and the server's of
                the pipe on which come the number of the child and, as it has ended, its exit code;
                that is closed when nothing of the child is left.

        Raises:
            OSError: when the server has ended.
        """
        socket.send_fds(self._control, [module.encode().ljust(_MESSAGE)], ends)

    def wake(self) -> None:
        """Let it go on where a job has stopped it."""
        import psutil

        with suppress(psutil.Error, ProcessLookupError):
            if psutil.Process(self.process.pid).status() == psutil.STATUS_STOPPED:
                os.kill(self.process.pid, signal.SIGCONT)

    def end(self) -> None:
        """End it, and with it its children."""
        self._control.close()
        self.wake()
        try:
            self.process.wait(LAST_BREATH)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


_starting = threading.Lock()
_server: ForkServer | None = None


def fork_server() -> ForkServer:
    """Return the fork server of this process; a job may have ended the one before."""
    global _server
    with _starting:
        if _server is not None and not _server.alive:
            _server.end()
            _server = None
        if _server is None:
            _server = ForkServer()
        return _server


@atexit.register
def end_server(which: ForkServer | None = None) -> None:
    """End the fork server of this process where there is one.

    Arguments:
        which: the one that is meant; None for whichever runs.
    """
    global _server
    with _starting:
        if _server is not None and which in (None, _server):
            _server.end()
            _server = None


def search_path() -> list[str]:
    """Return the search path of this process, valid in every folder."""
    return [os.path.abspath(entry) for entry in sys.path]


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Keep Ctrl-C back while the block runs; from what it starts until that ignores it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def serve_forks(control: int) -> NoReturn:
    """Fork children as long as somebody may ask for one; the body of the server.

    Arguments:
        control: takes the messages.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT,))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    woken, wakes = os.pipe()
    os.set_blocking(woken, False)
    os.set_blocking(wakes, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wakes)
    asked = socket.socket(fileno=control)
    children, ended = dict[int, int](), list[int]()
    while True:
        pause = _PAUSE if ended else _TICK if children else None
        ready, _, _ = select.select([control, woken], [], [], pause)
        with suppress(BlockingIOError):
            os.read(woken, 2**16)
        ended += _reap(children)
        if not _end_strays(children):
            for status in ended:
                os.close(status)
            ended.clear()
        if control in ready:
            message, given, *_ = socket.recv_fds(asked, _MESSAGE, 4)
            if not message:
                _end_all(children)
                _exit(0)
            _load(message.decode().strip())
            if given:
                _fork(given, children)


def _load(module: str) -> None:
    """Import a module, so that children have it."""
    if module not in sys.modules:
        with suppress(Exception):  # a child that needs it says what is wrong with it
            import_module(module)
        # Else the first search for garbage in a child writes to, and so copies, every page.
        gc.collect()
        gc.freeze()


def _fork(ends: Sequence[int], children: dict[int, int]) -> None:
    """Fork a child, and tell its number."""
    process = os.fork()
    if process == 0:
        _answer(ends)
    for end in ends[:-1]:
        os.close(end)
    children[process] = ends[-1]
    _tell(ends[-1], process)


def _answer(ends: Sequence[int]) -> NoReturn:
    """Be a child, and end."""
    code: object = 1
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        answer_requests(*ends[:-1])
        code = 0
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        _exit(code if isinstance(code, int) else 1)


def _reap(children: dict[int, int]) -> Iterator[int]:
    """Tell the exit codes of children that have ended, and yield where."""
    with suppress(ChildProcessError):
        while True:
            process, status = os.waitpid(-1, os.WNOHANG)
            if not process:
                return
            if process in children:
                _tell(children[process], os.waitstatus_to_exitcode(status))
                yield children.pop(process)


def _tell(status: int, number: int) -> None:
    with suppress(OSError):  # nobody waits for it any more
        os.write(status, number.to_bytes(NUMBER, "big", signed=True))


def _end_strays(children: Iterable[int]) -> bool:
    """End what has lost its parents, and so became a child of the server; tell whether there was.

    Arguments:
        children: what is the server's by right.
    """
    try:
        with open(f"/proc/self/task/{os.getpid()}/children") as listed:
            strays = {int(word) for word in listed.read().split()}.difference(children)
    except OSError:  # another system, where they become children of init
        return False
    for process in strays:
        end_group(process)
    return bool(strays)


def _end_all(children: dict[int, int]) -> None:
    """End all children and what they leave behind."""
    until = time.monotonic() + LAST_BREATH
    for process in children:
        end_group(process)
    while (children or _end_strays(children)) and time.monotonic() < until:
        tuple(_reap(children))
        time.sleep(_PAUSE)


def end_group(leader: int) -> None:
    """End a process and everything in the process group that it leads."""
    for end in (os.killpg, os.kill):
        with suppress(ProcessLookupError, PermissionError):
            end(leader, signal.SIGKILL)
