"""The store of results, data frames and JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from femubench import InputError
from femubench.core.run.frames import modes_frame
from femubench.core.schema.results import Block, JobResult, RunData, Status
from femubench.core.score.ranking import rank_results
from femubench.results import PairedMode, Store, run_from_json, run_to_json
from tests.command import run_python

MODES = (
    PairedMode(1, 100.0, 103.0, 0.99),
    PairedMode(2, 200.0, None, None),
    PairedMode(3, 300.0, -40.0, 0.7, "mass at C"),
)
GOOD = JobResult(
    "corner",
    "softer",
    0,
    "ok",
    seconds=0.25,
    blocks={"used": Block(3.0, 0.99, MODES[:2]), "modified": Block(100.0, None, MODES[2:])},
    rigid_body_modes=2,
    rigid_body_modes_expected=3,
    negative_eigenvalues=0,
    parameter_count=1,
    evaluations=4,
    parameters=({"name": "E", "before": 1.0, "after": 0.9, "unit": "", "std": None},),
    history=({"residual": 0.5},),
    diagnostics={"rank": 3.0},
)
BAD = JobResult("corner", "failing", 0, "failed", reason="residual 0.25", traceback="Traceback ...")
META = {
    "run": "20260101T000000Z-000000",
    "seed": 0,
    "seeds": [0],
    "reference": {"corner": {"used": 6.0, "modified": 50.0}},
}


def with_models() -> dict[str, Any]:
    """Return the meta data with what the results are measured by."""
    import scored  # not where a process of its own reads this file

    return {**META, "models": {"corner": {"drawn": scored.plain(GOOD.blocks)}}}


def stored(
    folder: Path,
    run_id: str = "20260101T000000Z-000000",
    results: Sequence[JobResult] = (GOOD, BAD),
) -> Store:
    store = Store(folder)
    store.begin({**META, "run": run_id})
    for item in results:
        store.append(run_id, item)
    store.end(run_id, {"finished": "2026-01-01T00:00:09+00:00", "interrupted": False})
    return store


def test_what_goes_in_comes_out_with_gains_and_ranks(tmp_path: Path) -> None:
    run = stored(tmp_path / "new" / "folder").load()
    assert run.results == rank_results([GOOD, BAD], META)
    assert {**META, "finished": "2026-01-01T00:00:09+00:00"}.items() <= run.meta.items()
    assert run.meta["notes"] == []


def test_results_stand_in_the_order_of_the_jobs_whichever_ended_first(tmp_path: Path) -> None:
    meta = {**META, "cases": {"b": {}, "a": {}}, "strategies": ["z", "y"], "seeds": [1, 0]}
    jobs = [(c, seed, s) for c in ("b", "a") for seed in (1, 0) for s in ("z", "y")]
    unknown = ("c", 0, "z")
    store = Store(tmp_path)
    store.begin(meta)
    for case, seed, strategy in [unknown, *reversed(jobs)]:
        store.append(META["run"], replace(GOOD, case=case, seed=seed, strategy=strategy))
    loaded = store.load().results
    assert [(r.case, r.seed, r.strategy) for r in loaded] == [*jobs, unknown]


def test_the_latest_run_is_the_default_and_others_go_by_id(tmp_path: Path) -> None:
    stored(tmp_path, "20260101T000000Z-aaaaaa")
    store = stored(tmp_path, "20260102T000000Z-bbbbbb", [GOOD])
    assert store.runs() == ("20260101T000000Z-aaaaaa", "20260102T000000Z-bbbbbb")
    assert len(store.load().results) == 1
    assert len(store.load("20260101T000000Z-aaaaaa").results) == 2
    assert len(store.load("20260101").results) == 2
    with pytest.raises(InputError, match="2 runs begin with '2026'"):
        store.load("2026")
    with pytest.raises(InputError, match="no run 'x'"):
        store.load("x")


@pytest.mark.parametrize("status", ["timeout", "diverged"])
def test_a_later_failure_takes_no_result_away_and_a_later_result_counts(
    tmp_path: Path, status: Status
) -> None:
    def job(run: str, seconds: float, status: Status) -> None:
        store.begin({**META, "run": run})
        store.append(run, replace(GOOD, key="k", seconds=seconds, status=status))

    store = Store(tmp_path)
    seen = []
    for second, outcome in enumerate((status, status, "ok", status, "not-applicable", status)):
        job(f"2026010{second + 1}T000000Z-000000", second, outcome)
        seen.append((store.latest()["k"].status, store.by_key()["k"].seconds))
    first, second, *rest = seen
    assert (first, second) == ((status, 0.0), (status, 1.0))
    assert rest == [("ok", 2.0), ("ok", 2.0), ("not-applicable", 4.0), ("not-applicable", 4.0)]


def test_a_file_that_was_cut_short_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    results = [replace(GOOD, seed=seed, reason="x" * 900) for seed in range(9)]
    store = stored(tmp_path, results=results)
    (file,) = store.files
    whole = file.read_bytes()
    for size in range(0, len(whole), 700):
        file.write_bytes(whole[:size])
        assert store.faults() != []
        run = store.load()
        assert {item.seed for item in run.results} <= {*range(9)}
        assert len(run.results) >= size // 2048 - 3
        assert any("damaged" in note for note in run.meta["notes"])
    store.append(META["run"], BAD)
    assert "failing" in [item.strategy for item in store.load().results]
    assert len(store.load().results) >= 6
    store.repair(META["run"])
    store.append(META["run"], replace(BAD, seed=77))
    assert len(store.load().results) >= 7
    assert store.faults() == []


FULL = """
import errno, resource, signal, sys
from dataclasses import replace
from pathlib import Path
from femubench.core.errors import InputError
from femubench.core.run.store import Store
sys.path.insert(0, sys.argv[2])
from test_harness_store import BAD, META
store = Store(sys.argv[1])
store.begin({**META, "run": "other"})
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), resource.RLIM_INFINITY))
for seed in range(100):
    try:
        store.append(META["run"], replace(BAD, seed=seed + 1, traceback="x" * 2000))
    except InputError as error:
        print(seed, error)
        break
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
store.append(META["run"], replace(BAD, seed=1000))
store.end(META["run"], {"finished": "2026-01-01T00:00:09+00:00", "interrupted": False})
"""


def test_a_record_that_does_not_fit_on_the_disk_leaves_no_trace(tmp_path: Path) -> None:
    """Files may have so many bytes and no more, as on a full disk; then there is room again."""
    size = 60_123
    store = Store(tmp_path)
    store.begin(META)
    store.append(META["run"], GOOD)
    done = run_python("-c", FULL, tmp_path, Path(__file__).parent, size)
    count, _, message = done.stdout.strip().partition(" ")
    assert "a record cannot be written: " in message
    assert str(store.file_of(META["run"])) in message
    assert 0 <= int(count) < 99
    seeds = [item.seed for item in store.load(META["run"]).results]
    assert seeds == [0, *range(1, int(count) + 1), 1000]
    assert store.faults() == []


def test_a_full_disk_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path)
    store.begin(META)
    store.append(META["run"], GOOD)
    (writer,) = store._writers.values()
    (pages,) = writer._ask("PRAGMA page_count")
    writer._ask(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(InputError, match="cannot be written: No space left on device") as caught:
        store.append(META["run"], replace(BAD, traceback="x" * 2000))
    assert str(store.file_of(META["run"])) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert [item.strategy for item in store.load().results] == ["softer"]
    store.append(META["run"], BAD)
    assert [item.strategy for item in store.load().results] == ["softer", "failing"]


def test_a_store_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    store = Store(tmp_path / "file" / "store")
    with pytest.raises(InputError, match=r"file/store.*: .*written: Not a directory"):
        store.begin(META)
    with pytest.raises(InputError, match="written: Not a directory"), store.exclusive("r"):
        pass


def test_a_run_id_that_is_no_file_name_is_refused(tmp_path: Path) -> None:
    for name in ("../evil", "", ".hidden", "a/b"):
        with pytest.raises(InputError, match="run id"):
            Store(tmp_path / "store").begin({"run": name})
    assert list(tmp_path.iterdir()) == []


def test_many_writers_do_not_mix_their_records(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.begin(META)
    long = replace(BAD, traceback="x" * 20_000)
    with ThreadPoolExecutor(8) as pool:
        names = [f"s{i}" for i in range(64)]
        list(
            pool.map(
                lambda n: Store(tmp_path).append(META["run"], replace(long, strategy=n)), names
            )
        )
    assert {item.strategy for item in store.load().results} == set(names)


def test_json_is_the_contract_and_comes_back() -> None:
    meta = with_models()
    run = RunData(meta, rank_results([GOOD, BAD], meta))
    data = run_to_json(run)
    text = json.dumps(data, allow_nan=False)
    first, second = json.loads(text)["results"]
    required = "case strategy seed status reason seconds used higher modified rigid_body_modes"
    assert {*required.split(), "negative_eigenvalues", "gain", "rank"} <= first.keys()
    assert first["used"]["rms_percent"] == 3.0
    assert first["used"]["modes"][1].items() >= {"measured_hz": 200.0, "predicted_hz": None}.items()
    assert first["higher"] is None
    assert first["unphysical"] is True
    assert (second["status"], second["gain"], second["used"]) == ("failed", 0.0, None)
    assert run_from_json(json.loads(text)) == run


def test_numbers_that_json_does_not_know_become_null() -> None:
    odd = replace(BAD, diagnostics={"condition": np.inf}, history=({"residual": np.nan},))
    data = run_to_json(RunData({"limit": float("nan")}, (odd,)))
    json.dumps(data, allow_nan=False)
    assert data["meta"] == {"limit": None}
    assert data["results"][0]["diagnostics"] == {"condition": None}
    back = run_from_json(data).results[0]
    assert np.isnan(back.history[0]["residual"])


def test_one_row_a_mode() -> None:
    frame = modes_frame(RunData(META, (GOOD, BAD)))
    assert frame["block"].tolist() == ["used", "used", "modified"]
    assert frame["error_percent"].tolist()[0] == pytest.approx(3.0)
    assert frame["error_percent"].isna().tolist() == [False, True, True]
    assert frame["counted_percent"].tolist() == pytest.approx([3.0, 100.0, 100.0])
    assert frame["modification"].tolist()[2] == "mass at C"
    assert len(modes_frame(RunData({}, ()))) == 0
