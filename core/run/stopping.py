"""Ending a run early: once asked, the jobs on their way are finished; asked again, it stops."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import TypeVar

_Job = TypeVar("_Job")
_ASKED = b"\nbench: finishing the jobs that are running; Ctrl-C once more stops them\n"


class Stopping:
    """Whether a run shall begin no further job, and whether it has left any out."""

    def __init__(self) -> None:
        self.asked = self.left = False

    def until(self, jobs: Iterable[_Job]) -> Iterator[_Job]:
        """Yield jobs as they are asked for, none any more once the run shall stop."""
        for job in jobs:
            if self.asked:
                self.left = True
                return
            yield job

    def heed(self, signum: int, frame: FrameType | None) -> None:
        """Take a Ctrl-C; raises KeyboardInterrupt the second time."""
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
        # A stream with a buffer may be in the middle of a write, which this interrupts.
        with suppress(OSError):
            os.write(2, _ASKED)


@contextmanager
def interrupts_kept() -> Iterator[None]:
    """Let Ctrl-C do after the block what it did before: some libraries take it on import."""
    before = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGINT) is not before:
            signal.signal(signal.SIGINT, before)


@contextmanager
def stopping() -> Iterator[Stopping]:
    """Let the first Ctrl-C be known from what is yielded, while the block runs.

    Where somebody else takes Ctrl-C, or in a thread, which never hears of it, nothing changes.

    Raises:
        KeyboardInterrupt: at the end of the block, where jobs were left out.
    """
    found = Stopping()
    before = signal.getsignal(signal.SIGINT)
    main = threading.current_thread() is threading.main_thread()
    if not main or before is not signal.default_int_handler:
        yield found
        return
    signal.signal(signal.SIGINT, found.heed)
    try:
        yield found
    finally:
        signal.signal(signal.SIGINT, before)
    if found.left:
        raise KeyboardInterrupt
