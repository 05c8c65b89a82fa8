"""A zoo of hostile strategies next to good ones: each has its status, and harms no other."""

from __future__ import annotations

import json
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import harness_toys as toys
import pytest
import zoo
from running import run_jobs

from femubench.core.child import sandbox, server, workers
from femubench.core.child.guarded_child import Ending
from femubench.core.child.limits import MIB, Limits
from femubench.core.run import runner
from femubench.core.run.jobs import JobOutcome
from femubench.core.run.schedule import Workload, _Bench
from femubench.core.run.slots import Slot, Start
from femubench.core.schema.records import result_from_json, result_to_json
from femubench.core.schema.results import JobResult, RunData

pytestmark = pytest.mark.slow(20)

GOOD = (toys.Unchanged(), toys.Softer(), toys.Grounded())
MEMORY = 400 * MIB


def small(seconds: float | None, memory: int | None, **others: Any) -> Limits:
    """The same limits, and small ones on what is printed and handed back."""
    return Limits(seconds, memory, output=4 * MIB, answer=16 * MIB, **others)


@pytest.fixture(
    scope="module", params=["namespaces", pytest.param("none", marks=pytest.mark.nightly)]
)
def runs(request: pytest.FixtureRequest) -> Iterator[dict[str, RunData]]:
    """One run with the zoo and one without, both in a sandbox or both on a machine without."""
    with pytest.MonkeyPatch.context() as patch, ExitStack() as stack:
        patch.setattr(runner, "Limits", small)
        if request.param == "none":
            patch.setattr(sandbox, "missing", lambda: "there is none in this test")
        elif sandbox.missing() is not None:
            pytest.skip(f"no sandbox here: {sandbox.missing()}")
        patch.setenv("FEMUBENCH_ZOO", WORD)
        server.end_server()
        patch.setattr(zoo, "TARGET", targets(stack))
        yield both(request.param)


WORD = "a-word-in-the-environment"


def targets(stack: ExitStack) -> dict[str, Any]:
    """Put up what burglars look for."""
    port = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
    abstract = stack.enter_context(socket.socket(socket.AF_UNIX))
    abstract.bind(f"\0{zoo.MARK}-{os.getpid()}")
    abstract.listen()
    return {
        "port": port.getsockname()[1],
        "abstract": abstract.getsockname(),
        "home": str(Path.home()),
        "folder": str(Path.cwd()),
        "process": os.getpid(),
        "word": WORD,
    }


def both(how: str) -> dict[str, RunData]:
    case = toys.tiny_case()
    options: dict[str, Any] = {"timeout": 6.0, "memory": MEMORY, "seeds": (0, 1)}
    calm = run_jobs([case], GOOD, jobs=1, **options)
    animals = [animal() for animal in zoo.ANIMALS if ends(animal, how) is not None]
    mixed = [*animals[:10], *GOOD, *animals[10:]]
    wild = run_jobs([case], mixed, jobs=2, **{**options, "seeds": (0,)})
    return {"calm": calm, "wild": wild}


def ends(animal: type[zoo.Animal], how: str) -> tuple[str, str] | None:
    """How an animal ends in a sandbox or without; None where it is not let loose."""
    return animal.ends if how == "namespaces" or animal.loose == ("same", "") else animal.loose


def found(run: RunData, strategy: str) -> JobResult:
    return next(item for item in run.results if (item.strategy, item.seed) == (strategy, 0))


@pytest.mark.parametrize("animal", zoo.ANIMALS, ids=lambda animal: animal.name)
def test_every_animal_is_known_by_its_status(
    runs: dict[str, RunData], animal: type[zoo.Animal]
) -> None:
    expected = ends(animal, runs["wild"].meta["sandbox"])
    if expected is None:
        pytest.skip("it would do harm to this machine without a sandbox")
    result = found(runs["wild"], animal.name)
    status, reason = expected
    assert (result.status, result.reason[: len(reason)]) == (status, reason)
    assert "\n" not in result.reason


def test_the_good_have_the_results_that_they_have_among_themselves(
    runs: dict[str, RunData],
) -> None:
    for strategy in GOOD:
        alone, among = (found(runs[name], strategy.name) for name in ("calm", "wild"))
        same = {"seconds": 0.0, "rank": None, "provenance": {}}
        assert replace(alone, **same) == replace(among, **same)


def test_what_they_say_can_be_stored(runs: dict[str, RunData]) -> None:
    for result in runs["wild"].results:
        text = json.dumps(result_to_json(result))
        assert result_from_json(json.loads(text)).status == result.status


def test_a_judgement_out_of_bounds_ends_its_job_alone() -> None:
    record = {"case": "c", "strategy": "s", "seed": 0, "status": "ok", "parameter_count": -1}
    slot = Slot(Start("drawn", toys.tiny_case()), "s", 0, b"")
    answer = json.dumps({"result": record, "exhibit": None}).encode()
    outcome = _Bench(Workload([slot], {}, {}), iter(()))._judgement(slot, Ending("answer", answer))
    assert isinstance(outcome, JobOutcome)
    assert outcome.status == "failed"
    assert outcome.reason.startswith("its result is out of bounds: result.parameter_count")


def test_nothing_is_left_behind(runs: dict[str, RunData]) -> None:
    assert runs["wild"].results
    assert list(zoo.leftovers()) == []


def test_a_server_that_is_stopped_while_a_worker_starts_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A job may stop the server between the last look at it and the start of the next job."""
    asked = server.ForkServer.ask

    def stopped(fork: server.ForkServer, *what: Any) -> None:
        os.kill(fork.process.pid, signal.SIGSTOP)
        asked(fork, *what)

    with workers.Workers[int](1).open() as pool:
        monkeypatch.setattr(server.ForkServer, "ask", stopped)
        assert pool.start(1, bytes, b"still here", Limits(60.0)) is None
        ended: list[tuple[int, Ending]] = []
        while not ended:
            ended = pool.wait()
    assert [(key, ending.how, ending.answer) for key, ending in ended] == [
        (1, "answer", b"still here")
    ]
