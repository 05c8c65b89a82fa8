"""Stores that lost bits, records, the power, the disk: all is noticed, and the rest is read."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from femubench.core.cli.main import bench
from femubench.core.errors import InputError
from femubench.core.run import sealed_file
from femubench.core.run.store import Store
from femubench.core.run.upkeep import exported, faults_of, repair
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.records import run_from_json
from femubench.core.schema.results import Block, JobResult, Run

FLIPS = 300
RUN = "20260101T000000Z-000000"
META = {"run": RUN, "seeds": [*range(3)], "cases": {"corner": {}}, "strategies": ["a", "b"]}
RESULTS = tuple(
    JobResult(
        "corner",
        strategy,
        seed,
        "ok",
        seconds=0.25 * seed,
        blocks={"used": Block(3.0 + seed, 0.9, (PairedMode(1, 100.0, 101.0 + seed, 0.99),))},
        score=1.0,
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


def plain(run: Run) -> list[JobResult]:
    return [replace(result, rank=None) for result in run.results]


def call(*words: object) -> Result:
    return CliRunner().invoke(bench, ["store", *map(str, words)])


def test_every_flipped_bit_is_noticed_and_changes_nothing(tmp_path: Path) -> None:
    """Anywhere in the records and pictures; what is read is always what was written."""
    draw = random.Random(16)
    store = stored(tmp_path)
    store.exhibits.put("ab" * 8, {"modes": [], "mac": {"rows": [], "columns": [], "values": []}})
    (file,), (picture,) = store.files, (tmp_path / "exhibits").iterdir()
    assert faults_of(store) == []
    for turn in range(FLIPS):
        flipped = picture if turn % 30 == 0 else file
        content = bytearray(flipped.read_bytes())
        place = draw.randrange(8 * len(content))
        content[place // 8] ^= 1 << place % 8
        before, _ = flipped.read_bytes(), flipped.write_bytes(content)
        faults = faults_of(store)
        assert faults, f"bit {place} of {flipped.name}"
        assert all(str(flipped) in str(fault) for fault in faults)
        run = store.load()
        assert set(map(repr, plain(run))) <= set(map(repr, RESULTS))
        # Lost only where both records of the start have become one line.
        assert run.meta.get("seeds", META["seeds"]) == META["seeds"]
        if flipped == picture:
            assert store.exhibits.of("ab" * 8) is None
        else:
            # A line end that is lost makes one line of two.
            assert len(run.results) >= len(RESULTS) - 2
            assert run.meta["notes"]
        flipped.write_bytes(before)


def test_a_lost_a_doubled_and_a_moved_record_are_noticed(tmp_path: Path) -> None:
    store = stored(tmp_path)
    (file,) = store.files
    lines = file.read_bytes().splitlines(keepends=True)
    for changed in (
        [*lines[:5], *lines[6:]],
        [*lines[:5], lines[4], *lines[5:]],
        [*lines[:5], lines[6], lines[5], *lines[7:]],
        lines[1:],
    ):
        file.write_bytes(b"".join(changed))
        assert any("records are missing" in str(fault) for fault in faults_of(store))
        repair(store)
        assert faults_of(store) == []


def test_check_repair_and_resume_by_the_command(tmp_path: Path) -> None:
    store = stored(tmp_path / "s")
    (file,) = store.files
    good = call("check", "--store", store.folder)
    assert (good.exit_code, good.output) == (0, f"{store.folder}: 1 run, 0 faults\n")
    lines = file.read_bytes().splitlines(keepends=True)
    lines[4] = damaged = lines[4].replace(b"corner", b"cornes")
    file.write_bytes(b"".join(lines))
    bad = call("check", "--store", store.folder)
    assert bad.exit_code == 1
    assert bad.output.splitlines()[0].startswith(f"{file}:5: damaged")
    assert len(store.by_key()) == len(RESULTS) - 1  # that one is computed again
    done = call("repair", "--store", store.folder)
    assert done.exit_code == 0
    assert "8 records kept, 1 fault" in done.output
    assert file.with_name(f"{file.name}.damaged").read_bytes() == damaged
    assert call("check", "--store", store.folder).exit_code == 0
    assert [item for item in RESULTS if item not in plain(store.load())] == [RESULTS[2]]
    assert "nothing to repair" in call("repair", "--store", store.folder).output


@pytest.mark.parametrize("form", ["jsonl", "csv", "parquet"])
def test_export_writes_every_result(form: str, tmp_path: Path) -> None:
    import pandas as pd

    store, out = stored(tmp_path / "s"), tmp_path / "out"
    stored(tmp_path / "s", "20260102T000000Z-bbbbbb")
    done = call("export", "-f", form, "-o", out, "--store", store.folder)
    assert done.exit_code == 0, done.output
    assert sorted(path.stem for path in out.iterdir()) == list(store.runs())
    file = out / f"{RUN}.{form}"
    if form == "jsonl":
        records = [json.loads(line) for line in file.read_text().splitlines()]
        results = [item["result"] for item in records if item["record"] == "result"]
        assert plain(run_from_json({"meta": {}, "results": results})) == list(RESULTS)
    else:
        frame = pd.read_csv(file) if form == "csv" else pd.read_parquet(file)
        assert sorted(frame["seconds"]) == sorted(item.seconds for item in RESULTS)
    refused = call("export", "-o", store.folder, "--store", store.folder)
    assert (refused.exit_code, "is the store itself" in refused.output) == (2, True)
    none = call("check", "--store", tmp_path / "none")
    assert (none.exit_code, "no results" in none.output) == (2, True)


def test_a_repair_that_fails_leaves_the_original(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = stored(tmp_path)
    (file,) = store.files
    file.write_bytes(file.read_bytes().replace(b"corner", b"cornes", 1))
    before = file.read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="No space left"):
        repair(store)
    assert file.read_bytes() == before
    assert [p for p in tmp_path.iterdir() if p.suffix not in (".jsonl", ".damaged")] == []


def test_a_run_that_goes_on_is_not_repaired(tmp_path: Path) -> None:
    store = stored(tmp_path)
    (file,) = store.files
    file.write_bytes(file.read_bytes().replace(b"corner", b"cornes", 1))
    with store.exclusive(RUN), pytest.raises(InputError, match="another process"):
        repair(store)


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
        print(run, os.getpid(), flush=True)
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
    assert faults_of(store) == [] or all("cut short" in str(f) for f in faults_of(store))
    for turn in range(3):
        run = f"killed-{turn}"
        seeds = [item.seed for item in store.load(run).results]
        assert seeds == [*range(len(seeds))]
        with store.exclusive(run):  # its lock went with the process
            store.append(run, JobResult("c", "s", 10**7, "failed", "after"))
        assert len(store.load(run).results) == len(seeds) + 1
    assert faults_of(store) == []


def test_records_are_on_the_disk_within_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    waits: list[float] = []
    start = threading.Timer.__init__

    def timed(self: threading.Timer, seconds: float, *rest: object) -> None:
        waits.append(seconds)
        start(self, 0.0, *rest)  # type: ignore[arg-type]

    real, there = os.fsync, threading.Event()

    def fsync(descriptor: int) -> None:
        synced.append(os.fstat(descriptor).st_size)
        real(descriptor)
        there.set()

    store = Store(tmp_path)
    store.begin(META)
    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(threading.Timer, "__init__", timed)
    store.append(RUN, RESULTS[0])
    assert there.wait(30.0)
    assert waits == [1.0]
    (file,) = store.files
    assert synced == [file.stat().st_size]


def test_a_disk_that_fails_is_told_with_the_next_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = stored(tmp_path)

    def broken(path: Path) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(sealed_file, "sync", broken)
    monkeypatch.setattr(sealed_file, "_SYNCED_WITHIN", 0.0)
    store.append(RUN, RESULTS[0])
    for thread in threading.enumerate():
        if isinstance(thread, threading.Timer):
            thread.join()
    with pytest.raises(InputError, match="cannot be written: Input/output error"):
        store.append(RUN, RESULTS[1])


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_is_read(tmp_path: Path) -> None:
    store = stored(tmp_path)
    tmp_path.chmod(0o555)
    try:
        assert len(store.load().results) == len(RESULTS)
        assert faults_of(store) == []
        with pytest.raises(InputError, match="Permission denied"):
            store.begin({**META, "run": "new"})
    finally:
        tmp_path.chmod(0o755)


def test_results_come_back_whole(tmp_path: Path) -> None:
    result = stored(tmp_path).load().results[0]
    assert replace(result, rank=9).history == RESULTS[0].history
    assert result.blocks == RESULTS[0].blocks
    assert result == replace(RESULTS[0], rank=result.rank)


def test_an_export_leaves_out_what_is_damaged(tmp_path: Path) -> None:
    store = stored(tmp_path)
    (file,) = store.files
    file.write_bytes(file.read_bytes().replace(b"0.99", b"0.98", 1))
    faults: list[InputError] = []
    assert len(list(exported(store, RUN, faults))) == len(RESULTS) + 2
    assert len(faults) == 1


def test_a_comparison_tells_what_is_damaged(tmp_path: Path) -> None:
    store = stored(tmp_path)
    stored(tmp_path, "20260102T000000Z-bbbbbb")
    file = store.file_of(RUN)
    file.write_bytes(file.read_bytes().replace(b"0.99", b"0.98", 1))
    words = ["compare", RUN, "20260102T000000Z-bbbbbb", "--store", str(store.folder)]
    told = CliRunner().invoke(bench, words)
    assert told.exit_code == 0, told.output
    assert f"{file.name}:3:damaged" in "".join(told.output.split())
