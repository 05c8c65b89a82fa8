"""Expansion of measured shapes: what comes back exactly, and what rotation is for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import ortho_group

from femubench import Model, NotApplicable, solve_modes
from femubench.core.modal.expansion import (
    expand_by_dynamics,
    expand_by_rotation,
    expand_by_serep,
    find_measured_rows,
    procrustes_rotation,
    same_length,
)
from femubench.fem import FloatArray, Frame, SparseArray
from femubench.modal import mac
from tests.simulated import sensors_along

FrameBuilder = Callable[..., Frame]


def rows_of(model: Model) -> SparseArray:
    """Return the readings of sensors at the corners, the tees and the middles of all segments."""
    return model.observe(sensors_along(model.frame_structure.frame))


@pytest.fixture
def nominal(ladder: FrameBuilder) -> Model:
    return Model.of(ladder())


@pytest.fixture
def truth(asymmetric_ladder: FrameBuilder) -> Model:
    return Model.of(asymmetric_ladder(accelerometer=False))


def at_sensors(model: Model, count: int = 3) -> tuple[FloatArray, FloatArray]:
    """Return elastic modes at the thirteen points and at all dofs."""
    shapes = solve_modes(model).elastic.shapes[:, :count]
    return np.asarray(rows_of(model) @ shapes), shapes


def mixed(seed: int, analytical: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return analytical shapes turned by R', so that R turns them back."""
    rotation = ortho_group.rvs(analytical.shape[1], random_state=seed)
    return analytical @ rotation.T, rotation


def test_rotation_recovers_an_exact_mix() -> None:
    analytical = np.random.default_rng(0).standard_normal((13, 4))
    measured, rotation = mixed(0, analytical)
    found = procrustes_rotation(measured, analytical)
    np.testing.assert_allclose(found, rotation, atol=1e-12)
    np.testing.assert_allclose(measured @ found, analytical, atol=1e-12)
    # The paper prints R = V U', which turns the wrong way.
    assert np.linalg.norm(measured @ found.T - analytical) > 0.1


def test_no_orthogonal_matrix_does_better() -> None:
    rng = np.random.default_rng(0)
    analytical, measured = rng.standard_normal((2, 13, 3))
    best = procrustes_rotation(measured, analytical)
    np.testing.assert_allclose(best.T @ best, np.eye(3), atol=1e-13)
    least = np.linalg.norm(measured @ best - analytical)
    for _ in range(50):
        other = ortho_group.rvs(3, random_state=rng)
        assert np.linalg.norm(measured @ other - analytical) >= least


def test_expansion_by_rotation_returns_the_full_shapes_of_an_exact_mix(nominal: Model) -> None:
    sensors, full = at_sensors(nominal)
    # Orthonormal at the sensors, so that a mix has the same column lengths.
    basis, upper = np.linalg.qr(sensors)
    whole = full @ np.linalg.inv(upper)
    measured, rotation = mixed(1, basis)
    shapes, found = expand_by_rotation(measured * [2.0, 0.1, 5.0], basis, whole)
    aligned = same_length(measured, basis)
    np.testing.assert_allclose(rows_of(nominal) @ shapes, aligned, atol=1e-9)
    assert np.abs(np.abs(found) - np.abs(rotation)).max() < 1e-9


def test_serep_is_exact_in_the_span(nominal: Model) -> None:
    sensors, full = at_sensors(nominal, 5)
    mix = np.random.default_rng(3).standard_normal((5, 3))
    expanded = expand_by_serep(sensors @ mix, sensors, full)
    np.testing.assert_allclose(expanded, full @ mix, rtol=0, atol=1e-10 * np.abs(full).max())


def test_serep_is_the_least_squares_fit_outside_it(nominal: Model, truth: Model) -> None:
    sensors, full = at_sensors(nominal, 3)
    measured, _ = at_sensors(truth)
    expanded = rows_of(nominal) @ expand_by_serep(measured, sensors, full)
    residual = measured - expanded
    assert np.linalg.norm(residual) > 1e-3 * np.linalg.norm(measured)
    np.testing.assert_allclose(sensors.T @ residual, 0.0, atol=1e-10)


def test_dynamic_expansion_is_exact_for_the_models_own_modes(truth: Model) -> None:
    modes = solve_modes(truth).elastic
    rows = rows_of(truth)
    expanded = expand_by_dynamics(
        truth, rows, np.asarray(rows @ modes.shapes[:, :5]), modes.eigenvalues[:5]
    )
    np.testing.assert_allclose(
        expanded, modes.shapes[:, :5], rtol=0, atol=1e-8 * np.abs(modes.shapes[:, :5]).max()
    )


def test_dynamic_expansion_meets_the_readings_with_the_least_force(
    nominal: Model, truth: Model
) -> None:
    measured, _ = at_sensors(truth)
    eigenvalues = solve_modes(truth).elastic.eigenvalues[:3]
    rows = rows_of(nominal)
    expanded = expand_by_dynamics(nominal, rows, measured, eigenvalues)
    np.testing.assert_allclose(rows @ expanded, measured, atol=1e-10)
    mass, stiffness = nominal.mass.toarray(), nominal.stiffness.toarray()
    scale = 1.0 / np.sqrt(np.diagonal(stiffness))
    free = np.flatnonzero(~rows.toarray().any(axis=0))
    for j, eigenvalue in enumerate(eigenvalues):
        dynamic = (stiffness - eigenvalue * mass) * scale[:, None]
        gradient = dynamic[:, free].T @ (dynamic @ expanded[:, j])
        size = np.abs(dynamic[:, free]).T @ (np.abs(dynamic) @ np.abs(expanded[:, j]))
        assert np.abs(gradient).max() < 1e-9 * size.max()


def test_sensors_with_a_gap_are_left_out() -> None:
    shapes = np.ones((5, 2))
    shapes[1, 1] = shapes[3, 0] = np.nan
    np.testing.assert_array_equal(find_measured_rows(shapes), [True, False, True, False, True])
    with pytest.raises(NotApplicable, match="at least 2 sensors"):
        find_measured_rows(np.array([[1.0, np.nan], [np.nan, 2.0], [1.0, 1.0]]))


def test_expanded_shapes_come_nearer_to_the_truth_than_the_nominal_ones(
    nominal: Model, truth: Model
) -> None:
    """One half side is 4 % longer and one joint softer: no method may be lucky."""
    sensors, full = at_sensors(nominal)
    measured, _ = at_sensors(truth)
    shapes, _ = expand_by_rotation(measured, sensors, full)
    expanded = np.asarray(rows_of(nominal) @ shapes)
    before, after = (np.diag(mac(measured, s)) for s in (sensors, expanded))
    assert (after > before).sum() >= 2
    assert after.mean() > before.mean()
