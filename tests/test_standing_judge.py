"""Judges that live through a run: no answer tells on the next, and a dead judge is replaced."""

from __future__ import annotations

import json
import os
import pickle
import signal
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import harness_toys as toys
import numpy as np
import psutil
import pytest
from running import run_jobs

from femubench.core.child.guarded_child import Ending, wait_for
from femubench.core.child.limits import MIB, Limits
from femubench.core.child.workers import Workers
from femubench.core.fem.model import LowRank
from femubench.core.run import schedule, standing_judge
from femubench.core.run.answers import pack_outcome
from femubench.core.run.jobs import JobOutcome
from femubench.core.run.judging import Dossier
from femubench.core.run.standing_judge import Judges
from femubench.core.score.scoring import reference_of

CASE = toys.tiny_case()
PICKLED = pickle.dumps((CASE, reference_of(CASE)))
SOFTER = replace(CASE.model, stiffness=0.9 * CASE.model.stiffness)
GOOD = pack_outcome(JobOutcome("ok", model=SOFTER, parameter_count=1), CASE.model)
LIMITS = Limits(60.0, 512 * MIB)


@pytest.fixture
def judges() -> Iterator[Judges[int]]:
    with Workers[int](1).open(), Judges[int]() as judges:
        yield judges


def ended(judges: Judges[int]) -> Ending:
    """Wait for the one answer that is being judged."""
    while judges.busy:
        for _, ending in judges.take_ended():
            return ending
        time.sleep(0.002)
    raise AssertionError("nobody is at work")


def verdict(answer: bytes, case: bytes = PICKLED) -> Dossier:
    return Dossier(case, answer, "s", 0)


def result(
    judges: Judges[int], answer: bytes, limits: Limits = LIMITS, digest: bytes = b"corner"
) -> dict[str, Any]:
    assert judges.start(0, digest, verdict(answer), limits) is None
    ending = ended(judges)
    assert ending.how == "answer", ending.reason
    found: dict[str, Any] = json.loads(ending.answer)["result"]
    return found


def process(judges: Judges[int]) -> int:
    """Return the one judge there is."""
    (judge,) = judges._idle
    return judge.process.pid


def hostile() -> Iterator[bytes]:
    """Yield answers that want to change something in anyone who reads them."""
    model, size = CASE.model, CASE.model.size
    spoilt = model.stiffness.copy()
    spoilt.data[:] = np.nan
    wild = model.stiffness.copy()
    wild.indices = np.full_like(wild.indices, 2**30)
    wide = LowRank(np.ones((size, 50)), np.eye(50))
    for changes in ({"stiffness": spoilt}, {"mass": wild}, {"mass_change": wide}):
        yield pack_outcome(JobOutcome("ok", model=replace(model, **changes)), model)
    turned = replace(model, stiffness=-1.0 * model.stiffness)
    yield pack_outcome(JobOutcome("ok", model=turned), model)
    yield from (GOOD[:n] for n in range(1, len(GOOD), 997))
    yield b"o" + pickle.dumps(os.system)
    yield b"o\0\0\0\0\0\1\0\0" + b"[" * 65536


def test_a_judge_after_hostile_answers_judges_as_a_fresh_one(judges: Judges[int]) -> None:
    fresh = result(judges, GOOD)
    first = process(judges)
    for answer in hostile():
        assert result(judges, answer)["status"] in ("ok", "failed")
        assert result(judges, GOOD) == fresh
    assert process(judges) == first


def test_a_case_goes_to_a_judge_once(judges: Judges[int]) -> None:
    fresh = result(judges, GOOD)
    assert judges.start(0, b"corner", verdict(GOOD, b"not read"), LIMITS) is None
    assert json.loads(ended(judges).answer)["result"] == fresh


def test_cases_that_are_too_many_are_sent_anew(
    judges: Judges[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(standing_judge, "_MOST_CASES", 2)
    fresh = result(judges, GOOD)
    for digest in (b"a", b"b", b"c", b"a", b"corner"):
        assert result(judges, GOOD, digest=digest) == fresh
    (judge,) = judges._idle
    assert list(judge.held) == [b"a", b"corner"]


def test_a_judge_that_dies_is_replaced(judges: Judges[int]) -> None:
    fresh = result(judges, GOOD)
    dead = process(judges)
    os.kill(dead, signal.SIGKILL)
    judges._idle[0].process.bury()
    assert result(judges, GOOD) == fresh
    assert process(judges) != dead


def test_a_judge_that_hangs_is_ended_in_time_and_replaced(judges: Judges[int]) -> None:
    fresh = result(judges, GOOD)
    stopped = process(judges)
    os.kill(stopped, signal.SIGSTOP)
    # More than a pipe holds: anyone who sends it must not wait for who does not read.
    large = GOOD + bytes(2**20)
    assert judges.start(0, b"corner", verdict(large), replace(LIMITS, seconds=1.0)) is None
    ending = ended(judges)
    assert (ending.how, ending.reason) == ("timeout", "no result within 1 s")
    assert not psutil.pid_exists(stopped)
    assert result(judges, GOOD) == fresh


def test_an_answer_is_judged_within_its_memory(judges: Judges[int]) -> None:
    size = CASE.model.size
    large = LowRank(np.zeros((size, 30 * MIB // (8 * size))), np.eye(2))
    model = replace(CASE.model, mass_change=large)
    answer = pack_outcome(JobOutcome("ok", model=model), CASE.model)
    fresh = result(judges, GOOD)
    refused = result(judges, answer, replace(LIMITS, memory=20 * MIB))
    assert (refused["status"], refused["reason"][:10]) == ("failed", "the update")
    assert "MemoryError" in refused["reason"]
    # The limit was that answer's alone.
    assert "core has shape" in result(judges, answer)["reason"]
    assert result(judges, GOOD) == fresh


def test_a_judge_that_has_grown_is_replaced(
    judges: Judges[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    size = CASE.model.size
    large = LowRank(np.ones((size, 120 * MIB // (8 * size))), np.eye(2))
    model = replace(CASE.model, mass_change=large)
    answer = pack_outcome(JobOutcome("ok", model=model), CASE.model)
    fresh = result(judges, GOOD)
    before = process(judges)
    assert "core has shape" in result(judges, answer, replace(LIMITS, memory=None))["reason"]
    assert judges._idle == []
    assert not psutil.pid_exists(before)
    assert result(judges, GOOD) == fresh


def test_a_judge_stands_apart() -> None:
    """No strategy reads its memory, and it holds nothing open but what it is asked through."""
    with Workers[int](1).open(), Judges[int]() as judges:
        judge = judges._free(b"").process
        judge.ask(toys.standing, None, LIMITS)
        while (ending := judge.progress(look=False)) is None:
            wait_for([judge], 0.1)
        judge.kill()
    assert ending.answer.split() == [b"0", b"6", b"True"]  # one lists the folder


def test_a_run_in_which_somebody_kills_judges_has_the_results_of_one_without(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    strategies, options = [toys.Unchanged(), toys.Softer()], {"jobs": 2, "seeds": range(4)}
    calm = run_jobs([CASE], strategies, **options)
    start, asked = Judges.start, list[int]()

    def killed(self: Judges[Any], key: Any, case: bytes, what: Dossier, limits: Limits) -> Any:
        found = start(self, key, case, what, limits)
        asked.append(self._at_work[-1][1].process.pid)
        if len(asked) in (2, 5):
            os.kill(asked[-1], signal.SIGKILL)
        return found

    monkeypatch.setattr(schedule.Judges, "start", killed)
    wild = run_jobs([CASE], strategies, **options)
    same = {"seconds": 0.0, "provenance": {}}
    assert len(asked) == 10
    assert not any(psutil.pid_exists(pid) for pid in asked)
    assert [replace(r, **same) for r in wild.results] == [replace(r, **same) for r in calm.results]
