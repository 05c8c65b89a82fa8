"""Runs that are continued, repeated and shared: what is reused, what is done again."""

from __future__ import annotations

import fcntl
import os
import random
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from running import run_jobs

from femubench.core.errors import InputError
from femubench.core.run import provenance as keys, slots, store as locks
from femubench.core.run.record_file import read_records, write_file
from femubench.core.run.store import Store
from femubench.core.schema.results import JobResult, RunData
from tests.command import run_python

sys.path.insert(0, str(Path(__file__).parent / "toys"))
import harness_toys as toys
from store_edits import change_data, records

TOYS = Path(__file__).parent / "toys"
CASE = toys.tiny_case()


def by_name(run: RunData) -> list[JobResult]:
    return sorted(run.results, key=lambda item: (item.case, item.strategy, item.seed))


def stable(run: RunData) -> list[JobResult]:
    """What of a run does not depend on when and how often it was interrupted."""
    return [replace(item, seconds=0.0, rank=None, gain=None) for item in by_name(run)]


def some(store: Store, **options: Any) -> RunData:
    strategies = [toys.Unchanged(), toys.Softer(), toys.Failing()]
    return run_jobs([CASE], strategies, jobs=2, store=store, **options)


def test_a_finished_run_is_left_as_it_is(tmp_path: Path) -> None:
    store = Store(tmp_path)
    run_jobs([CASE], [toys.Unchanged(), toys.Softer()], store=store)
    before = [item for item in records(store) if item["record"] != "end"]
    seen: list[int] = []
    again = run_jobs(
        [CASE],
        [toys.Unchanged(), toys.Softer()],
        store=store,
        resume=True,
        progress=lambda result, done, total: seen.append(done),
    )
    assert seen == [1, 2]
    assert [item for item in records(store) if item["record"] != "end"] == before
    assert by_name(again) == by_name(store.load())
    assert len(store.runs()) == 1


def test_a_failure_is_never_taken_for_a_result(tmp_path: Path) -> None:
    store = Store(tmp_path)
    some(store)
    some(store, resume=True)
    kept = [item["result"]["strategy"] for item in records(store) if item["record"] == "result"]
    assert sorted(kept) == ["failing", "failing", "softer", "unchanged"]
    assert len(store.runs()) == 1
    some(store, resume=True, overwrite="missing")
    assert len([item for item in records(store) if item["record"] == "result"]) == 4


def test_a_result_of_a_source_that_changed_has_no_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for versions, kept in (("11", True), ("12", False)):
        store, found = Store(tmp_path / versions), [*versions]

        def version(strategy: object, found: list[str] = found) -> str:
            """Asked for when the key is made, and again when the result is there."""
            return found.pop(0) if len(found) > 1 else found[0]

        monkeypatch.setattr(slots, "strategy_version", version)
        (result,) = run_jobs([CASE], [toys.Softer()], store=store, jobs=1).results
        assert bool(result.key) is kept
        assert ("changed during the run" in result.provenance["strategy"]) is not kept
        assert bool(store.by_key()) is kept


def test_a_damaged_record_keeps_nobody_from_going_on(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = some(store)
    file = store.file_of(first.meta["run"])
    change_data(file, "{", "[", "kind = 'run'")
    change_data(file, "{", "[", "CAST(data AS TEXT) LIKE '%\"softer\"%' AND kind = 'result'")
    loaded = store.load()
    assert {item.strategy for item in loaded.results} == {"unchanged", "failing"}
    lost, note = loaded.meta["notes"]
    assert lost.endswith("damaged (expected the record that was written): left out")
    assert note.startswith("1 of 3 jobs are missing and count as the model that was given: ")
    assert "softer seed 0 drawn" in note
    done: list[str] = []
    again = some(store, resume=True, progress=lambda result, *_: done.append(result.strategy))
    assert done[0] == "unchanged"  # the one that is kept
    assert stable(again) == stable(first)
    assert store.runs() == (first.meta["run"],)
    assert stable(store.load()) == stable(first)


def test_another_run_takes_results_from_the_store(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = some(store)
    done: list[JobResult] = []

    def progress(result: JobResult, count: int, total: int) -> None:
        done.append(result)

    more = run_jobs(
        [CASE],
        [toys.Grounded(), toys.Softer()],
        store=store,
        overwrite="missing",
        progress=progress,
    )
    assert [item.strategy for item in done] == ["softer", "grounded"]  # the known one at once
    known = next(item for item in first.results if item.strategy == "softer")
    taken = next(item for item in more.results if item.strategy == "softer")
    assert replace(taken, rank=None) == replace(known, rank=None)
    assert len(store.runs()) == 2
    always = run_jobs([CASE], [toys.Softer()], store=store)
    assert always.meta["run"] != more.meta["run"]


def test_what_belongs_to_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    def key(case: Any = CASE, name: str = "s", code: bytes = b"c", version: str = "1") -> str:
        return keys.job_key(case, name, code, version, 0)

    others = [
        key(replace(CASE, digest="4567")),
        key(name="t"),
        key(code=b"d"),
        key(version="2"),
        keys.job_key(CASE, "s", b"c", "1", 1),
    ]
    monkeypatch.setattr(keys, "__version__", "9.9")
    others.append(key())
    monkeypatch.undo()
    assert len({key(), *others}) == 7
    assert key() == key()
    assert keys.plan_digest(["a", "b"]) == keys.plan_digest(["b", "a"]) != keys.plan_digest(["a"])


def test_options_and_source_of_a_strategy_belong_to_its_version(tmp_path: Path) -> None:
    version = keys.strategy_version(toys.Softer())
    assert version == keys.strategy_version(toys.Unchanged())  # of one file
    for text in ("A = 1\n", "A = 2\n"):
        (tmp_path / "lone.py").write_text(text)
        found = run_python("-c", _VERSION, path=tmp_path, cwd=tmp_path).stdout
        assert found.startswith("0+")
        assert found != version
        version = found


_VERSION = """
import lone
from femubench.core.run.provenance import strategy_version
from femubench import Strategy
print(strategy_version(type("S", (Strategy,), {"__module__": "lone", "update": print})()))
"""


def test_one_process_works_on_a_run(tmp_path: Path) -> None:
    store = Store(tmp_path)
    run = some(store)
    with store.exclusive(run.meta["run"]), pytest.raises(InputError, match="another process"):
        some(store, resume=True)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == sorted(["exhibits", f"{run.meta['run']}.sqlite"])


def test_the_lock_of_an_interrupted_run_is_removed(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), Store(tmp_path).exclusive("a"):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_the_lock_of_a_file_that_was_removed_keeps_nobody_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, flock = tmp_path / "lock", fcntl.flock
    removed = iter([True, False])

    def late(descriptor: int, how: int) -> None:
        flock(descriptor, how)
        if next(removed):
            path.unlink()

    monkeypatch.setattr(fcntl, "flock", late)
    descriptor = locks.hold_lock(path)
    assert os.path.samestat(os.fstat(descriptor), path.stat())
    os.close(descriptor)


_RUN = """
import sys
sys.path.insert(0, {toys!r})
import harness_toys as toys
from running import run_jobs
from femubench.core.run.store import Store

if __name__ == "__main__":
    strategies = [toys.Unchanged(), toys.Softer()]
    cases = [toys.tiny_case(), toys.tiny_case("other", 80.0e9)]
    run_jobs(cases, strategies, seeds=range({seeds}), jobs=2, store=Store({store!r}), resume=True)
"""


def timed(script: Path) -> float:
    before = time.monotonic()
    subprocess.run([sys.executable, str(script)], check=True)
    return time.monotonic() - before


@pytest.mark.slow(40)
@pytest.mark.parametrize(
    ("kills", "jobs"), [(3, 16), pytest.param(50, 104, marks=pytest.mark.nightly)]
)
def test_a_run_that_is_killed_again_and_again_ends_like_an_undisturbed_one(
    kills: int, jobs: int, tmp_path: Path
) -> None:
    """SIGKILL of the parent at random moments; the last one is left to finish."""
    draw = random.Random(20)
    seeds = jobs // 4
    stores = {name: Store(tmp_path / name) for name in ("calm", "killed")}
    scripts = {}
    for name, store in stores.items():
        scripts[name] = tmp_path / f"{name}.py"
        text = _RUN.format(toys=str(TOYS), seeds=seeds, store=str(store.folder))
        scripts[name].write_text(text)
    whole, start = (timed(scripts["calm"]) for _ in range(2))  # the second has nothing to do
    ended_early = 0
    for _ in range(kills):
        process = subprocess.Popen([sys.executable, str(scripts["killed"])])
        try:
            # Most of the moments lie among the first jobs of a start, some before them.
            process.wait(
                draw.uniform(0.6, 1.0) * start + 0.8 / kills * draw.random() * (whole - start)
            )
            ended_early += 1
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
    assert ended_early < kills
    subprocess.run([sys.executable, str(scripts["killed"])], check=True)
    calm, killed = (stores[name].load() for name in ("calm", "killed"))
    assert len(calm.results) == jobs
    assert stable(killed) == stable(calm)
    assert len(stores["killed"].runs()) == 1
    for name in ("plan", "cases", "reference"):
        assert killed.meta[name] == calm.meta[name]
    good = [
        item["result"]["key"]
        for item in records(stores["killed"])
        if item["record"] == "result" and item["result"]["status"] == "ok"
    ]
    assert len(good) == len(set(good)) == jobs  # no result was computed twice
    names = {path.name for path in stores["killed"].folder.iterdir()}
    assert names == {"exhibits", f"{killed.meta['run']}.sqlite"}
    kept = {key for key in good if stores["killed"].exhibits.of(key) is not None}
    assert len(kept) == 4  # of the first seed: two cases, two strategies


def test_a_record_that_is_whole_but_wrong_is_computed_again(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = some(store)
    file, (row,) = (
        store.file_of(first.meta["run"]),
        [
            record
            for record in read_records(store.file_of(first.meta["run"]), [])
            if b'"softer"' in record.data and record.kind == "result"
        ],
    )
    assert b'"seconds":' in row.data
    row.data = re.sub(rb'"seconds":[0-9.e-]+', b'"seconds":"long"', row.data, count=1)
    write_file(file, [row if r.number == row.number else r for r in read_records(file, [])])
    assert len(store.latest()) == len(store.by_key()) + 1
    again = some(store, resume=True)
    assert len(again.results) == len(first.results)
    assert {item.strategy: item.status for item in again.results}["softer"] == "ok"
    jobs = [item["result"]["strategy"] for item in records(store) if "result" in item]
    assert jobs.count("softer") == 2
