"""Data as residuals: what is compared with what, who is paired with whom, how noise is weighed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_problems import (
    FREQUENCY_STD,
    coordinates,
    effects_named,
    measured,
    part_at,
    problem_of,
)

from femubench import Measurement, Model, NotApplicable, Sensors, solve_modes
from femubench.core.fit.modal_fit import state_at
from femubench.core.fit.noise import Noise
from femubench.core.fit.residuals import Data
from femubench.core.inference.examine import pose_problem
from femubench.fem import Factor, FloatArray, Frame, GroundSpring, Place, Structure

FrameBuilder = Callable[..., Frame]
NOTHING = np.zeros(0)
SCATTERS, TOLERANCE = 300, 0.01


def toy(
    frequencies: list[float],
    shapes: list[list[float]],
    std: float = 0.1,
    mass: tuple[float, float] | None = None,
) -> Data:
    """Return data of a few numbers; one row of shapes a sensor."""
    f, seen = np.array(frequencies), np.array(shapes, dtype=float)
    sensors = Sensors(
        tuple(f"s{i}" for i in range(len(seen))), np.zeros((len(seen), 3)), ("z",) * len(seen)
    )
    measurement = Measurement(
        sensors,
        tuple(range(1, len(f) + 1)),
        f,
        0.01 * f,
        np.full(len(f), np.nan),
        seen,
        np.full(seen.shape, std),
        mass,
    )
    return Data(measurement, NOTHING)


def test_residuals_are_measured_minus_predicted_in_deviations() -> None:
    data = toy([10.0, 20.0], [[1.0, 1.0], [0.0, -1.0], [2.0, np.nan]], mass=(5.0, 0.5))
    frequencies = np.array([[11.0, 20.0]])
    readings = np.array([[[3.0, 2.0], [0.0, -2.0], [0.0, 9.0]]])
    found = data.residual(frequencies, readings, np.array([6.0]))[0]
    # Mode 1: (1, 0, 2) against 1/3 of (3, 0, 0); mode 2: (1, -1) is half of (2, -2).
    expected = [-10.0, 0.0, 0.0, 0.0, 20.0, 0.0, 0.0, -2.0]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert len(data) == len(expected)
    assert data.scale_count == 2


def test_no_scale_of_a_shape_fits_better_than_its_modal_scale_factor() -> None:
    rng = np.random.default_rng(1)
    data = toy([10.0], rng.standard_normal((6, 1)).tolist())
    reading = rng.standard_normal((1, 6, 1))
    scaled, factor = data.scale(reading)
    misfit = data.shapes - scaled[0]
    assert abs(float(misfit[:, 0] @ reading[0, :, 0])) < 1e-12
    best = np.square(misfit).sum()
    for share in (0.9, 0.999, 1.001, 1.1):
        assert np.square(data.shapes - share * factor[0] * reading[0]).sum() > best
    again = data.residual(np.array([[10.0]]), -7.0 * reading, np.zeros(1))
    np.testing.assert_allclose(again, data.residual(np.array([[10.0]]), reading, np.zeros(1)))


def test_what_is_not_measured_does_not_count() -> None:
    data = toy([10.0, 20.0, 30.0], [[1.0, np.nan, np.nan], [2.0, np.nan, 1.0]])
    mode, sensor = data.shape_rows
    # A shape at one sensor has a scale and nothing else.
    assert (mode.tolist(), sensor.tolist()) == ([0, 0], [0, 1])
    assert (len(data), data.scale_count) == (5, 1)
    with pytest.raises(NotApplicable, match="not every used frequency has a standard deviation"):
        Data(replace(data.measurement, frequency_std=np.array([0.1, np.nan, 0.1])), NOTHING)
    with pytest.raises(NotApplicable, match="not every used frequency has a standard deviation"):
        Data(replace(data.measurement, frequency_std=np.array([0.1, 0.0, 0.1])), NOTHING)


def test_pairing_follows_shapes_where_frequencies_have_swapped() -> None:
    shapes = np.array([[1.0, 1.0], [1.0, -1.0], [1.0, 0.5]])
    data = toy([100.0, 101.0], shapes.tolist())
    swapped = np.array([[100.2, 100.9]])
    assert data.pair(swapped, shapes[None, :, ::-1]).tolist() == [[1, 0]]
    assert data.pair(swapped, shapes[None]).tolist() == [[0, 1]]
    bare = Data(replace(data.measurement, shapes=np.full((3, 2), np.nan)), NOTHING)
    assert bare.pair(swapped, shapes[None, :, ::-1]).tolist() == [[0, 1]]


def test_no_partner_is_far_away_as_long_as_another_is_left() -> None:
    """A shape may be as good as identical to a mode at five times the frequency."""
    shapes = np.array([[1.0], [0.5], [-0.7]])
    data = toy([100.0], shapes.tolist(), std=0.001)
    far = np.hstack([shapes + 0.4 * shapes[::-1], shapes])[None]
    assert data.pair(np.array([[110.0, 150.0]]), far).tolist() == [[1]]
    assert data.pair(np.array([[110.0, 500.0]]), far).tolist() == [[0]]
    assert data.pair(np.array([[500.0]]), far[:, :, 1:]).tolist() == [[0]]


@pytest.mark.parametrize(("label", "partner"), [(0.0, 1), (0.1, 0)])
def test_a_shape_that_is_hardly_better_does_not_outweigh_much_of_a_frequency(
    label: float, partner: int
) -> None:
    """The MAC is 0.96 at the measured frequency, 0.999 at 1.8 times that; noise is 0.5 %."""
    exact = np.array([1.0, -0.5, 0.8, 0.2])
    off = [exact + size * np.array([0.1, 1.0, 0.4, -0.9]) for size in (0.2, 0.03)]
    mac = [float((exact @ o) ** 2 / (exact @ exact) / (o @ o)) for o in off]
    assert mac == pytest.approx([0.96, 0.999], abs=5e-3)
    data = replace(toy([10.0], exact[:, None].tolist(), std=0.005), shape_label=label)
    found = data.pair(np.array([[10.0, 18.0]]), np.array(off).T[None])
    assert found.tolist() == [[partner]]


def test_a_rigid_mode_that_a_spring_makes_elastic_is_paired(ladder: FrameBuilder) -> None:
    frame = ladder(accelerometer=False)
    model = Model.of(frame)
    spring = GroundSpring(Place(joint="A"), "z", 2e4)
    true = Model.of(replace(frame, springs=(spring,)))
    (effect,) = effects_named("grounding-spring")
    measurement = measured(true, frame)
    assert measurement.frequencies[0] < 0.5 * solve_modes(model).elastic.natural_frequencies[0]
    problem = problem_of(model, measurement, (effect,))
    part = part_at(problem, "grounding-spring", "A")
    state = state_at(problem, (part,), coordinates(part, (2e4,)))
    assert problem.space.rigid == 3
    # Two rigid modes remain; the first measured one is the spring's.
    assert state.partner.tolist() == [2, 3, 4, 5, 6, 7]
    assert np.abs(state.raw).max() < 1e-3
    nominal = state_at(problem, (), NOTHING)
    assert nominal.partner[0] < 3
    assert nominal.raw[0] == pytest.approx(1.0 / FREQUENCY_STD, rel=1e-3)


def test_the_mesh_correction_is_counted_from_the_first_elastic_mode() -> None:
    data = Data(toy([10.0], []).measurement, np.array([0.1, 0.2]))
    found = data.correct_for_mesh(np.array([[-3.0, 0.0, 10.0, 20.0, 30.0]]), 1.0)
    np.testing.assert_allclose(found, [[-3.0, 0.0, 11.0, 24.0, 30.0]])


def scatter(structure: Structure, rng: np.random.Generator) -> Model:
    """Return the frame with the stiffness and mass of every element scattered."""
    labels = [f"{m.name}/{k}" for m in structure.frame.members for k in range(1, m.elements + 1)]
    factors = tuple(
        Factor(quantity, (label,), float(1.0 + TOLERANCE * rng.standard_normal()))
        for label in labels
        for quantity in ("E", "density")
    )
    return Model.of(structure.rebuilt(replace(structure.frame, factors=factors)))


@pytest.fixture(scope="module")
def scatters(ladder: FrameBuilder) -> tuple[Data, Noise, FloatArray, FloatArray]:
    """Return data, noise, sensitivities, and residuals of clean ladders with scattered elements."""
    frame = ladder(accelerometer=False, elements=2)
    model = Model.of(frame)
    rng = np.random.default_rng(3)
    clean = problem_of(model, measured(model, frame), ())
    rows = []
    for _ in range(SCATTERS):
        test = measured(scatter(model.frame_structure, rng), frame, rng=rng)
        # A shape has no sign of its own: rounding would choose one, and the residuals follow it.
        turned = np.nansum(test.shapes * clean.data.measurement.shapes, axis=0) < 0.0
        test = replace(test, shapes=np.where(turned, -test.shapes, test.shapes))
        drawn = replace(clean, data=Data(test, NOTHING))
        rows.append(state_at(drawn, (), NOTHING).raw)
    problem, slopes = pose_problem(model, measured(model, frame), (), TOLERANCE)
    return problem.data, problem.noise, slopes, np.array(rows)


@pytest.mark.slow(5)
def test_scatter_has_the_covariance_that_the_noise_says(
    scatters: tuple[Data, Noise, FloatArray, FloatArray],
) -> None:
    """Along the directions in which the scatter shows most, and in which it shows nothing."""
    _, noise, slopes, rows = scatters
    size, axes = np.linalg.eigh(TOLERANCE**2 * slopes @ slopes.T)
    np.testing.assert_allclose(
        noise.factor @ noise.factor.T, np.eye(len(size)) + (axes * size) @ axes.T, atol=1e-9
    )
    assert size[-1] > 4.0
    deviation = np.sqrt(2.0 / SCATTERS)
    for k in range(1, 7):
        along = rows @ axes[:, -k]
        expected = 1.0 + size[-k]
        assert np.mean(np.square(along)) == pytest.approx(expected, rel=4.0 * deviation), k


def test_chi_square_of_scattered_frames_is_the_number_of_data(
    scatters: tuple[Data, Noise, FloatArray, FloatArray],
) -> None:
    data, noise, _, rows = scatters
    chi2 = np.square(noise.whiten(rows)).sum(axis=1)
    expected = len(data) - data.scale_count
    error = np.sqrt(2.0 * expected / SCATTERS)
    assert chi2.mean() == pytest.approx(expected, abs=3.0 * error)
    assert chi2.var() == pytest.approx(2.0 * expected, rel=0.35)
    # Without the scatter in the noise the same data would be refused.
    assert np.square(rows).sum(axis=1).mean() > expected + 10.0 * error


def test_other_deviations_are_weighed_as_with_a_covariance_of_their_own() -> None:
    """A few by a change of low rank, many by their own factor, none as they are."""
    rng = np.random.default_rng(7)
    shared = rng.standard_normal((30, 12))
    covariance = np.eye(30) + shared @ shared.T
    noise = Noise(np.linalg.cholesky(covariance), rng.standard_normal(30))
    ratios = np.ones((4, 30))
    ratios[1, [3, 9]] = 1e-3, 7.0
    ratios[2, 4:9] = 0.2
    ratios[3, 2:] = 1.0 / 3.0
    rows = rng.standard_normal((4, 30))
    chi2, log_det = noise.reweigh(rows, ratios)
    for i, ratio in enumerate(ratios):
        # Measurement has unit deviations in units of its own; the rest keeps its size.
        own = np.diag(1.0 / np.square(ratio)) + shared @ shared.T
        assert chi2[i] == pytest.approx(rows[i] @ np.linalg.solve(own, rows[i]), rel=1e-9)
        assert log_det[i] == pytest.approx(0.5 * np.linalg.slogdet(own)[1], rel=1e-9)
