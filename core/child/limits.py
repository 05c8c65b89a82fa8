"""What one job may take."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Literal

from femubench.core.schema.run_options import Sandbox

Mode = Sandbox | Literal["processes"]  # the last: only a namespace of processes, where possible
MIB = 2**20
_SHARE = 0.9  # of the memory that is there, for all workers together
LEAST = 512 * MIB
FORKS = hasattr(os, "fork")  # not on Windows, which has no limits of a process either


@dataclass(frozen=True)
class Limits:
    """What one job may take before it is stopped.

    Arguments:
        seconds: wall time; None for no limit.
        memory: bytes beyond what a fresh worker has, of all processes of the job together; None
            for no limit.
        output, answer: bytes that it may print, and hand back.
        file: size of the largest file that it may write.
        processes: that it may have, where there is a sandbox with their threads.
        sandbox: whether it runs in one; with ``processes`` only in a namespace of processes where
            that is possible, in the folder and with the environment of its parent.
        hidden: folders that it does not see there, wherever they are.
        shown: files of code that it sees there in addition to what can be imported.
    """

    seconds: float | None = 600.0
    memory: int | None = None
    output: int = 16 * MIB
    answer: int = 1024 * MIB
    file: int = 1024 * MIB
    processes: int = 512
    sandbox: Mode = "off"
    hidden: tuple[str, ...] = ()
    shown: tuple[str, ...] = ()


def count_processors() -> int:
    """Return the number of processors that this process may use."""
    usable = getattr(os, "sched_getaffinity", None)  # of Linux
    return len(usable(0)) if usable else os.cpu_count() or 1


def memory_share(workers: int, given: int | None = None) -> int:
    """Return the bytes that one of several workers may take, of the machine's or those given."""
    import psutil

    total = psutil.virtual_memory().total if given is None else given
    return max(int(_SHARE * total / workers), LEAST)


def format_bytes(count: float) -> str:
    """Return a size as one would type it: ``512 MiB``, ``1.5 GiB``."""
    for unit in ("B", "KiB", "MiB"):
        if count < 1024.0:
            return f"{count:.3g} {unit}"
        count /= 1024.0
    return f"{count:.3g} GiB"
