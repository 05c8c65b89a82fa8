"""Modal masses of identified modes, and what they say of the mass of a structure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from response_problems import MEMBERS

import femubench
from femubench import Case, InputError, Model, solve_modes
from femubench.core.case.modes import read_modes
from femubench.core.case.records import record_tables
from femubench.core.conformance.problems import sensors_of, small_frame
from femubench.core.modal.eigen import dense_matrices
from femubench.modal import FrequencyResponses
from femubench.plugins.strategies.bayesian import Bayesian

HEAVIER = 1.15


def accelerances(model: Model, driven: int, decay: float = 0.0) -> FrequencyResponses:
    """Return those of direct solutions with proportional damping and noise, under a window."""
    sensors = sensors_of(small_frame("out-of-plane", members=MEMBERS))
    mass, stiffness = dense_matrices(model)
    rows = model.observe(sensors).toarray()
    hertz = np.linspace(5.0, 420.0, 1600)
    values = []
    for s in decay + 2j * np.pi * hertz:
        dynamic = stiffness * (1.0 + 2e-5 * s) + s * (s + 2.0) * mass
        values.append(s**2 * rows @ np.linalg.solve(dynamic, rows[[driven]].T))
    exact = np.array(values)
    noise = 0.005 * np.sqrt(np.square(np.abs(exact)).mean(axis=0))
    draws = np.random.default_rng(1).standard_normal((2, *exact.shape))
    given = exact + noise * (draws[0] + 1j * draws[1])
    force = sensors.take([driven])
    return FrequencyResponses(sensors, force, hertz, given, "accelerance", decay=decay)


@pytest.mark.parametrize("decay", [0.0, 12.0], ids=["no window", "window"])
def test_a_driven_point_gives_modal_masses(decay: float) -> None:
    model = Model.of(small_frame("out-of-plane", members=MEMBERS))
    test = accelerances(model, 0, decay)
    found = femubench.identify(test)
    modes = solve_modes(model).elastic
    near = np.abs(modes.natural_frequencies[:, None] - found.frequencies).argmin(axis=0)
    read = model.observe(found.sensors) @ modes.shapes[:, near]
    largest = np.abs(found.shapes.real).argmax(axis=0)
    exact = read[largest, np.arange(len(found))] ** -2.0
    assert found.modal_mass is not None
    known = np.isfinite(found.modal_mass)
    assert known.sum() >= 3
    assert found.modal_mass[known] == pytest.approx(exact[known], rel=0.03)
    elsewhere = replace(test, references=replace(test.references, labels=("elsewhere:z",)))
    assert femubench.identify(elsewhere).modal_mass is None


def test_the_mass_of_a_structure_that_was_not_weighed_is_that_of_its_modal_scale(
    tmp_path: Path,
) -> None:
    model = Model.of(small_frame("out-of-plane", members=MEMBERS))
    found = femubench.identify(accelerances(replace(model, mass=HEAVIER * model.mass), 0))
    for name, content in record_tables(found.measurement).items():
        (tmp_path / name).write_bytes(content)
    read = read_modes(tmp_path / "modes.csv", found.sensors, 0.015)
    np.testing.assert_array_equal(read.modal_mass, found.modal_mass)
    case = Case("heavy", "Heavy", "heavy", tmp_path, model, read, read.numbers[:4], ())
    given = case.used_measurement()
    assert given.total_mass is not None
    kg, std = given.total_mass
    assert kg == pytest.approx(HEAVIER * model.total_mass, rel=0.02)
    assert 0.05 < std / kg < 0.08  # of the calibration, and of four modes
    strategy = Bayesian()
    named = {p.name: p for p in strategy.update(model, given, np.random.default_rng(0)).parameters}
    density = named["density all members"]
    assert density.std is not None
    assert abs(density.after - HEAVIER) < 2.0 * density.std
    plain = strategy.update(model, replace(read, modal_mass=None), np.random.default_rng(0))
    assert "density all members" not in {p.name for p in plain.parameters}
    weighed = replace(read, total_mass=(3.0, 0.01))
    assert replace(case, measurement=weighed).used_measurement().total_mass == (3.0, 0.01)


def test_a_modal_mass_that_cannot_be_is_one_line(tmp_path: Path) -> None:
    sensors = sensors_of(small_frame("out-of-plane", members=MEMBERS))
    (tmp_path / "modes.csv").write_text("mode,frequency,modal_mass\n1,10.0,2.5\n2,20.0,-1\n")
    with pytest.raises(InputError, match=r"modes.csv:3: modal_mass: .*in kg"):
        read_modes(tmp_path / "modes.csv", sensors, 0.015)
