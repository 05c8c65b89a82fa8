"""One job at a time, in this process: statuses, counts, randomness, checks of what comes back."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import harness_toys as toys
import numpy as np
import pytest
import scipy.sparse as sp

from femubench import Measurement, Model, Strategy, StrategyFailure
from femubench.core.run.jobs import Job, execute, missing_capability, seed_words
from femubench.core.run.model_checks import check_model
from femubench.fem import LowRank, SparseArray

CASE = toys.tiny_case()


def job(
    strategy: Strategy,
    model: Model | None = None,
    measurement: Measurement | None = None,
    words: tuple[int, ...] = (1, 2),
) -> Job:
    parts = (strategy, model or CASE.model, measurement or CASE.used_measurement())
    return Job(*(pickle.dumps(part) for part in parts), words)


def test_an_ok_job_returns_the_model_and_plain_figures() -> None:
    outcome = execute(job(toys.Softer()))
    assert (outcome.status, outcome.reason) == ("ok", "")
    assert outcome.evaluations == 1
    assert outcome.seconds > 0.0
    assert outcome.parameters[0]["name"] == "E"
    assert outcome.parameters[0]["after"] == pytest.approx(70 / 77, rel=0.1)
    assert outcome.history == ({"step": 1.0},)
    assert outcome.model is not None


@pytest.mark.parametrize(
    ("strategy", "status", "reason"),
    [
        (toys.Diverging(), "diverged", "step 7: the residual grew to 1e9"),
        (toys.Declining(), "not-applicable", "needs two modes of one kind"),
        (toys.Quitting(), "failed", "SystemExit: enough"),
        (toys.Interrupting(), "failed", "KeyboardInterrupt"),
        (toys.Numbers(), "failed", "TypeError: update returned int, expected UpdateResult"),
    ],
)
def test_how_a_job_ends(strategy: Strategy, status: str, reason: str) -> None:
    outcome = execute(job(strategy))
    assert (outcome.status, outcome.reason) == (status, reason)
    assert outcome.model is None
    assert "Traceback" in outcome.traceback


def test_a_strategy_that_cannot_be_unpickled_has_failed() -> None:
    outcome = execute(replace(job(toys.Unchanged()), strategy=b"no pickle"))
    assert outcome.status == "failed"
    assert outcome.reason.startswith("UnpicklingError")


def test_the_needs_of_a_strategy_are_checked_first() -> None:
    plain = toys.matrices_only(CASE.model)
    outcome = execute(job(toys.Needy(), model=plain))
    assert outcome.status == "not-applicable"
    expected = "needs geometry, and the model is a pair of matrices: kind 'frame' has them"
    assert outcome.reason == expected
    assert execute(job(toys.Needy())).status == "ok"


def test_what_counts_as_a_capability() -> None:
    used = CASE.used_measurement()
    every = frozenset({"shapes", "elements", "geometry", "joints"})
    assert missing_capability(every, CASE.model, used) is None
    blind = replace(used, shapes=np.full(used.shapes.shape, np.nan))
    assert "mode shapes" in str(missing_capability(every, CASE.model, blind))
    frame = CASE.model.frame_structure.frame
    single = replace(frame, members=frame.members[:1], joints=frame.joints[:2])
    beam = type(CASE.model).of(single)
    assert "no two members" in str(missing_capability(every, beam, used))
    with pytest.raises(ValueError, match="unknown need 'wings'"):
        missing_capability(frozenset({"wings"}), CASE.model, used)


def test_random_numbers_depend_on_case_strategy_and_seed_alone() -> None:
    def draw(*words: Any) -> float:
        return execute(job(toys.Softer(), words=seed_words(*words))).diagnostics["rng"]

    first = draw("a", "s", 0)
    assert draw("a", "s", 0) == first
    others = {draw("b", "s", 0), draw("a", "t", 0), draw("a", "s", 1)}
    assert len(others | {first}) == 4
    assert not any(str(word) in "a s 0" for word in seed_words("a", "s", 0))


def test_the_search_for_held_out_data_would_find_it() -> None:
    case = toys.tiny_case("zq123456789012", folder="zq999999999999")
    hashes = frozenset(toys.hashed(f) for f in case.measurement.frequencies[3:])
    found = toys.search([case], hashes)
    assert found["numbers"] == 2
    assert found["words"] >= 2
    given = toys.search([job(toys.Spy(hashes)), case.model, case.used_measurement()], hashes)
    assert (given["numbers"], given["words"]) == (0, 0)


def skewed(matrix: SparseArray, gap: float) -> SparseArray:
    entries = matrix.tolil()
    entries[0, 1] += gap * abs(matrix).max()
    return sp.csc_array(entries)


def spoilt(matrix: SparseArray) -> SparseArray:
    entries = matrix.copy()
    entries.data[3:5] = np.nan
    return entries


N = CASE.model.size
BASIS = np.ones((N, 2))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stiffness": sp.csc_array((N - 1, N - 1))}, "stiffness has shape .*, expected"),
        ({"mass": CASE.model.mass.toarray()}, "mass is ndarray, expected a sparse array"),
        ({"stiffness": skewed(CASE.model.stiffness, 1e-6)}, "stiffness is not symmetric: .*1e-06"),
        ({"mass": spoilt(CASE.model.mass)}, "mass has 2 entries that are not finite"),
        ({"mass": CASE.model.mass * 1j}, "mass has entries of type complex128"),
        ({"mass_change": BASIS}, "mass_change is ndarray, expected LowRank"),
        ({"mass_change": LowRank(BASIS[1:], np.eye(2))}, "mass_change: basis has shape"),
        ({"stiffness_change": LowRank(BASIS, np.eye(3))}, r"core has shape \(3, 3\), expected"),
        ({"stiffness_change": LowRank(BASIS[:, 0], np.eye(2))}, "basis has 1 dimensions"),
        (
            {"stiffness_change": LowRank(BASIS, np.array([[1.0, 0.1], [0.2, 1.0]]))},
            "stiffness_change: core is not symmetric",
        ),
        ({"stiffness_change": LowRank(BASIS * np.inf, np.eye(2))}, "not finite"),
        ({"dofs": toys.Model.of(toys.frame(4, 1e9)).dofs, "structure": None}, "degrees of freedom"),
    ],
)
def test_a_model_that_breaks_the_contract_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(StrategyFailure, match=message):
        check_model(replace(CASE.model, **changes), CASE.model)


def test_a_model_within_the_contract_passes() -> None:
    check_model(CASE.model, CASE.model)
    check_model(replace(CASE.model, stiffness=skewed(CASE.model.stiffness, 1e-10)), CASE.model)
    check_model(replace(CASE.model, mass_change=LowRank(BASIS, np.eye(2))), CASE.model)
    check_model(replace(CASE.model, mass_change=LowRank(BASIS[:, :0], np.eye(0))), CASE.model)
    check_model(toys.Model.of(toys.frame(4, 1e9)), CASE.model)
