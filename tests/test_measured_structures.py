"""Structures that were measured: their drawings, and files read where the user has them."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

import femubench
from femubench.core.modal.eigen import solve_modes
from femubench.scenarios import HERE, OWN_FILES, femubench_scenarios
from tests.command import call_bench

LISTED = {s.name: s for s in femubench_scenarios() if s.name.startswith("tests/")}
OWN = "tests/four-storey"


@pytest.mark.parametrize("name", [n for n, s in LISTED.items() if isinstance(s.cases[n], Path)])
def test_the_drawing_is_that_of_the_structure(name: str) -> None:
    case = femubench.cases[name]
    for change in (None, *case.modifications):
        model = case.model.attach(change.masses, ()) if change else case.model
        measured = (change or case).measurement.frequencies
        drawn = solve_modes(model).elastic.natural_frequencies[: len(measured)]
        assert np.abs(np.log(drawn / measured)).max() < 0.25, "a unit or a size is wrong"


@pytest.mark.parametrize("name", LISTED)
def test_a_page_says_what_is_stated_and_what_is_assumed(name: str) -> None:
    text = (HERE / name / "README.md").read_text()
    assert all(f"**{word}**" in text for word in ("Origin", "Stated", "Assumed", "Held out"))


def test_a_file_is_read_in_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(OWN_FILES, raising=False)
    run = ("run", "tests", "-s", "unchanged", "--nominal", "drawn", "--store", str(tmp_path))
    without, alone = (call_bench(*words, code=None) for words in (run, ("run", OWN)))
    assert (without.exit_code, alone.exit_code) == (0, 2)
    assert [line for line in without.stderr.splitlines() if OWN in line] == [
        f"bench: left out: {OWN}, {alone.stderr.removeprefix('bench: ').rstrip()}"
    ]
    data = {"test_frequency": np.arange(1.0, 5), "test_mode": np.eye(4)}
    scipy.io.savemat(tmp_path / "FourStoryStructure.mat", data)
    monkeypatch.setenv(OWN_FILES, str(tmp_path))
    assert femubench.cases[OWN].measurement.frequencies.tolist() == [1, 2, 3, 4]
