"""The process from which children fork: it has libraries loaded and no case, strategy or secret.

It is started once, without variables of the environment that may be secrets, and ends with the
process that started it. A message asks for a child: the module that is loaded first, and the ends
of the child's pipes. The server reaps its children and ends what they leave behind (Linux). A
child may be a server too, which raises the walls within which its own children run.
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
from functools import partial
from importlib import import_module
from typing import NoReturn

from femubench.core.child import confinement
from femubench.core.child.namespaces import FAILED, Apart, Walls, fork_apart, raise_walls
from femubench.core.source_files import stamps

MARK = "FEMUBENCH_WORKERS"
NUMBER = 8  # bytes of the number of a process, and of an exit code
_ENDS = 4  # of the pipes of a child
_CLOSE_ON_EXEC = getattr(socket, "MSG_CMSG_CLOEXEC", 0)
_REFUSED = b"no sandbox: "
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
# The server's end of a child's pipe, the first process of its namespace or 0, and of such a process
# what keeps it alive, else -1.
_Child = tuple[int, int, int]
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
                the pipe on which come the number of the child, that of the first process of its
                namespace or 0, and, as it has ended, its exit code; that is closed when nothing of
                the child is left.

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


class WalledServer:
    """A child of the fork server from which other children fork, within walls.

    Arguments:
        module: of ours, which is loaded first.
        walls, folder: as for `raise_walls`.
    """

    said = ""  # why it could not raise its walls

    def __init__(self, module: str, walls: Walls | None, folder: str) -> None:
        self._control, its = socket.socketpair()
        with its:
            fork_server().ask(module, [its.fileno()])
        for part in confinement.object_frames((walls, folder)):
            self._control.sendall(part)

    def ask(self, module: str, ends: Sequence[int]) -> None:
        """Ask for a child; see `ForkServer.ask`."""
        socket.send_fds(self._control, [module.encode().ljust(_MESSAGE)], ends)

    @property
    def alive(self) -> bool:
        """Tell whether nobody has ended it yet."""
        return self._control.fileno() >= 0

    def end(self) -> None:
        """End it, and with it its children."""
        heard = b""
        with self._control, suppress(OSError):
            self._control.shutdown(socket.SHUT_WR)
            self._control.settimeout(LAST_BREATH)
            while said := self._control.recv(_MESSAGE):
                heard += said
        # Among its numbers and its exit code; of one that was ended before, what was heard then.
        _, refused, why = heard.partition(_REFUSED)
        self.said = (refused + why.partition(b"\0")[0]).decode() or self.said


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
def end_server() -> None:
    """End the fork server of this process where there is one."""
    global _server
    with _starting:
        if _server is not None:
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


def serve_forks(control: int, apart: Apart | None = None) -> NoReturn:
    """Fork children as long as somebody may ask for one; the body of the server.

    Arguments:
        control: takes the messages.
        apart: how children are apart, where they are.
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
    children, ended = dict[int, _Child](), list[int]()
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
            message, given = b"", list[int]()
            with suppress(ConnectionError):  # who asked has ended, and not read all
                message, given, *_ = socket.recv_fds(asked, _MESSAGE, _ENDS, _CLOSE_ON_EXEC)
            if not message:
                _end_all(children)
                _exit(0)
            _load(message.decode().strip())
            if given:
                _fork(given, children, apart)


def _load(module: str) -> None:
    """Import a module, so that children have it."""
    if module not in sys.modules:
        with suppress(Exception):  # a child that needs it says what is wrong with it
            import_module(module)
        # Else the first search for garbage in a child writes to, and so copies, every page.
        gc.collect()
        gc.freeze()


def _fork(ends: Sequence[int], children: dict[int, _Child], apart: Apart | None) -> None:
    """Fork a child, and tell its number and that of the first process of its namespace."""
    try:
        if apart is not None:
            process, first, alive = fork_apart(apart, partial(_answer, ends, apart))
        else:
            process, first, alive = os.fork(), 0, -1
            if process == 0:
                _answer(ends)
    except OSError:  # who asked hears it from the end of the pipes
        for end in ends:
            os.close(end)
        return
    for end in ends[:-1]:
        os.close(end)
    children[process] = ends[-1], first, -1
    if first:
        children[first] = ends[-1], 0, alive
    _tell(ends[-1], process, first)


def _answer(ends: Sequence[int], apart: Apart | None = None) -> NoReturn:
    """Be a child, and end."""
    code: object = 1
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        if len(ends) == _ENDS:
            confinement.answer_requests(ends[0], ends[1], ends[2], apart)
        else:
            _serve_within(ends[0])
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


def _serve_within(control: int) -> NoReturn:
    """Raise walls, and be a server there."""
    confinement.stand_alone(2, control)
    try:
        apart = raise_walls(*confinement.read_object(control))
    except OSError as error:
        os.write(control, _REFUSED + str(error.strerror or error).encode())
        _exit(FAILED)
    confinement.end_with_parent()  # which other rights would have undone
    serve_forks(control, apart)


def _reap(children: dict[int, _Child]) -> Iterator[int]:
    """Tell the exit codes of children that have ended, and yield where nothing is left of one."""
    with suppress(ChildProcessError):
        while True:
            process, status = os.waitpid(-1, os.WNOHANG)
            if not process:
                return
            if process not in children:
                continue
            pipe, first, alive = children.pop(process)
            if alive < 0:
                _tell(pipe, os.waitstatus_to_exitcode(status))
            else:
                os.close(alive)
            if first:  # it ends when all others have
                end_group(first)
            else:
                yield pipe


def _tell(status: int, *numbers: int) -> None:
    with suppress(OSError):  # nobody waits for it any more
        os.write(status, b"".join(n.to_bytes(NUMBER, "big", signed=True) for n in numbers))


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


def _end_all(children: dict[int, _Child]) -> None:
    """End all children and what they leave behind."""
    until = time.monotonic() + LAST_BREATH
    for process in tuple(children):
        end_group(process)
    while (children or _end_strays(children)) and time.monotonic() < until:
        tuple(_reap(children))
        time.sleep(_PAUSE)


def end_group(leader: int) -> None:
    """End a process and everything in the process group that it leads."""
    for end in (os.killpg, os.kill):
        with suppress(ProcessLookupError, PermissionError):
            end(leader, signal.SIGKILL)
