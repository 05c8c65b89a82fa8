"""The budget of a search and its progress: what is left out, what is told, and when."""

from __future__ import annotations

import pytest

import femubench
from femubench.core.challenge.sweep import Task, tasks
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.errors import InputError
from femubench.core.inference.effort import Effort


def pair() -> Task:
    """Return a case with two causes that no single one explains."""
    return next(task for task in tasks() if task.key == ("pairs", 1))


def test_a_spent_budget_leaves_single_causes_and_says_so() -> None:
    case = pair().draw().case
    whole, short = diagnose(case), diagnose(case, effort=Effort(budget=0.0))
    assert len(whole.causes) == 2
    assert not any("budget" in note for note in whole.notes)
    assert len(short.causes) == 1
    assert short.chi2[1] > whole.chi2[1] + 10.0
    assert "ended after its budget of 0 s" in short.notes[-1]


def test_a_budget_that_is_not_spent_changes_nothing() -> None:
    case = pair().draw().case
    whole, limited = diagnose(case), diagnose(case, effort=Effort(budget=1e6))
    assert (limited.sentence, limited.notes) == (whole.sentence, whole.notes)


def test_fits_done_never_fall_and_end_at_all_that_are_known() -> None:
    told: list[tuple[int, int]] = []
    diagnose(pair().draw().case, effort=Effort(told=lambda *counts: told.append(counts)))
    done, known = zip(*told, strict=True)
    assert list(done) == sorted(done)
    assert all(a <= b for a, b in told)
    assert done[-1] == known[-1] > 100
    assert len(set(done)) > 10


def test_a_stage_counts_what_it_can_do_without() -> None:
    told: list[tuple[int, int]] = []
    effort = Effort(told=lambda *counts: told.append(counts))
    with effort.stage(30):
        for fits in (10, 2):
            with effort.stage(10):
                for _ in range(fits + 5):
                    effort.step()
    assert max(told) == told[-1] == (30, 30)
    assert (10, 30) in told
    assert (17, 30) in told
    assert not effort.cut


def test_a_budget_is_a_number_of_seconds() -> None:
    with pytest.raises(InputError, match=r"budget = -1.*seconds >= 0"):
        femubench.diagnose("hframe", budget=-1)
