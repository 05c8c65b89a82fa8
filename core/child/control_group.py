"""The memory of a child in a control group of its own, where systemd has delegated some (Linux).

The kernel counts all of it (processes, files in memory, pipes, sockets) and ends a full group.
Source: Documentation/admin-guide/cgroup-v2.rst of Linux; CGROUP_DELEGATION.md of systemd.
"""

from __future__ import annotations

import os
from contextlib import suppress
from functools import cache
from pathlib import Path

_ROOT, _OWN = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")
_ASIDE = "femubench"  # the group of what limits others


def put_in_group(process: int, memory: int | None) -> Path | None:
    """Return the group in which a process that has started no others, or was there, now is.

    Arguments:
        memory: bytes that may be held there; None for no limit.
    """
    if (above := delegated()) is None:
        return None
    group = above / f"{_ASIDE}-{os.getpid()}-{process}"
    with suppress(OSError):
        group.mkdir(exist_ok=True)
        (group / "memory.max").write_text("max" if memory is None else str(memory))
        (group / "memory.oom.group").write_text("1")
        with suppress(OSError):  # a kernel that does not count swap
            (group / "memory.swap.max").write_text("0")
        (group / "cgroup.procs").write_text(str(process))
        return group
    with suppress(OSError):
        group.rmdir()
    return None


def was_full(group: Path) -> bool:
    """Tell whether the kernel has ended what was in a group, for want of memory."""
    events = (group / "memory.events").read_text().split()
    return events[events.index("oom_kill") + 1] != "0"


@cache
def delegated() -> Path | None:
    """Return the group that is this process's to divide, None where there is none.

    A group that limits the memory of others holds no process itself: those here go aside.
    """
    with suppress(OSError, StopIteration):
        lines = _OWN.read_text().splitlines()
        above = _ROOT / next(line[4:] for line in lines if line.startswith("0::/"))
        if above.name == _ASIDE:  # where a run in the same terminal has put it
            above = above.parent
        if os.getxattr(above, "user.delegate") != b"1":
            return None
        (above / _ASIDE).mkdir(exist_ok=True)
        for process in (above / "cgroup.procs").read_text().split():
            with suppress(ProcessLookupError):
                (above / _ASIDE / "cgroup.procs").write_text(process)
        (above / "cgroup.subtree_control").write_text("+memory")
        return above
    return None
