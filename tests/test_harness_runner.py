"""Runs in worker processes: every way a job can end, isolation, the store, interruption."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Never

import harness_toys as toys
import numpy as np
import pytest
from running import run_jobs

from femubench import InputError, Measurement, Model
from femubench.core.child import workers
from femubench.core.pace import Advance
from femubench.core.run.executor import LocalProcesses
from femubench.core.run.jobs import JobOutcome
from femubench.core.run.judging import judge_outcome
from femubench.core.run.runner import Plan, Receivers
from femubench.core.schema.run_options import RunOptions
from femubench.core.score.leaderboard import leaderboard
from femubench.core.score.scoring import reference_of
from femubench.results import JobResult, Store

FOLDER, NAME = "/nowhere/zq104729104729", "zq271828182845"


class Local(toys.Strategy):
    """Holds what cannot be sent to a worker."""

    name = "local"
    citation = "none"

    def __init__(self) -> None:
        self.lock = threading.Lock()  # which no process can be given

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> toys.UpdateResult:
        return toys.UpdateResult(model)


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """One run with every kind of outcome."""
    case = toys.tiny_case(NAME, folder=FOLDER)
    plain = replace(toys.tiny_case("plain"), model=toys.matrices_only(case.model))
    held_out = case.measurement.frequencies[3:]
    hashes = frozenset(toys.hashed(f) for f in held_out)
    strategies = [
        toys.Unchanged(),
        toys.Softer(),
        toys.Grounded(),
        toys.Failing(),
        toys.Exiting(7),
        toys.Exiting(0),
        toys.Exiting(-9),
        toys.Looping(),
        toys.Locked(),
        toys.Unsendable(),
        toys.OwnGeometry(),
        toys.WrongSize(),
        Local(),
    ]
    store, seen = Store(tmp_path_factory.mktemp("store")), []

    def progress(result: JobResult, done: int, total: int) -> None:
        seen.append((result.strategy, done, total))

    options = {"jobs": 2, "store": store, "seed": 11}
    run = run_jobs([case], strategies, seeds=[0], timeout=1.0, progress=progress, **options)
    calm = run_jobs([case, plain], [toys.Softer(), toys.Spy(hashes)], seeds=(0, 1), **options)
    return {"case": case, "run": run, "calm": calm, "store": store, "seen": seen}


@pytest.mark.parametrize(
    ("strategy", "status", "reason"),
    [
        ("unchanged", "ok", ""),
        ("softer", "ok", ""),
        ("grounded", "ok", ""),
        ("failing", "failed", "used modes reproduced: off by 0.25, the method promises 1e-08"),
        ("exiting-7", "crashed", "the worker process ended with exit code 7"),
        ("exiting-0", "crashed", "the worker process ended with exit code 0"),
        ("exiting--9", "crashed", "the worker process was ended by SIGKILL"),
        ("looping", "timeout", "no result within 1 s"),
        ("locked", "failed", "_LockedError"),
        ("unsendable", "failed", "mass is ndarray, expected a sparse array"),
        ("own-geometry", "ok", ""),
        ("wrong-size", "failed", "stiffness has shape"),
        ("local", "failed", "Local cannot be sent to a worker process: "),
    ],
)
def test_every_way_a_job_can_end(
    everything: dict[str, Any], strategy: str, status: str, reason: str
) -> None:
    result = next(item for item in everything["run"].results if item.strategy == strategy)
    assert result.status == status
    assert result.reason.startswith(reason)
    assert (result.reason == "") == (status == "ok")
    assert "\n" not in result.reason
    assert bool(result.blocks) == (status == "ok")
    assert result.gain == 0.0 or status == "ok"


def test_results_come_in_order_with_gains_and_ranks(everything: dict[str, Any]) -> None:
    run = everything["run"]
    assert [item.strategy for item in run.results] == run.meta["strategies"]
    assert run.meta["baseline"] == "unchanged"
    found = {item.strategy: item for item in run.results}
    assert found["unchanged"].gain == pytest.approx(0.0, abs=1e-12)
    assert found["unchanged"].rigid_body_modes == 3
    assert found["softer"].gain > 0.5
    assert (found["softer"].rank, found["unchanged"].rank) == (1, 2)
    assert found["grounded"].unphysical
    # An impossible model leaves the user with the one that was given.
    assert (found["grounded"].rank, found["grounded"].gain) == (2, 0.0)
    assert found["softer"].evaluations == 1
    assert found["looping"].seconds == 1.0
    lost = [item for item in run.results if item.status not in ("ok", "not-applicable")]
    assert {(item.rank, item.gain) for item in lost} == {(2, 0.0)}


def test_a_run_that_goes_on_tells_of_what_is_to_be_done_alone(
    everything: dict[str, Any], tmp_path: Path
) -> None:
    store, stated = Store(tmp_path), list[Advance]()
    options: dict[str, Any] = {"jobs": 1, "store": store, "overwrite": "missing"}
    run_jobs([everything["case"]], [toys.Unchanged()], **options)
    both = [toys.Unchanged(), toys.Softer()]
    plan = Plan([everything["case"]], both, RunOptions(overwrite="missing"))
    run = plan.run(LocalProcesses(1), Receivers(store, advance=stated.append))
    assert len(run.results) == 2
    assert [(advance.done, advance.total) for advance in stated] == [(0, 1), (1, 1)]
    assert [advance.left for advance in stated] == [None, 0.0]


def test_the_store_has_what_the_run_returned(everything: dict[str, Any]) -> None:
    store, runs = everything["store"], (everything["run"], everything["calm"])
    assert store.runs() == tuple(run.meta["run"] for run in runs)
    for run in runs:
        loaded = store.load(run.meta["run"])
        by_job = {(item.case, item.strategy, item.seed): item for item in loaded.results}
        assert len(by_job) == len(run.results)
        for item in run.results:
            assert by_job[item.case, item.strategy, item.seed] == item
        assert loaded.meta["interrupted"] is False
        assert loaded.meta["reference"] == run.meta["reference"]
        assert loaded.meta["cases"][NAME]["digest"] == "0123"
    table = leaderboard(store.load(runs[0].meta["run"]))
    assert table.equals(leaderboard(runs[0]))


def test_a_strategy_cannot_find_held_out_data(everything: dict[str, Any]) -> None:
    spies = [item for item in everything["calm"].results if item.strategy == "spy"]
    assert len(spies) == 4
    for item in spies:
        assert item.diagnostics["objects"] > 10_000  # it did look around
        assert (item.diagnostics["numbers"], item.diagnostics["words"]) == (0.0, 0.0)


def test_a_strategy_cannot_find_held_out_data_in_its_memory(everything: dict[str, Any]) -> None:
    case = everything["case"]
    frequencies = [float(f) for f in case.measurement.frequencies]
    changed = case.modifications[0].measurement.frequencies
    held_out = frozenset([*frequencies[3:], *map(float, changed)])
    spy = toys.Rummager(held_out, frozenset(frequencies[:3]))
    (result,) = run_jobs([case], [spy], jobs=1).results
    assert result.status == "ok", result.reason
    found = result.diagnostics
    assert found["bytes"] > 2**24  # it did look around
    assert found["used"] > 0.0  # and finds what it was given
    assert found["held_out"] == 0.0


def test_seeds_draw_noise_for_the_strategy_and_score_against_the_record(
    everything: dict[str, Any],
) -> None:
    results = [
        item
        for item in everything["calm"].results
        if (item.case, item.strategy) == (NAME, "softer")
    ]
    assert [item.seed for item in results] == [0, 1]
    values = [item.parameters[0]["after"] for item in results]
    assert values[0] != values[1]
    assert values[1] == pytest.approx(values[0], rel=0.05)
    measured = [[m.measured_hz for m in item.blocks["used"].modes] for item in results]
    assert measured[0] == measured[1] == everything["case"].measurement.frequencies[:3].tolist()


def test_what_a_case_lacks_is_not_applicable(everything: dict[str, Any]) -> None:
    found = [item for item in everything["calm"].results if item.case == "plain"]
    softer = [item for item in found if item.strategy == "softer"]
    assert {item.status for item in softer} == {"not-applicable"}
    assert {item.gain for item in softer} == {0.0}
    row = leaderboard(everything["calm"]).set_index("strategy").loc["softer"]
    assert row[["ok", "not_applicable", "total"]].tolist() == [2, 2, 4]


def test_an_interrupt_stops_the_workers_and_keeps_what_is_done(
    everything: dict[str, Any], tmp_path: Path
) -> None:
    store, case = Store(tmp_path), everything["case"]

    def interrupt(result: JobResult, done: int, total: int) -> Never:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):  # a job without a time limit would go on for ever
        run_jobs(
            [case],
            [toys.Unchanged(), toys.Looping()],
            RunOptions(timeout=None),
            jobs=2,
            store=store,
            progress=interrupt,
        )
    run = store.load()
    assert [item.strategy for item in run.results] == ["unchanged"]
    assert run.meta["interrupted"] is True
    table = leaderboard(run).set_index("strategy")
    assert table.loc["looping", "gain"] == 0.0


def test_workers_that_cannot_start_end_the_run(
    everything: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "Confinement", toys.NoStart)
    run = run_jobs([everything["case"]], [toys.Unchanged(), toys.Softer()], jobs=1)
    assert {item.status for item in run.results} == {"crashed"}
    reasons = {item.reason for item in run.results}
    assert reasons == {
        "the worker process ended with exit code 3 before it was ready: there is no room"
    }


def test_wrong_input_is_said() -> None:
    case = toys.tiny_case()
    with pytest.raises(InputError, match="case 'corner' occurs twice"):
        run_jobs([case, case], [toys.Unchanged()])
    with pytest.raises(InputError, match="strategy 'unchanged' occurs twice"):
        run_jobs([case], [toys.Unchanged(), toys.Unchanged()])
    with pytest.raises(InputError, match="0 worker processes"):
        run_jobs([case], [toys.Unchanged()], jobs=0)


def test_a_model_that_cannot_be_solved_has_failed() -> None:
    case = toys.tiny_case()
    massless = replace(case.model, mass=case.model.mass * 0.0)
    result = judge_outcome(
        case, reference_of(case), ("s", 0, "drawn"), JobOutcome("ok", model=massless)
    )
    assert result.status == "failed"
    assert result.reason


def test_a_process_that_a_strategy_started_ends_with_it(tmp_path: Path) -> None:
    file = tmp_path / "child"
    # In a sandbox it could not tell: that nothing is left there is tested with the sandbox.
    place = LocalProcesses(1, "off")
    run = run_jobs([toys.tiny_case()], [toys.Parent(str(file))], executor=place, timeout=2.0)
    assert [result.status for result in run.results] == ["timeout"]
    child = int(file.read_text())
    for _ in range(50):
        status = Path(f"/proc/{child}/status")
        if not status.exists() or "State:\tZ" in status.read_text():
            return
        time.sleep(0.1)
    pytest.fail("the child is still running")
