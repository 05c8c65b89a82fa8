"""The budget of a search, its progress and its faults, on one case with two causes."""

from __future__ import annotations

from functools import cache

import pytest
from blind_sweep import Record, run_task, stated, tasks
from diagnosis_problems import effects_named
from true_fit import CataloguedCause, fits_worse, true_fit

import femubench
from femubench.core.challenge.draw import BlindCase
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.errors import InputError
from femubench.core.inference.effort import Effort
from femubench.core.pace import Advance
from femubench.core.plugin.loader import load_plugins

pytestmark = pytest.mark.slow(20)

TASK = next(task for task in tasks() if task.key == ("pairs", 1))
FEW = effects_named("axial-preload", "bending-torsion-coupling", "member-stiffness", "density")


@cache
def pair() -> BlindCase:
    """Return a case with two causes that no single one explains."""
    return TASK.draw()


@cache
def diagnosed(budget: float | None) -> Diagnosis:
    """Return what is said of it; without a budget only single causes are found."""
    return diagnose(pair().case, FEW, effort=Effort(budget))


@cache
def recorded(budget: float | None) -> Record:
    return run_task(TASK, lambda case: diagnosed(budget))


def test_a_spent_budget_leaves_single_causes_and_says_so() -> None:
    whole, short = diagnosed(None), diagnosed(0.0)
    assert len(whole.causes) == 2
    assert not any("budget" in note for note in whole.notes)
    assert len(short.causes) == 1
    assert short.chi2[1] > whole.chi2[1] + 10.0
    assert whole.budget
    assert not short.budget
    assert "ended after its budget of 0 s: causes" in short.notes[-1]
    assert "what the drawing lacks was not judged" in short.notes[-1]
    assert "What is always done takes" in short.notes[-1]


@pytest.mark.nightly
def test_a_budget_that_is_not_spent_changes_nothing_and_pieces_done_never_fall() -> None:
    as_stated: list[Advance] = []
    whole, limited = (
        diagnosed(None),
        diagnose(pair().case, FEW, effort=Effort(1e6, as_stated.append)),
    )
    assert (limited.sentence, limited.notes) == (whole.sentence, whole.notes)
    done = [advance.done for advance in as_stated]
    assert done == sorted(done)
    assert all(advance.done <= advance.total for advance in as_stated)
    assert done[-1] == as_stated[-1].total > 10
    assert as_stated[-1].left == 0.0
    assert as_stated[0].left is None
    known = [advance.left is not None for advance in as_stated]
    assert known == sorted(known)  # once there is a time, it stays


def test_a_search_that_finds_the_truth_has_no_fault() -> None:
    record = recorded(None)
    assert record["right"]
    leader, truth = record["leader_fit"], record["true_fit"]
    assert truth["unknowns"] == 2
    assert leader["chi2"] == pytest.approx(truth["chi2"], abs=0.1)
    assert leader["log_weight"] == pytest.approx(truth["log_weight"], abs=0.1)
    said = stated([record])
    assert len(said) == 4
    assert all(one.right and one.probability > 0.5 for one in said)


def test_a_search_that_ends_early_leaves_the_truth_better() -> None:
    """The truth needs one value more than what was found: nothing is said of the search then."""
    record = recorded(0.0)
    assert record["true_fit"]["chi2"] < record["leader_fit"]["chi2"] - 10.0
    assert record["true_fit"]["log_weight"] > record["leader_fit"]["log_weight"] + 5.0
    assert record["leader_fit"]["unknowns"] == 1
    assert fits_worse(record) is False


def test_the_truth_is_found_from_the_grid_too() -> None:
    seen, truth = diagnosed(None).examination, pair().truth
    assert seen is not None
    effects = load_plugins().effects
    causes = [[CataloguedCause(cause.effect, cause.place)] for cause in truth.causes]
    without = true_fit(seen, causes, effects, str.__eq__)
    assert without is not None
    assert without.chi2 == pytest.approx(recorded(None)["true_fit"]["chi2"], abs=0.1)
    nowhere = [[CataloguedCause(cause.effect, "nowhere")] for cause in truth.causes]
    assert true_fit(seen, nowhere, effects, str.__eq__) is None


def test_a_budget_is_a_number_of_seconds() -> None:
    with pytest.raises(InputError, match=r"budget = -1.*seconds >= 0"):
        femubench.diagnose("hframe", budget=-1)
