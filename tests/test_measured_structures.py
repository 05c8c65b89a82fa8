"""Structures that were measured: their drawings, and files read where the user has them."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

import femubench
from femubench import InputError, read_case
from femubench.core.modal.eigen import solve_modes
from femubench.scenarios import HERE, OWN_FILES, femubench_scenarios
from tests.command import call_bench

LISTED = {s.name: s for s in femubench_scenarios() if s.name.startswith("tests/")}
OWN = "tests/four-storey"
DRIVEN = [name for name, scenario in LISTED.items() if "responses" in scenario.classes]


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


@pytest.mark.parametrize("name", DRIVEN)
def test_responses_are_those_of_the_structure(name: str) -> None:
    """Forces feed power in, points answer alike both ways, and resonances are the table's."""
    case = femubench.cases[name]
    frfs = case.frfs
    assert frfs is not None
    hertz, inputs = frfs.frequencies, range(len(frfs.references))
    rows = [frfs.responses.labels.index(label) for label in frfs.references.labels]
    omega = 2.0 * np.pi * hertz[:, None]
    power = (1j * omega * frfs.receptances[:, rows, inputs]).real
    noise = omega * frfs.receptance_std[:, rows, inputs]
    assert (power > -5.0 * noise).mean() > 0.99
    assert (power > 5.0 * noise).any(axis=0).all()
    square = frfs.values[:, rows]
    apart = np.abs(square - square.swapaxes(1, 2)).max(axis=(1, 2))
    assert np.median(apart / np.abs(square).max(axis=(1, 2))) < 0.03
    size = np.linalg.norm(frfs.values, axis=(1, 2))
    for measured in case.measurement.frequencies:
        near = np.abs(hertz / measured - 1.0) < 0.1
        assert hertz[near][size[near].argmax()] == pytest.approx(measured, rel=0.02)
    assert case.used_measurement().responses is not None


def test_no_force_acts_at_a_held_out_sensor(tmp_path: Path) -> None:
    """The others would say by reciprocity what it reads."""
    hidden = 'held_out_sensors = ["floor-{}:x"]'.format
    for path in (HERE / "tests" / "southampton-frame").iterdir():
        text = path.read_text().replace(hidden(2), hidden(1))
        (tmp_path / path.name).write_text(text)
    with pytest.raises(InputError, match="a force acts at 'floor-1:x'"):
        read_case(tmp_path)
