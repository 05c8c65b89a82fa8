"""What runs in a worker process: one task in a process of its own, bytes out."""

from __future__ import annotations

import ctypes
import os
import resource
import shutil
import signal
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import psutil

from femubench.core.run.limits import Limits
from femubench.core.run.namespaces import Walls
from femubench.core.run.sandbox import enter

READY = b"\1"
LENGTH_BYTES = 8
_THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None)
# Where multiprocessing's server and tracker keep how to reach them.
_KEPT = ("_forkserver_alive_fd", "_forkserver_address", "_forkserver_pid", "_fd", "_pid")


@contextmanager
def environment(**extra: str) -> Iterator[None]:
    """Set thread counts of one, and more, for processes started meanwhile; restore afterwards."""
    wanted = dict.fromkeys(_THREADS, "1") | extra
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def serve(
    function: Callable[[Any], bytes],
    argument: object,
    answer: Connection,
    output: Connection,
    limits: Limits,
    scratch: str,
    walls: Walls | None = None,
) -> None:
    """Run one function, send its bytes and end; the body of every worker process.

    Arguments:
        function, argument: what to run.
        answer: a byte when ready, then the length of the answer and the answer.
        output: takes what is printed.
        limits: on memory and files; time and volume are for the parent to watch.
        scratch: working and temporary folder, which the parent removes; in a sandbox an empty
            one, where its root is made.
        walls: of the sandbox; None for none.
    """
    descriptor = answer.fileno()
    stand_alone(output, descriptor)
    os.chdir(scratch)
    os.environ["TMPDIR"] = tempfile.tempdir = scratch
    # The words of the command line are none of a strategy's business.
    sys.argv = [""]
    # PYTHONWARNINGS and -W of the parent are for the parent.
    sys.warnoptions = []
    if walls is not None:
        room = limits.file if limits.memory is None else min(limits.file, limits.memory)
        enter(walls, scratch, room, limits.processes)
    _lower(resource.RLIMIT_CORE, 0)
    _lower(resource.RLIMIT_FSIZE, limits.file)
    # Without this the signal would end the process before the write could fail.
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    if limits.memory is not None:
        _lower(resource.RLIMIT_AS, address_space() + limits.memory)
    os.write(descriptor, READY)
    with warnings.catch_warnings():
        data = function(argument)
    write_all(descriptor, len(data).to_bytes(LENGTH_BYTES, "big"))
    write_all(descriptor, data)


def stand_alone(output: Connection, *kept: int) -> None:
    """Become a session of its own that dies with its parent and shares no terminal with anybody.

    Arguments:
        output: takes what is printed.
        kept: descriptors that stay open; of the others whoever writes to one that multiprocessing
            left open ends the server of all workers.
    """
    # Ctrl-C goes to the whole foreground group; it is the parent that stops the workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.setsid()
    end_with_parent()
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    for stream in (1, 2):
        os.dup2(output.fileno(), stream)
    output.close()
    # So that a strategy that starts processes of its own gets its own server and tracker.
    for keeper in (forkserver._forkserver, resource_tracker._resource_tracker):
        for name in _KEPT:
            if hasattr(keeper, name):
                setattr(keeper, name, None)
    for low, high in pairwise(sorted((2, *kept, os.sysconf("SC_OPEN_MAX")))):
        os.closerange(low + 1, high)


def end_with_parent() -> None:
    """Let this process be ended when its parent ends (Linux)."""
    if sys.platform == "linux":
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def address_space() -> int:
    """Return the bytes of address space of this process; of Linux without what psutil looks up."""
    if sys.platform != "linux":
        return int(psutil.Process().memory_info().vms)
    with open("/proc/self/statm", "rb") as pages:
        return int(pages.read().split()[0]) * resource.getpagesize()


def _lower(what: int, wanted: int) -> None:
    _, hard = resource.getrlimit(what)
    most = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    resource.setrlimit(what, (most, most))


def write_all(descriptor: int, data: bytes) -> None:
    """Write bytes, however long it takes."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view[: 2**20]) :]


def scratch_root() -> Path:
    """Make a folder for the scratch folders of this process; remove those of dead processes."""
    above = Path(tempfile.gettempdir())
    for left in above.glob("femubench-*-*"):
        number = left.name.split("-")[1]
        if number.isdigit() and not psutil.pid_exists(int(number)):
            shutil.rmtree(left, ignore_errors=True)
    return Path(tempfile.mkdtemp(prefix=f"femubench-{os.getpid()}-", dir=above))
