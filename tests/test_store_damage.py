"""Stores that lost bits, records, the power, the disk: all is noticed, and the rest is read."""

from __future__ import annotations

import os
import random
import signal
import sqlite3
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from store_edits import change_data, edit

from femubench.core.errors import InputError
from femubench.core.run import record_file
from femubench.core.run.store import Store
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import Block, JobResult, RunData
from tests.command import call_bench

FLIPS = 100
RUN = "20260101T000000Z-000000"
META: dict[str, Any] = {
    **{"run": RUN, "seeds": [*range(3)], "cases": {"corner": {}}, "strategies": ["a", "b"]},
    "models": {"corner": {"drawn": {"used": {"rms_percent": 2.0, "modes": []}}}},
}
RESULTS = tuple(
    JobResult(
        "corner",
        strategy,
        seed,
        "ok",
        seconds=0.25 * seed,
        blocks={"used": Block(3.0 + seed, 0.9, (PairedMode(1, 100.0, 101.0 + seed, 0.99),))},
        parameters=({"name": "E", "before": 1.0, "after": 0.9, "unit": "", "std": None},),
        history=({"residual": 0.5 / (1 + seed)},),
        key=f"{seed}{strategy}" * 8,
        provenance={"python": "3.11", "seed": seed},
    )
    for seed in range(3)
    for strategy in ("a", "b")
)


def stored(folder: Path, run_id: str = RUN) -> Store:
    store = Store(folder)
    store.begin({**META, "run": run_id})
    for result in RESULTS:
        store.append(run_id, result)
    store.end(run_id, {"finished": "2026-01-01T00:00:09+00:00", "interrupted": False})
    return store


def plain(run: RunData) -> list[JobResult]:
    return [replace(result, rank=None) for result in run.results]


def call(*words: object) -> Result:
    return call_bench("store", *words, code=None)


def test_every_flipped_bit_is_noticed_and_changes_nothing(tmp_path: Path) -> None:
    """Anywhere in the records and pictures; what is read is always what was written."""
    draw = random.Random(16)
    store = stored(tmp_path)
    store.exhibits.put("ab" * 8, {"modes": [], "mac": {"rows": [], "columns": [], "values": []}})
    (file,), (picture,) = store.files, (tmp_path / "exhibits").iterdir()
    assert store.faults() == []
    for turn in range(FLIPS):
        flipped = picture if turn % 30 == 0 else file
        content = bytearray(flipped.read_bytes())
        # Every fifth one is in the first page or the first of the tree, on which all others hang.
        place = draw.randrange(8 * (2048 if turn % 5 == 1 else len(content)))
        content[place // 8] ^= 1 << place % 8
        before, _ = flipped.read_bytes(), flipped.write_bytes(content)
        faults = store.faults()
        assert faults, f"bit {place} of {flipped.name}"
        assert all(str(flipped) in str(fault) for fault in faults)
        run = store.load()
        assert set(map(repr, plain(run))) <= set(map(repr, RESULTS))
        assert run.meta["seeds"] == META["seeds"]  # of the start there is a copy
        assert len(run.results) >= len(RESULTS) - 1
        if flipped == picture:
            assert store.exhibits.of("ab" * 8) is None
        elif plain(run) != list(RESULTS) or run.meta["finished"] is None:
            assert any("damaged" in note for note in run.meta["notes"])
        for other in tmp_path.glob("*.sqlite-*"):  # of a bit that says that there is a log
            other.unlink()
        flipped.write_bytes(before)


def test_a_lost_a_doubled_and_a_moved_record_are_noticed(tmp_path: Path) -> None:
    store = stored(tmp_path)
    (file,) = store.files
    whole = file.read_bytes()
    columns = "kind, key, status, data, checksum FROM records WHERE number"
    swapped = [f"UPDATE records SET number = {n} WHERE number = {m}" for n, m in SWAP]
    for changes, lost in (
        (["DELETE FROM records WHERE number = 5"], 1),
        ([f"INSERT INTO records SELECT 9, {columns} = 5"], 0),
        (swapped, 2),
        (["DELETE FROM records WHERE number = 1", "DELETE FROM copies"], 0),
    ):
        edit(file, *changes)
        assert store.faults() != []
        assert plain(store.load()) != list(RESULTS) or not lost
        assert len(store.load().results) == len(RESULTS) - lost
        store.repair(RUN)
        assert store.faults() == []
        assert file.with_name(f"{file.name}.damaged").exists()
        file.write_bytes(whole)


SWAP = ((100, 4), (4, 5), (5, 100))


@pytest.mark.parametrize("ended", [True, False])
def test_the_jobs_that_are_missing_are_named(ended: bool, tmp_path: Path) -> None:
    """Every deleted record, one by one, also the last one, which leaves no gap."""
    store = stored(tmp_path)
    (file,) = store.files
    whole, last = file.read_bytes(), len(RESULTS) + 2
    end = [] if ended else [f"DELETE FROM records WHERE number = {last}"]
    for place, lost in enumerate(RESULTS, 2):
        if ended and place == last - 1:  # the end takes its place
            break
        edit(file, f"DELETE FROM records WHERE number = {place}", *end)
        name = f"corner {lost.strategy} seed {lost.seed} drawn"
        said = "1 of 6 jobs are missing and count as the model that was given: "
        said = said if ended else "the run has not ended: 5 of 6 jobs are there; not run: "
        assert store.load().meta["notes"][-1] == said + name
        file.write_bytes(whole)
    edit(file, f"DELETE FROM records WHERE number BETWEEN 2 AND {last - 1}", *end)
    assert store.load().meta["notes"][-1].endswith("seed 0 drawn, corner b seed 0 drawn, corner a "
        "seed 1 drawn, corner b seed 1 drawn, corner a seed 2 drawn and 1 more")  # fmt: skip


def test_an_interrupted_run_names_what_was_not_run(tmp_path: Path) -> None:
    store = Store(tmp_path)
    about: dict[str, Any] = {"seed": 0, "number": 1, "cases": {}, "reference": {}}
    twins = {**about, "of": {"corner~1": "corner"}, "again": {"corner+": "corner"}}
    starts = {"corner": ["textbook", "drawn"]}
    store.begin({**META, "seeds": [4], "strategies": ["a"], "starts": starts, "twins": twins})
    store.append(RUN, replace(RESULTS[0], seed=4, nominal="textbook"))
    store.end(RUN, {"finished": "2026-01-01T00:00:09+00:00", "interrupted": True})
    (note,) = store.load().meta["notes"]
    others = "corner a seed 4 drawn, corner~1 a seed 4 textbook, corner+ a seed 4 textbook"
    assert note == f"the run was interrupted: 1 of 4 jobs are there; not run: {others}"


def test_check_repair_and_resume_by_the_command(tmp_path: Path) -> None:
    store = stored(tmp_path / "s")
    (file,) = store.files
    good = call("check", "--store", store.folder)
    assert (good.exit_code, good.output) == (0, f"{store.folder}: 1 run, 0 faults\n")
    change_data(file, "corner", "cornes", "number = 4")
    damaged = file.read_bytes()
    bad = call("check", "--store", store.folder)
    assert bad.exit_code == 1
    assert bad.output.splitlines()[0].startswith(f"{file}:4: damaged")
    assert len(store.by_key()) == len(RESULTS) - 1  # that one is computed again
    done = call("repair", "--store", store.folder)
    assert done.exit_code == 0
    assert f"1 fault, 1 record left out, as it was in {file.name}.damaged" in done.output
    assert file.with_name(f"{file.name}.damaged").read_bytes() == damaged
    assert call("check", "--store", store.folder).exit_code == 0
    assert [item for item in RESULTS if item not in plain(store.load())] == [RESULTS[2]]
    assert "nothing to repair" in call("repair", "--store", store.folder).output


def test_a_record_goes_into_a_damaged_file(tmp_path: Path) -> None:
    """A run goes on whatever has happened to its file."""
    store, draw = stored(tmp_path), random.Random(3)
    (file,) = store.files
    whole = file.read_bytes()
    for turn in range(18):
        content = bytearray(whole)
        # Where the trees begin, and the last page, which takes the next record.
        start = (0, 1024, len(whole) - 1024)[turn % 3]
        place = 8 * start + draw.randrange(8 * 100)
        content[place // 8] ^= 1 << place % 8
        file.write_bytes(content)
        with store.exclusive(RUN):
            store.append(RUN, replace(RESULTS[0], seed=77))
        results = plain(store.load(RUN))
        assert replace(RESULTS[0], seed=77) in results
        assert len(set(map(repr, results)) & set(map(repr, RESULTS))) >= len(RESULTS) - 1
        for other in tmp_path.glob("*.sqlite-*"):
            other.unlink()


def test_a_repair_that_fails_leaves_the_original(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = stored(tmp_path)
    (file,) = store.files
    change_data(file, "corner", "cornes")
    before = file.read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="No space left"):
        store.repair(RUN)
    assert file.read_bytes() == before
    assert [p for p in tmp_path.iterdir() if p.suffix not in (".sqlite", ".damaged")] == []


def test_a_run_that_goes_on_is_not_repaired(tmp_path: Path) -> None:
    store = stored(tmp_path)
    change_data(*store.files, "corner", "cornes")
    with store.exclusive(RUN):
        refused = call("repair", "--store", store.folder)
    assert (refused.exit_code, "another process" in refused.output) == (2, True)


_WRITERS = """
import os, sys
from femubench.core.run.store import Store
from femubench.core.schema.results import JobResult
store = Store(sys.argv[1])
for run, count in zip(sys.argv[2::2], map(int, sys.argv[3::2])):
    if os.fork():
        continue
    with store.exclusive(run):
        store.begin({"run": run})
        os.write(1, f"{run} {os.getpid()}\\n".encode())  # at once, unlike print
        for seed in range(count):
            store.append(run, JobResult("c", "s", seed, "failed", "x" * 3000))
    os._exit(0)
for _ in sys.argv[2::2]:
    os.wait()
"""


def test_processes_write_and_some_are_killed(tmp_path: Path) -> None:
    store, draw = Store(tmp_path), random.Random(3)
    counts = {"steady": 400, **dict.fromkeys(("killed-0", "killed-1", "killed-2"), 10**4)}
    words = [word for run, count in counts.items() for word in (run, str(count))]
    command = [sys.executable, "-c", _WRITERS, str(tmp_path), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writers:
        assert writers.stdout is not None
        for run, pid in (writers.stdout.readline().split() for _ in counts):
            if run != "steady":
                threading.Event().wait(draw.uniform(0.0, 0.05))
                with suppress(ProcessLookupError):  # it was faster
                    os.kill(int(pid), signal.SIGKILL)
        assert writers.wait(60) == 0
    assert [item.seed for item in store.load("steady").results] == [*range(400)]
    assert store.faults() == []
    for turn in range(3):
        run = f"killed-{turn}"
        seeds = [item.seed for item in store.load(run).results]
        assert seeds == [*range(len(seeds))]
        with store.exclusive(run):  # its lock went with the process
            store.append(run, JobResult("c", "s", 10**7, "failed", "after"))
        assert len(store.load(run).results) == len(seeds) + 1
    assert store.faults() == []


def test_a_disk_that_fails_is_reported_with_the_next_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    store.begin(META)
    ask = record_file.RecordWriter._ask

    def broken(self: record_file.RecordWriter, statement: str) -> object:
        if "checkpoint" in statement:
            raise sqlite3.OperationalError("disk I/O error")
        return ask(self, statement)

    monkeypatch.setattr(record_file.RecordWriter, "_ask", broken)
    monkeypatch.setattr(record_file, "_ON_DISK_WITHIN", 0.0)
    store.append(RUN, RESULTS[0])
    for thread in threading.enumerate():
        if isinstance(thread, threading.Timer):
            thread.join()
    with pytest.raises(InputError, match="cannot be written: disk I/O error"):
        store.append(RUN, RESULTS[1])
