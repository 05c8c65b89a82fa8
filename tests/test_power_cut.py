"""The power goes at any moment: what was acknowledged is there, and the run goes on."""

from __future__ import annotations

import ctypes
import os
import random
import threading
from collections.abc import Callable, Iterator
from ctypes import CFUNCTYPE, POINTER, Structure, c_char_p, c_int, c_void_p
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from femubench.core.run.store import Store
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import Block, JobResult

RUN, JOBS = "20260101T000000Z-000000", 30
CUTS, FEW = 200, 8  # all of them in `make nightly`
META = {"run": RUN, "seeds": [*range(JOBS)], "cases": {"corner": {}}, "strategies": ["a"]}
PAGE = 512  # bytes that a disk writes whole


def result_of(seed: int) -> JobResult:
    """A result that is like no other."""
    modes = tuple(PairedMode(n, 100.0 * n, 101.0 * n + seed, 0.99) for n in range(1, 6))
    return JobResult(
        "corner", "a", seed, "ok", blocks={"used": Block(3.0 + seed, 0.9, modes)}, key=f"{seed:08d}"
    )


@dataclass
class Disk:
    """A disk that has what was synced, and of the rest whatever it likes.

    Arguments:
        folder: what lies on it.
        content: of every file when it was synced last.
        names: files whose names were synced with their folder.
    """

    folder: Path
    content: dict[str, bytes] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)

    def sync(self, path: Path) -> None:
        """Take what is in a file or folder now.

        Stores of earlier tests may still sync theirs, on timers of their own.
        """
        if not path.is_relative_to(self.folder.resolve()):
            return
        if path.is_dir():
            self.names = {file.name for file in path.iterdir()}
        else:
            self.content[str(path.stat().st_ino)] = path.read_bytes()
            # With a log that it has just made SQLite syncs the folder.
            self.names |= {path.name} if path.name.endswith("-wal") else set()

    def cut(self, draw: random.Random, left: Path) -> None:
        """Leave in a folder what is there when the power is back.

        Lost is what was not synced: all of it, the end, or pages in the middle of it.
        """
        left.mkdir()
        for file in self.folder.iterdir():
            if file.name.endswith("-shm"):  # anyone who opens the log first makes it anew
                continue
            if file.name not in self.names and draw.random() < 0.5:
                continue
            safe, now = self.content.get(str(file.stat().st_ino), b""), file.read_bytes()
            size = draw.randint(min(len(safe), len(now)), max(len(safe), len(now)))
            mixed = bytearray(size)
            for start in range(0, size, PAGE):
                page = slice(start, start + PAGE)
                kept = now[page] if draw.random() < 0.7 else safe[page]
                mixed[page] = kept.ljust(min(PAGE, size - start), b"\0")[: size - start]
            (left / file.name).write_bytes(mixed)


class Methods(Structure):
    """What SQLite calls of a file that is open (https://sqlite.org/c3ref/io_methods.html)."""

    _fields_ = [
        ("version", c_int),
        *[(name, c_void_p) for name in ("close", "read", "write", "truncate")],
        ("sync", CFUNCTYPE(c_int, c_void_p, c_int)),
        *[(f"other{n}", c_void_p) for n in range(13)],
    ]


OPEN = CFUNCTYPE(c_int, c_void_p, c_char_p, POINTER(POINTER(Methods)), c_int, POINTER(c_int))


class System(Structure):
    """How SQLite reaches files (https://sqlite.org/c3ref/vfs.html)."""

    _fields_ = [
        *[("version", c_int), ("size", c_int), ("longest", c_int), ("next", c_void_p)],
        *[("name", c_char_p), ("data", c_void_p), ("open", OPEN)],
    ]


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Callable[[Path], None]]]:
    """Call what is put into this list in place of every sync, of Python and of SQLite."""
    calls: list[Callable[[Path], None]] = []

    def sync(descriptor: int) -> None:
        for call in calls:
            call(Path(os.readlink(f"/proc/self/fd/{descriptor}")))

    monkeypatch.setattr(os, "fsync", sync)
    # With its module comes the library; in a Python that has it inside it is already there.
    library = ctypes.CDLL(getattr(import_module("_sqlite3"), "__file__", None))
    library.sqlite3_vfs_find.restype = POINTER(System)
    system = library.sqlite3_vfs_find(None).contents
    plain_open, kept = OPEN(ctypes.cast(system.open, c_void_p).value), []

    def open_file(vfs: Any, name: bytes | None, file: Any, flags: int, out: Any) -> int:
        done: int = plain_open(vfs, name, file, flags, out)
        if done == 0 and name is not None and file[0]:
            own = Methods.from_buffer_copy(file[0].contents)

            def sync_file(handle: Any, how: int) -> int:
                for call in calls:
                    call(Path(os.fsdecode(name)))
                return 0

            own.sync = Methods._fields_[5][1](sync_file)  # type: ignore[operator]
            kept.append((own, own.sync))
            file[0] = ctypes.pointer(own)
        return done

    own_open = OPEN(open_file)
    system.open = own_open
    yield calls
    system.open = plain_open
    kept.append((own_open, None))
    _ALIVE.extend(kept)


_ALIVE: list[Any] = []  # what connections that are still open may call


class Later:
    """Stands for `threading.Timer`: what was to happen later happens when the test says so."""

    due: list[Callable[[], None]]

    def __init__(self, seconds: float, call: Callable[[], None]) -> None:
        assert seconds <= 1.0
        self.daemon = False
        self._call = call

    def start(self) -> None:
        Later.due.append(self._call)


@pytest.mark.parametrize(
    "seed", [*range(FEW), *(pytest.param(n, marks=pytest.mark.nightly) for n in range(FEW, CUTS))]
)
def test_nothing_acknowledged_is_lost(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, synced: list[Callable[[Path], None]]
) -> None:
    draw = random.Random(seed)
    Later.due = []
    monkeypatch.setattr(threading, "Timer", Later)
    left, acknowledged, turn = list(range(JOBS)), set[int](), 0
    disk = Disk(tmp_path / "0")
    disk.folder.mkdir()
    while left:
        synced[:] = [disk.sync]
        store = Store(disk.folder)
        if RUN not in store.runs():
            store.begin(META)
        written: set[int] = set()
        stop = draw.randint(0, len(left))
        for job in left[:stop]:
            store.append(RUN, result_of(job))
            written.add(job)
            if draw.random() < 0.2:  # a second has passed
                while Later.due:
                    Later.due.pop()()
                acknowledged |= written
        ended = stop == len(left) and draw.random() < 0.5
        if ended:
            store.end(RUN, {"finished": "2026-01-01T00:00:09+00:00", "interrupted": False})
            acknowledged |= written
        turn += 1
        disk.cut(draw, tmp_path / str(turn))
        Later.due = []
        disk = Disk(tmp_path / str(turn))
        for file in disk.folder.iterdir():  # what is there after the cut is on the disk
            disk.content[str(file.stat().st_ino)] = file.read_bytes()
            disk.names.add(file.name)
        synced[:] = [disk.sync]
        again = Store(disk.folder)
        found = {one.seed: one for one in again.by_key().values()} if again.files else {}
        assert acknowledged <= set(found)
        for one in found.values():
            assert one.blocks == result_of(one.seed).blocks
        if again.files and RUN in again.runs():
            notes = again.load(RUN).meta["notes"]
            assert all("left out" not in note and "damaged" not in note for note in notes)
        if ended:
            assert again.load(RUN).meta["interrupted"] is False
        left = [job for job in range(JOBS) if job not in found]
