"""The verb `advise`: which modes are measured, when it ends, what it refuses."""

from __future__ import annotations

import json
from dataclasses import replace

import diagnosis_toys as toys
import numpy as np
import pytest

from femubench.core.case.case import Case
from femubench.core.diagnosis.budget import budget_of_modes
from femubench.core.library import advise
from femubench.core.library.advise import play_advice
from femubench.core.library.cases import cases
from femubench.core.plugin.loader import list_effects, load_plugins
from tests.command import call_bench

NAME = "suite/portal"


@pytest.fixture
def verdicts(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what the search says, round by round, in place of a search of seconds."""
    words: list[str] = []

    def search(case: Case, *_: object) -> object:
        read = case.model, case.measurement, case.used
        found = budget_of_modes(*read, list_effects())
        return replace(toys.made(), verdict=words.pop(0) if words else "unknown", drawing=found)

    monkeypatch.setattr(advise, "diagnosis_of", search)
    return words


def test_loose_modes_are_measured_until_all_are_known(verdicts: list[str]) -> None:
    plugins = load_plugins()
    case = cases[NAME]
    *measured, last = play_advice(case, plugins)
    first = measured[0]
    assert first.used == tuple(case.used)
    assert last.next_mode is None
    assert {*first.used, *(one.next_mode for one in measured)} == {*last.used}
    # The stub torsion, mode 8, is looser by far than others; with it the rest is known.
    assert first.next_mode == 8
    assert np.less(last.std_percent, first.std_percent)
    assert last.unseen < first.unseen


def test_a_name_that_stands_alone_ends_it(verdicts: list[str]) -> None:
    verdicts += ["ambiguous", "named"]
    rows = json.loads(call_bench("advise", NAME, "--json", "-").stdout)["rounds"]
    assert [(row["verdict"], row["next_mode"]) for row in rows] == [
        ("ambiguous", 8),
        ("named", None),
    ]
    head, *rounds = call_bench("advise", NAME, "--rounds", 1).stdout.splitlines()
    assert head.split()[:3] == ["round", "mode", "verdict"]
    assert [row.split()[0] for row in rounds] == ["0", "1"]


def test_a_case_without_held_out_modes_is_refused(verdicts: list[str]) -> None:
    case = replace(cases[NAME], held_out=())
    with pytest.raises(advise.InputError, match=r"holds nothing back.*`held_out` modes"):
        next(play_advice(case, load_plugins()))
