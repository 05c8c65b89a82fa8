"""Measured frequency responses in a case: read, drawn as they are, kept from strategies."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import femubench
from femubench import (
    Case,
    InputError,
    Measurement,
    Model,
    Sensors,
    Strategy,
    UpdateResult,
    read_case,
)
from femubench.core.case.response_files import responses_npz
from femubench.core.case.writing import write_case
from femubench.core.drawing.prediction import drive_sensor, frequency_axis, list_receptances
from femubench.core.study.conditions import vary_case
from femubench.core.twin.twins import twins_of
from femubench.modal import FrequencyResponses, receptance

DRIVEN = 4


@pytest.fixture(scope="module")
def plain() -> Case:
    return femubench.cases["frame"]


@pytest.fixture
def with_frfs(plain: Case, tmp_path: Path) -> Case:
    """Give the case with accelerances of a stiffer model, which no curve of the nominal one is."""
    sensors = plain.measurement.sensors
    force = Sensors((sensors.labels[DRIVEN],), sensors.xyz[[DRIVEN]], (sensors.directions[DRIVEN],))
    hz = np.linspace(150.0, 300.0, 601)
    modes, rows = femubench.solve_modes(plain.model), plain.model.observe(sensors)
    values = receptance(modes, rows, rows[[DRIVEN]], hz, 0.01)
    values = -values * np.square(2.0 * np.pi * hz)[:, None, None]
    frfs = FrequencyResponses(sensors, force, 1.1 * hz, values, "accelerance")
    folder = tmp_path / "case"
    write_case(folder, plain)
    (folder / "measured.npz").write_bytes(responses_npz(frfs))
    toml = folder / "case.toml"
    text = toml.read_text(encoding="utf-8")
    toml.write_text(text.replace("[measurement]", '[measurement]\nfrfs = "measured.npz"'), "utf-8")
    return read_case(folder)


def test_a_case_has_its_responses(with_frfs: Case, plain: Case) -> None:
    assert with_frfs.frfs is not None
    assert with_frfs.frfs.quantity == "accelerance"
    assert with_frfs.frfs.responses.xyz == pytest.approx(plain.measurement.sensors.xyz)
    assert with_frfs.digest != plain.digest
    assert "accelerance of 13 responses to 1 force" in str(with_frfs)
    assert plain.frfs is None


def test_strategies_see_no_response(with_frfs: Case) -> None:
    """They hold the held-out modes."""
    assert with_frfs.used_measurement().responses is None


USED, HIDDEN = "used = [[170, 190], [210.0, 250]]", "{label!r}"
SPLIT = f"{USED}, held_out = [[260, 280]], held_out_sensors = [{HIDDEN}], std = 0.02, floor = 1e-9"


def split_case(case: Case, keys: str) -> Case:
    """Return a case whose responses are split by keys, with the label of its last sensor."""
    words = keys.format(label=case.measurement.sensors.labels[-1])
    toml = case.folder / "case.toml"
    text = toml.read_text("utf-8")
    text = text.replace("[measurement]", f"[measurement]\nresponses = {{{words}}}", 1)
    toml.write_text(text, "utf-8")
    return read_case(case.folder)


@dataclass(frozen=True)
class Snoop(Strategy):
    """Searches all that it is given for numbers that it must not have."""

    name: ClassVar[str] = "snoop"
    citation: ClassVar[str] = "none"

    hidden: tuple[complex, ...] = ()

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        content = pickle.dumps((model, measurement))
        held = [v for v in self.hidden if np.complex128(v).tobytes() in content]
        given = measurement.responses
        assert given is not None
        return UpdateResult(model, diagnostics={"seen": len(held), "lines": len(given.frequencies)})


@pytest.mark.slow(20)
def test_a_strategy_finds_no_response_that_is_held_out(with_frfs: Case) -> None:
    """Neither in what it is handed in this process nor in the isolated job of a run."""
    case = split_case(with_frfs, SPLIT)
    frfs = case.frfs
    assert frfs is not None
    assert case.split is not None
    lines = [np.flatnonzero(frfs.frequencies >= hz)[5] for hz in (150.0, 200.0, 260.0)]
    hidden = [frfs.values[line, 2, 0] for line in lines] + [frfs.values[40, -1, 0]]
    given = case.used_measurement().responses
    assert given is not None
    assert (len(given.responses), given.values.base) == (12, None)
    shown = frfs.values[np.flatnonzero(frfs.frequencies > 215.0)[0], 2, 0]
    spies = [Snoop(hidden=tuple(map(complex, hidden))), Snoop(hidden=(complex(shown),))]
    for spy, seen in zip(spies, (0.0, 1.0), strict=True):
        run = femubench.rank([case.folder], [spy], twins=0, jobs=1, nominal="drawn")
        (result,) = (r for r in run.results)
        assert result.status == "ok", result.reason
        assert result.diagnostics["seen"] == seen
        assert result.diagnostics["lines"] == len(given.frequencies)


@pytest.mark.slow(5)
def test_a_run_says_of_what_kind_responses_seem_to_be(with_frfs: Case) -> None:
    """The file has accelerances, at these lines 128 dB above receptances."""
    case = split_case(with_frfs, f'{SPLIT}, quantity = "receptance"')
    run = femubench.rank([case.folder], ["unchanged"], twins=0, jobs=1, nominal="drawn")
    (note,) = (note for note in run.meta["notes"] if "dB" in note)
    assert 'as if they were accelerance, not receptance: quantity = "accelerance" in' in note


def test_noise_of_a_seed_has_the_stated_deviations(with_frfs: Case) -> None:
    case = split_case(with_frfs, SPLIT)
    plain, drawn = (case.used_measurement(seed).responses for seed in (0, 1))
    assert plain is not None
    assert drawn is not None
    assert plain.deviations == pytest.approx(np.hypot(0.02 * abs(plain.values), 1e-9))
    errors = (drawn.values - plain.values) / plain.deviations
    assert np.std(errors.real) == pytest.approx(1.0, rel=0.05)
    assert np.std(errors.imag) == pytest.approx(1.0, rel=0.05)
    louder = vary_case(case, 3.0, 4).used_measurement(1).responses
    assert louder is not None
    known = [plain.responses.labels.index(label) for label in louder.responses.labels]
    assert len(known) in (8, 9)  # one of the four is held out already, or none
    assert louder.deviations == pytest.approx(3.0 * plain.deviations[:, known])


def test_a_twin_has_no_responses_of_the_structure(with_frfs: Case) -> None:
    (twin,) = twins_of([split_case(with_frfs, SPLIT)], 1, 0)
    assert (twin.frfs, twin.split, twin.used_measurement(1).responses) == (None, None, None)


def test_a_case_with_split_responses_is_written_and_read_back(
    with_frfs: Case, tmp_path: Path
) -> None:
    case = split_case(with_frfs, SPLIT)
    write_case(tmp_path / "copy", case)
    back = read_case(tmp_path / "copy")
    assert back.split == case.split
    assert "used lines" in str(back)
    assert back.frfs is not None
    assert case.frfs is not None
    assert np.array_equal(back.frfs.receptance_std, case.frfs.receptance_std)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ("used = []", "one at least"),
        ("used = [[190, 170]], std = 0.01", "the band is empty"),
        ("used = [[1, 2]], std = 0.01", "no line lies in the band"),
        ("used = [[170, 200], [180, 250]], std = 0.01", "meets another"),
        ("used = [[170, 190]], held_out = [[180, 250]], std = 0.01", "meets another"),
        ("used = [[170, 190]]", "the file has no deviations"),
        ("used = [[170, 190]], std = 0.01, held_out_sensors = ['q']", "no response of 'q'"),
        ("used = [[170, 190]], std = 0.01, lines = 3", "lines"),
        ("used = [[170, 190]], std = 0.01, quantity = 'inertance'", "'inertance' is not allowed"),
        ("used = [[170, 190]], std = 0.01, factor = 0", "a number > 0"),
    ],
)
def test_a_wrong_split_is_one_line(with_frfs: Case, keys: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        split_case(with_frfs, keys)
    assert "responses" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_used_lines_have_no_resonance_that_is_held_out(with_frfs: Case) -> None:
    hertz = with_frfs.measurement.select(with_frfs.held_out).frequencies[0]
    frfs = with_frfs.frfs
    assert frfs is not None
    wide = replace(frfs, frequencies=np.linspace(100.0, 1.1 * hertz, len(frfs.frequencies)))
    (with_frfs.folder / "measured.npz").write_bytes(responses_npz(wide))
    with pytest.raises(InputError, match="have the resonance of held-out mode"):
        split_case(with_frfs, f"used = [[110, {1.01 * hertz}]], std = 0.01")


def test_the_measured_curve_is_drawn(with_frfs: Case, plain: Case) -> None:
    assert drive_sensor(with_frfs) == plain.measurement.sensors.labels[DRIVEN]
    found = list_receptances(with_frfs)
    assert found["note"].startswith("As measured.")
    levels = np.array(found["measured"][""], dtype=float)
    axis, frfs = frequency_axis(with_frfs), with_frfs.frfs
    assert frfs is not None
    inside = (axis > frfs.frequencies[0]) & (axis < frfs.frequencies[-1])
    assert np.isfinite(levels[inside][1:-1]).all()
    expected = 20.0 * np.log10(np.abs(frfs.receptances[:, DRIVEN, 0]))
    peak = axis[inside][np.argmax(levels[inside])]
    assert peak == pytest.approx(frfs.frequencies[np.argmax(expected)], abs=3.0)
    assert np.nanmax(levels) == pytest.approx(expected.max(), abs=0.06)


def test_responses_are_written_and_read_back(with_frfs: Case, tmp_path: Path) -> None:
    write_case(tmp_path / "copy", with_frfs)
    back = read_case(tmp_path / "copy").frfs
    assert back is not None
    assert with_frfs.frfs is not None
    assert np.array_equal(back.values, with_frfs.frfs.values)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"time,1:z\n0,1\n1,1\n", "motions over time"),
        (b"frequency,q:z/q:z\n1,1j\n2,1j\n", "no response belongs to a sensor"),
        (b"", "empty file"),
    ],
)
def test_a_wrong_file_is_one_line(with_frfs: Case, content: bytes, says: str) -> None:
    toml = with_frfs.folder / "case.toml"
    text = toml.read_text(encoding="utf-8")
    toml.write_text(text.replace("measured.npz", "bad.csv"), "utf-8")
    (with_frfs.folder / "bad.csv").write_bytes(content)
    with pytest.raises(InputError, match=says):
        read_case(with_frfs.folder)
