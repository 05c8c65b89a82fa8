"""Stores with what no run wrote in them, or that may not be written: one line, the rest is read."""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from femubench.core.errors import InputError
from femubench.core.run.record_file import Record, write_file
from femubench.core.run.store import Store
from femubench.core.schema.records import encode_result
from femubench.core.schema.results import JobResult

sys.path.insert(0, str(Path(__file__).parent / "toys"))
from store_edits import edit
from test_store_damage import META, RESULTS, RUN, call, stored

# Bits of the first page: some of the definition of a table, and all but those that nothing uses.
NAMES = range(8 * 970, 8 * 974)
USED = (*range(8 * 112), *range(8 * 740, 8 * 1024))


@pytest.mark.parametrize(
    "bits",
    [pytest.param(NAMES, id="some"), pytest.param(USED, marks=pytest.mark.nightly, id="all")],
)
def test_no_bit_of_the_first_page_shuts_a_store(bits: Sequence[int], tmp_path: Path) -> None:
    store = stored(tmp_path)
    (file,) = store.files
    whole = file.read_bytes()
    for bit in bits:
        content = bytearray(whole)
        content[bit // 8] ^= 1 << bit % 8
        file.write_bytes(content)
        run = store.load()
        assert [replace(item, rank=None) for item in run.results] == list(RESULTS), bit
        assert run.meta["seeds"] == META["seeds"]
        assert store.faults(), bit
        for log in tmp_path.glob("*.sqlite-*"):
            log.unlink()


ENDLESS = (
    "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
    " SELECT i AS number, 'result' AS kind, '' AS key, 'ok' AS status, '' AS data, 0 AS checksum"
    " FROM n WHERE i < 0"
)


@pytest.mark.parametrize(
    "statements",
    [
        [f"CREATE VIEW records AS {ENDLESS}"],
        ["CREATE VIRTUAL TABLE records USING fts5(number, kind, key, status, data, checksum)"],
        ["CREATE TABLE records (number INTEGER PRIMARY KEY, kind TEXT, key TEXT, status TEXT)"],
        [],
    ],
)
def test_a_file_with_other_tables_is_one_line(statements: list[str], tmp_path: Path) -> None:
    store = stored(tmp_path)
    other = tmp_path / "zzz.sqlite"
    edit(other, *statements, "PRAGMA user_version = 7")
    before = other.read_bytes()
    (fault,) = store.faults()
    assert str(fault).startswith(f"{other}: damaged: its tables are not those of a run")
    assert store.load().meta["run"] == RUN  # no other is the latest
    assert len(store.by_key()) == len(RESULTS)
    assert "no record of a run, left alone" in call("repair", "--store", tmp_path).output
    assert other.read_bytes() == before
    with pytest.raises(InputError, match="its tables are not those of a run"):
        store.append("zzz", RESULTS[0])
    assert other.read_bytes() == before


def test_a_trigger_makes_nothing_happen(tmp_path: Path) -> None:
    store = stored(tmp_path)
    (file,) = store.files
    edit(file, "CREATE TRIGGER t AFTER INSERT ON records BEGIN DELETE FROM records; END")
    assert "its tables are not those of a run" in store.load().meta["notes"][0]
    store.append(RUN, replace(RESULTS[0], seed=2, strategy="b"))
    assert len(store.load().results) == len(RESULTS)
    with closing(sqlite3.connect(file)) as connection:
        assert connection.execute("SELECT count(*) FROM sqlite_schema").fetchone() == (2,)


def test_a_folder_and_a_wrong_time_are_a_line_each(tmp_path: Path) -> None:
    store = stored(tmp_path)
    (tmp_path / "x.sqlite").mkdir()
    (tmp_path / "nowhere.sqlite").symlink_to(tmp_path / "gone")
    os.mkfifo(tmp_path / "pipe.sqlite")
    start = json.dumps({"at": "noon", "meta": {**META, "run": "text"}}).encode()
    write_file(tmp_path / "text.sqlite", [Record("run", "", "", start)])
    faults = [str(fault).removeprefix(f"{tmp_path}/") for fault in store.faults()]
    assert faults == [
        "nowhere.sqlite: cannot be read: No such file or directory"
        " (expected a file that can be read)",
        "pipe.sqlite: is a pipe or a device (expected a regular file)",
        "text.sqlite:1: at: a text (expected a number)",
        "x.sqlite: is a folder (expected a regular file)",
    ]
    assert call("check", "--store", tmp_path).output.count("\n") == 5
    assert store.load(RUN).results
    assert len(store.by_key()) == len(RESULTS)
    assert store.latest_of_plan("none") is None
    with pytest.raises(InputError, match=r"x\.sqlite: is a folder"):
        store.load("x")
    assert call("repair", "--store", tmp_path).exit_code == 0


def test_a_repair_leaves_out_what_has_no_sense_and_keeps_every_copy(tmp_path: Path) -> None:
    store = stored(tmp_path)
    (file,) = store.files
    for turn, end in enumerate(("", "-2", "-3")):
        bad = replace(RESULTS[0], seed=50 + turn)
        data = encode_result(bad).replace(b'"status":"ok"', b'"status":"so-so"')
        with store.exclusive(RUN):
            store._add(RUN, Record("result", bad.key, "ok", data))
        before = file.read_bytes()
        output = call("repair", "--store", tmp_path).output
        assert output == (
            f"{file}: 1 fault, 1 record left out, as it was in {file.name}.damaged{end}\n"
        )
        assert file.with_name(f"{file.name}.damaged{end}").read_bytes() == before
        assert store.faults() == []
    assert len(store.load().results) == len(RESULTS)


def test_jobs_that_a_file_claims_are_counted_not_made() -> None:
    many = {f"case-{n}": {} for n in range(10**4)}
    meta = {"cases": many, "strategies": [f"s-{n}" for n in range(10**3)], "seeds": [*range(10**3)]}
    there = [JobResult("case-0", "s-0", 0, "ok"), JobResult("other", "s-0", 0, "ok")]
    assert Store.note_missing_jobs(meta, there) == (
        "9999999999 of 10000000000 jobs are missing and count as the model that was given: "
        "case-0 s-1 seed 0 drawn, case-0 s-2 seed 0 drawn, case-0 s-3 seed 0 drawn,"
        " case-0 s-4 seed 0 drawn,"
        " case-0 s-5 seed 0 drawn and 9999999994 more"
    )


NOBODY = 65534


@pytest.fixture
def public() -> Iterator[Path]:
    """Return a folder that everybody may read, unlike those of pytest."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)


def as_nobody(act: Callable[[], None]) -> int:
    """Return the exit code of a child process that does something as who owns nothing."""
    if (child := os.fork()) == 0:
        try:
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            act()
            os._exit(0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may become somebody else")
@pytest.mark.parametrize("state", ["ended", "asks for a log", "has a log"])
def test_who_may_not_write_reads_a_whole_file(state: str, public: Path) -> None:
    store = stored(public)
    (file,) = store.files
    if state == "asks for a log":
        edit(file, "PRAGMA user_version = 0", "PRAGMA journal_mode = WAL")
    elif state == "has a log":
        store.append(RUN, replace(RESULTS[0], seed=2, strategy="b"))

    def read() -> None:
        assert not os.access(public, os.W_OK)
        assert Store(public).faults() == []
        run = Store(public).load()
        assert (len(run.results), run.meta["notes"]) == (len(RESULTS), [])
        with pytest.raises(InputError, match="Permission denied"):
            Store(public).begin({**META, "run": "new"})

    names = sorted(os.listdir(public))
    assert as_nobody(read) == 0
    assert sorted(os.listdir(public)) == names


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may become somebody else")
def test_a_file_that_may_not_be_read_is_a_line(public: Path) -> None:
    store = stored(public)
    shutil.copy(*store.files, public / "zzz.sqlite")
    (public / "zzz.sqlite").chmod(0o600)

    def read() -> None:
        (fault,) = Store(public).faults()
        assert "zzz.sqlite: cannot be read: Permission denied" in str(fault)
        assert Store(public).load().meta["run"] == RUN

    assert as_nobody(read) == 0


def test_a_line_says_what_converts_runs_of_earlier_versions(tmp_path: Path) -> None:
    (tmp_path / "results.jsonl").write_text('{"schema": 1, "record": "run"}\n')
    with pytest.raises(InputError, match=r"results\.jsonl is of before 0\.2\.0.*repair"):
        Store(tmp_path).load()
