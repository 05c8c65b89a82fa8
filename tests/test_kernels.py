"""Nothing turns on rounding: iterations, orders, drawn cases, under other kernels of OpenBLAS."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from femubench import Measurement, Model, Sensors, diagnose, read_case
from femubench.core.challenge.draw import draw_case
from femubench.core.challenge.measuring import Ideal, record
from femubench.core.challenge.structures import structure_named
from femubench.core.fit.residuals import Data
from femubench.core.modal.correlation import find_seen_modes
from femubench.core.modal.eigen import Modes, count_evaluations, solve_modes
from femubench.core.ties import alike, by_probability, in_order, least
from femubench.core.update import residuals
from femubench.core.update.change_lists import Changes
from femubench.modal import pair_modes
from femubench.scenarios import HERE
from femubench.update import sensitivity_update

CASES = ("frame", "frame-solid", "frame-beam", "hframe", "hframe-solid")

# Prints evaluations and parameters of `global` on cases, and what the diagnosis says of one.
SCRIPT = """
import json, sys
import numpy as np
from femubench import diagnose, read_case
from femubench.core.modal.eigen import count_evaluations
from femubench.plugins.strategies.factors import Global
from femubench.scenarios import HERE

out = {}
for name in sys.argv[1:]:
    case = read_case(HERE / name)
    with count_evaluations() as counter:
        used = case.measurement.select(case.used)
        result = Global().update(case.model, used, np.random.default_rng(0))
    out[name] = counter.count, [p.after for p in result.parameters]
said = diagnose(case)
out["said"] = said.verdict, said.sentence, [c.place for c in said.causes], said.notes
out["rivals"] = [(rival.effect, rival.place) for rival in said.rivals]
print(json.dumps(out))
"""


def under(**kernel: str) -> Any:
    env = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    # The mirrored places of the solid twin tie, so that it comes last.
    names = [name for name in CASES if name != "frame-solid"] + ["frame-solid"]
    command = [sys.executable, "-c", SCRIPT, *names]
    answer = subprocess.run(
        command, env={**env, **kernel}, capture_output=True, text=True, check=True
    )
    return json.loads(answer.stdout)


@pytest.mark.nightly
def test_two_kernels_give_one_answer() -> None:
    """The processor's own and one that every x86-64 has; where there is no other, the same."""
    one, two = under(), under(OPENBLAS_CORETYPE="Nehalem")
    for name in CASES:
        assert one[name][0] == two[name][0], name
        np.testing.assert_allclose(one[name][1], two[name][1], rtol=1e-8)
    assert one["said"] == two["said"]
    assert one["rivals"] == two["rivals"]


@pytest.mark.parametrize("name", ["frame-solid", "hframe"])
def test_the_sensitivity_method_stops_where_it_would_without_rounding(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = read_case(HERE / name)
    used = case.measurement.select(case.used)
    structure = case.model.frame_structure

    def run() -> tuple[int, float]:
        with count_evaluations() as counter:
            result = sensitivity_update(structure, [Changes(structure).stiffness()], used)
        assert result.diagnostics["converged"] == 1.0
        return counter.count, result.parameters[0].after

    count, value = run()
    for seed in range(3):
        rng = np.random.default_rng(seed)

        def rounded(
            model: Model, wanted: int | None = None, rng: np.random.Generator = rng
        ) -> Modes:
            modes = solve_modes(model, wanted)
            factor = 1.0 + 1e-12 * rng.standard_normal(len(modes.eigenvalues))
            return replace(modes, eigenvalues=modes.eigenvalues * factor)

        monkeypatch.setattr(residuals, "solve_modes", rounded)
        again, other = run()
        assert again == count
        assert other == pytest.approx(value, rel=1e-8)


def test_what_ties_keeps_its_order() -> None:
    for error in (1e-9, -1e-9):
        figures = {"a": 3.0, "b": 1.0 + error, "c": 1.0, "d": 2.0, "e": 1.0 - error}
        assert in_order(figures, figures.__getitem__) == ["b", "c", "e", "d", "a"]
    assert in_order([], float) == []
    assert alike(1e4, 1e4 + 1e-4)
    assert not alike(1.0, 1.0 + 1e-4)
    costs = np.array([[2.0, 1.0 + 1e-9, 1.0], [1.0, 1.0 + 1e-9, 0.5]])
    np.testing.assert_array_equal(least(costs), [1, 2])
    assert by_probability({"x": 0.3, "y": 0.3 + 1e-12, "z": 0.4, "never": 0.0}) == [
        *("z", "x", "y", "never")
    ]


def test_a_drawn_shape_has_one_sign() -> None:
    """Two mirrored points move by as much in opposite directions."""
    specimen = structure_named("ladder")
    count = len(specimen.sensors)
    half = np.linspace(0.1, 1.0, count // 2)
    shape = np.concatenate([half, np.zeros(count % 2), -half[::-1]])[:, None]
    found = []
    for more in (1e-13, -1e-13):
        raw = shape.copy()
        raw[count // 2 - 1] *= 1.0 + more
        seen = Ideal(np.array([50.0]), raw, 1.0)
        found.append(record(seen, specimen, "A", 1, np.random.default_rng(1)).shapes)
    np.testing.assert_allclose(*found, atol=1e-9)


@pytest.mark.nightly
def test_mirrored_places_are_said_to_tie() -> None:
    """Frequencies alone cannot tell the front of a table from its back."""
    said = diagnose(draw_case(4005, "C", structure="table", effect="member-mass").case)
    places = [cause.place for cause in said.causes if cause.effect == "member-mass"]
    assert places == ["front-left"]
    assert "member-mass at front-left fits exactly as well at back-left." in said.notes


def test_frequencies_alone_pair_in_order() -> None:
    """Two modes below two others: the sums of the distances are the same either way."""
    measured = np.array([100.0, 104.0])
    nothing = np.zeros((0, 2))
    for error in (1e-15, -1e-15):
        predicted = np.array([110.0 * (1.0 + error), 118.0])
        for order in ([0, 1], [1, 0]):
            found = pair_modes(measured[order], nothing, predicted, nothing)
            assert list(predicted[found.index]) == list(predicted[order])


@pytest.fixture
def crossing() -> Measurement:
    """Two modes at four sensors; the second moves across them, and leaves rounding."""
    sensors = Sensors(tuple("abcd"), np.zeros((4, 3)), ("z",) * 4)
    shapes = np.column_stack([[1.0, 0.5, -0.5, -1.0], 1e-16 * np.array([3.0, -1.0, 2.0, 1.0])])
    deviation = 0.01 * np.abs(shapes).max(axis=0) * np.ones((4, 1))
    hertz = np.array([10.0, 20.0])
    return Measurement(sensors, (1, 2), hertz, 0.01 * hertz, np.full(2, np.nan), shapes, deviation)


def test_a_mode_that_no_sensor_sees_has_no_shape(crossing: Measurement) -> None:
    assert list(find_seen_modes(crossing.shapes)) == [True, False]
    data = Data(crossing, np.zeros(0))
    assert len(data) == 2 + 4
    assert list((data.weight > 0.0).any(axis=0)) == [True, False]
    assert not residuals.Targets(crossing, statistical=True).shape_weight[:, 1].any()
    noise = 1e-15 * np.random.default_rng(0).standard_normal((4, 4))
    predicted = np.column_stack([noise[:, 0], crossing.shapes[:, 0], noise[:, 1:]])
    hertz = np.array([9.0, 10.5, 19.0, 30.0, 31.0])
    found = pair_modes(crossing.frequencies, crossing.shapes, hertz, predicted)
    assert list(found.index) == [1, 2]
    assert found.mac[0] == pytest.approx(1.0)
    assert np.isnan(found.mac[1])


def test_a_partner_that_no_sensor_sees_predicts_no_shape(crossing: Measurement) -> None:
    data = Data(crossing, np.zeros(0))
    readings = np.column_stack([crossing.shapes[:, 1], crossing.shapes[:, 0]])[None]
    scaled, factor = data.scale(readings)
    assert factor[0, 0] == 0.0
    assert not scaled[0, :, 0].any()


def test_rigid_motions_predict_no_shape_in_any_basis(crossing: Measurement) -> None:
    data = Data(crossing, np.zeros(0))
    rng = np.random.default_rng(2)
    shapes = rng.standard_normal((4, 4))
    hertz = np.array([[1e-6, -1e-7, 12.0, 21.0]])
    turn = np.eye(4)
    turn[:2, :2] = np.linalg.qr(rng.standard_normal((2, 2)))[0]
    one, two = (data.predict(hertz, own[None], 1e-3) for own in (shapes, shapes @ turn))
    for a, b in zip(one, two, strict=True):
        np.testing.assert_allclose(a, b)
    np.testing.assert_array_equal(one[0], [[0.0, 0.0, 12.0, 21.0]])
    np.testing.assert_array_equal(one[1][0, :, 2:], shapes[:, 2:])
