"""Measured frequency responses in a case: read, drawn as they are, kept from strategies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femubench
from femubench import Case, InputError, Sensors, read_case
from femubench.core.case.response_files import responses_npz
from femubench.core.case.writing import write_case
from femubench.core.drawing.prediction import drive_sensor, frequency_axis, list_receptances
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
    used = with_frfs.used_measurement()
    assert not any(isinstance(part, FrequencyResponses) for part in vars(used).values())


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
