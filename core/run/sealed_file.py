"""A file of sealed lines that grows while it is read: every line names the one before it.

What was added is there after a crash of the process, whole or not at all, and on the disk a second
later. Lines that lost a bit, lines that are missing and lines that come twice can all be told.
"""

from __future__ import annotations

import errno
import fcntl
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from femubench.core.files import MIB, open_regular
from femubench.core.schema.sealing import TAIL, is_whole, sum_of

LARGEST = 4096 * MIB  # bytes of a file, in which there are a million results and more
_LONGEST_LINE = 64 * MIB
_SYNCED_WITHIN = 1.0  # s


def lines_of(path: Path) -> Iterator[tuple[int, bytes, bool]]:
    """Yield number and text of every line, and whether it has an end, which only the last may lack.

    Raises:
        InputError: when the file cannot be read.
    """
    with open_regular(path, LARGEST) as stream:
        number = 0
        while line := stream.readline(_LONGEST_LINE):
            number += 1
            ended = line.endswith(b"\n")
            yield number, line[:-1] if ended else line, ended


@contextmanager
def locked(path: Path) -> Iterator[int]:
    """Wait for the lock of a file to which records are added; yield its descriptor."""
    descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield descriptor
    finally:
        os.close(descriptor)


def add(path: Path, line_after: Callable[[bytes], bytes]) -> None:
    """Add a line whole or not at all.

    Arguments:
        path: of the file, which is made where there is none.
        line_after: returns the sealed line to be added; is given the checksum of the last one,
            nothing where there is none.

    Raises:
        OSError: when there is no room, or the file cannot be written.
    """
    with locked(path) as descriptor:
        size, last = _mended(descriptor)
        line = line_after(last) + b"\n"
        try:
            if os.write(descriptor, line) != len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError:
            with suppress(OSError):
                os.ftruncate(descriptor, size)
            raise


def _mended(descriptor: int) -> tuple[int, bytes]:
    """Let the file end with a whole line; return its size and the checksum of that line.

    What an interrupted write left behind is cut off: with a record after it, it would be a
    broken line in the middle of the file, which nobody could tell from damage.
    """
    size = os.fstat(descriptor).st_size
    end = os.pread(descriptor, TAIL + 1, max(size - TAIL - 1, 0))
    if end.endswith(b"\n") or not size:
        return size, sum_of(end[:-1])
    start, tail = size, b""
    while start > 0 and b"\n" not in tail:
        step = min(start, 65536)
        start -= step
        tail = os.pread(descriptor, step, start) + tail
    last = tail[tail.rfind(b"\n") + 1 :]
    # Of a line that is whole but for its end, the end was not written or has changed.
    whole = next((text for text in (last, last[:-1]) if is_whole(text)), b"")
    size += len(whole) - len(last)
    os.ftruncate(descriptor, size)
    if whole:
        os.write(descriptor, b"\n")
        return size + 1, sum_of(whole)
    return size, sum_of(os.pread(descriptor, TAIL + 1, max(size - TAIL - 1, 0))[:-1])


def sync(path: Path) -> None:
    """Wait until a file, or a folder with its names, is on the disk."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class Syncing:
    """Files on their way to the disk, each there within a second of `soon`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._due: set[Path] = set()
        self._fault: OSError | None = None

    def soon(self, path: Path) -> None:
        """Sync a file within a second, in another thread.

        Raises:
            OSError: when that failed the last time.
        """
        with self._lock:
            fault, self._fault = self._fault, None
            started = path in self._due
            self._due.add(path)
        if not started:
            timer = threading.Timer(_SYNCED_WITHIN, self._sync, [path])
            timer.daemon = True
            timer.start()
        if fault is not None:
            raise fault

    def _sync(self, path: Path) -> None:
        with self._lock:
            self._due.discard(path)
        try:
            sync(path)
        except FileNotFoundError:  # somebody removed it
            pass
        except OSError as error:
            with self._lock:
                self._fault = error
