"""Processes that a job leaves behind, and how they are found and ended."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

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


def descendants_memory(leader: int) -> int:
    """Return the resident memory of a worker and all processes below it in bytes."""
    total = 0
    with suppress(psutil.Error):
        top = psutil.Process(leader)
        for process in (top, *top.children(recursive=True)):
            with suppress(psutil.Error):
                total += process.memory_info().rss
    return total


def alive(process: int | None) -> bool:
    """Tell whether a process runs, without taking its exit status from whoever waits for it."""
    with suppress(psutil.Error):
        return process is not None and psutil.Process(process).status() != psutil.STATUS_ZOMBIE
    return False


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
