"""What a child is: one process that stands alone, in its limits, and answers requests.

A request is a function and its argument, an answer is bytes.
"""

from __future__ import annotations

import importlib
import os
import pickle
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from femubench.core.child.limits import FORKS, Limits
from femubench.core.child.namespaces import FOLDER, Apart, libc, lower_limit, settle
from femubench.core.child.syscall_filter import refuse_system_calls

READY = b"\1"
LENGTH_BYTES = 8
_MOST_FILES = 1024  # open at a time in a sandbox, for each of which is looked at what it holds
_PR_SET_PDEATHSIG, _PR_SET_DUMPABLE = 1, 4


@dataclass(frozen=True)
class Confinement:
    """How a child runs; the first thing that it is sent.

    Arguments:
        limits: what it may take; time and volume are for its parent to watch.
        folder: where it works, but in a sandbox.
        own: whether the folder is its temporary one too, which the parent removes.
        walled: whether it is in a sandbox.
        environment: instead of that of the fork server; None for that.
        once: whether it is asked once.
        secret: whether other processes of the account may not read its memory (Linux).
    """

    limits: Limits
    path: Sequence[str]
    folder: str = "/"
    own: bool = True
    walled: bool = False
    environment: Mapping[str, str] | None = None
    once: bool = True
    secret: bool = False

    def enter(self, apart: Apart | None) -> None:
        """Go on in it, `apart` being that of `answer_requests`."""
        limits = self.limits
        if self.secret and sys.platform == "linux":
            libc().prctl(_PR_SET_DUMPABLE, 0)
        sys.path[:] = self.path
        importlib.invalidate_caches()
        # The words of the command line, -W and PYTHONWARNINGS are for the parent.
        sys.argv, sys.warnoptions = [""], []
        if self.environment is not None:
            os.environ.clear()
            os.environ.update(self.environment)
        os.chdir(self.folder)
        if self.own:
            os.environ["TMPDIR"] = tempfile.tempdir = self.folder
        room = limits.file if limits.memory is None else min(limits.file, limits.memory)
        if self.walled != (apart == "walled"):
            raise RuntimeError("the walls of the sandbox are not there")
        if apart is not None:
            settle(apart, room, limits.processes)
        if not FORKS:
            return
        import resource

        if self.walled:
            os.environ["HOME"] = os.environ["TMPDIR"] = tempfile.tempdir = FOLDER
            lower_limit(resource.RLIMIT_NOFILE, _MOST_FILES)
            refuse_system_calls()
        lower_limit(resource.RLIMIT_CORE, 0)
        lower_limit(resource.RLIMIT_FSIZE, limits.file)
        # Without this the signal would end the process before the write could fail.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        if limits.memory is not None:
            lower_limit(resource.RLIMIT_AS, address_space() + limits.memory)


def answer_requests(requests: int, answers: int, output: int, apart: Apart | None = None) -> None:
    """Answer requests until there are none; the body of every child.

    Arguments:
        requests: gives a `Confinement`, then functions with their arguments.
        answers: takes a byte when the child is ready, then answers, each after its length.
        output: takes what is printed.
        apart: how it was forked apart, None where it was not.
    """
    stand_alone(output, requests, answers)
    if apart is None:  # else it ends with the first process of its namespace
        end_with_parent()
    answer_all(requests, answers, os.close, apart)


def answer_all(
    requests: int, answers: int, ask_no_more: Callable[[int], None], apart: Apart | None = None
) -> None:
    """Answer requests until there are none, in a process that stands alone.

    Arguments:
        requests, answers, apart: as for `answer_requests`.
        ask_no_more: called with `requests` after the last.
    """
    confinement: Confinement = read_object(requests)
    confinement.enter(apart)
    os.write(answers, READY)
    asked = True
    while asked:
        try:
            function, argument = read_object(requests)
        except EOFError:
            return
        if confinement.once:
            ask_no_more(requests)
            asked = False
        data: bytes = function(argument)
        write_all(answers, len(data).to_bytes(LENGTH_BYTES, "big"))
        write_all(answers, data)
        del function, argument, data


def stand_alone(output: int, *kept: int) -> None:
    """Become a session of its own that shares no terminal with anybody.

    Arguments:
        output: takes what is printed.
        kept: descriptors that stay open.
    """
    os.setsid()
    nothing = os.open(os.devnull, os.O_RDONLY)
    for stream, source in enumerate((nothing, output, output)):
        os.dup2(source, stream)
    for low, high in pairwise(sorted((2, *kept, os.sysconf("SC_OPEN_MAX")))):
        os.closerange(low + 1, high)


def end_with_parent() -> None:
    """Let this process be ended when its parent ends (Linux)."""
    if sys.platform == "linux":
        libc().prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def address_space() -> int:
    """Return the bytes of address space of this process; of Linux without what psutil looks up."""
    if sys.platform != "linux":
        import psutil

        return int(psutil.Process().memory_info().vms)
    import resource

    with open("/proc/self/statm", "rb") as pages:
        return int(pages.read().split()[0]) * resource.getpagesize()


def object_frames(sent: object) -> Iterator[bytes | memoryview]:
    """Yield the bytes by which `read_object` reads an object; no `PickleBuffer` in it is copied."""
    buffers: list[pickle.PickleBuffer] = []
    whole = pickle.dumps(sent, protocol=5, buffer_callback=buffers.append)
    parts = [memoryview(whole), *(buffer.raw() for buffer in buffers)]
    yield len(parts).to_bytes(LENGTH_BYTES, "big")
    for part in parts:
        yield len(part).to_bytes(LENGTH_BYTES, "big")
        yield part


def read_object(descriptor: int) -> Any:  # noqa: ANN401 - what was sent
    """Return the next object from a pipe, which this program wrote.

    Raises:
        EOFError: when there is no more.
    """
    count = int.from_bytes(_read(descriptor, LENGTH_BYTES), "big")
    whole, *buffers = (
        _read(descriptor, int.from_bytes(_read(descriptor, LENGTH_BYTES), "big"))
        for _ in range(count)
    )
    return pickle.loads(whole, buffers=buffers)


def _read(descriptor: int, length: int) -> bytes:
    parts = []
    while length:
        part = os.read(descriptor, min(length, 2**20))
        if not part:
            raise EOFError
        parts.append(part)
        length -= len(part)
    return b"".join(parts)


def write_all(descriptor: int, data: bytes) -> None:
    """Write bytes, however long it takes."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view[: 2**20]) :]
