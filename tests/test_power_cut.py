"""The power goes at any moment: what was acknowledged is there, and the run goes on."""

from __future__ import annotations

import os
import random
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from femubench.core.run.store import Store
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import Block, JobResult

RUN, JOBS = "20260101T000000Z-000000", 30
CUTS, FEW = 200, 20  # all of them in `make nightly`
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

    def sync(self, descriptor: int) -> None:
        """Take what is in a file or folder now; stands for `os.fsync`.

        Stores of earlier tests may still sync theirs, on timers of their own.
        """
        path = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        if not path.is_relative_to(self.folder.resolve()):
            return
        if path.is_dir():
            self.names |= {file.name for file in path.iterdir()}
        else:
            self.content[path.name] = path.read_bytes()

    def cut(self, draw: random.Random) -> None:
        """Lose what was not synced: all of it, its end, or pages in the middle of it."""
        for file in list(self.folder.iterdir()):
            safe, now = self.content.get(file.name, b""), file.read_bytes()
            if file.name not in self.names and draw.random() < 0.5:
                file.unlink()
                continue
            assert now.startswith(safe), "what was synced is never written again"
            loose = bytearray(now[len(safe) :][: draw.randint(0, len(now) - len(safe))])
            for start in range(0, len(loose), PAGE):
                if draw.random() < 0.3:
                    loose[start : start + PAGE] = bytes(len(loose[start : start + PAGE]))
            file.write_bytes(safe + loose)


class Later:
    """Stands for `threading.Timer`: what was to happen later happens when the test says so."""

    due: list[Callable[[], None]]

    def __init__(self, seconds: float, call: Callable[..., None], given: list[Any]) -> None:
        assert seconds <= 1.0
        self.daemon = False
        self._call = lambda: call(*given)

    def start(self) -> None:
        Later.due.append(self._call)


@pytest.mark.parametrize(
    "seed", [*range(FEW), *(pytest.param(n, marks=pytest.mark.nightly) for n in range(FEW, CUTS))]
)
def test_nothing_acknowledged_is_lost(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = random.Random(seed)
    disk = Disk(tmp_path)
    Later.due = []
    monkeypatch.setattr(os, "fsync", disk.sync)
    monkeypatch.setattr(threading, "Timer", Later)
    left, acknowledged = list(range(JOBS)), set[int]()
    while left:
        store = Store(tmp_path)
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
        disk.cut(draw)
        Later.due = []
        again = Store(tmp_path)
        found = {one.seed: one for one in again.by_key().values()} if again.files else {}
        assert acknowledged <= set(found)
        for one in found.values():
            assert one.blocks == result_of(one.seed).blocks
        if ended:
            assert again.load(RUN).meta["interrupted"] is False
        left = [job for job in range(JOBS) if job not in found]
