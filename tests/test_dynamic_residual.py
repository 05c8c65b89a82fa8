"""The dynamic residual: against a joint fit of factors and shapes, and on exact readings."""

from __future__ import annotations

import numpy as np
import pytest
from response_problems import simulate
from scipy.optimize import least_squares

from femubench import InputError, Measurement, Model
from femubench.plugins.strategies.dynamic_residual import DynamicResidual
from femubench.update import Changes, expand_measured_shapes

FACTORS = np.array([1.12, 0.9, 1.05])


def joint_fit(model: Model, test: Measurement, error: float) -> np.ndarray:  # type: ignore[type-arg]
    """Return factors of least squares over these and all motions of all shapes, dense."""
    parts = Changes(model).parameterise("members")
    scale = 1.0 / np.sqrt(model.stiffness.diagonal())
    rows, lam = model.observe(test.sensors).toarray(), test.eigenvalues
    size = np.abs(test.shapes).max(axis=0)
    shapes, std = test.shapes / size, test.shape_std / size
    start = expand_measured_shapes(model, test)
    inertia = np.linalg.norm(scale[:, None] * (model.mass @ start) * lam, axis=0)

    def residual(z: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
        x, phi = z[:3], z[3:].reshape(start.shape)
        force = parts.at(x).stiffness @ phi - model.mass @ phi * lam
        forces = scale[:, None] * force / (error * inertia)
        missed = (rows @ phi - shapes) / std
        return np.concatenate([forces.ravel(), missed.ravel(), np.sqrt(parts.precision) * x])

    begun = np.concatenate([np.zeros(3), start.ravel()])
    found = least_squares(residual, begun, x_scale="jac", xtol=1e-12, ftol=1e-14, gtol=1e-12)
    return np.exp(found.x[:3])


def test_a_joint_fit_of_factors_and_shapes_ends_at_the_same_factors() -> None:
    model, exact = simulate(FACTORS, lines=3)
    test = exact.with_noise(np.random.default_rng(2))
    result = DynamicResidual(error=0.05, tolerance=1e-9).update(
        model, test, np.random.default_rng()
    )
    after = [p.after for p in result.parameters]
    assert result.diagnostics["converged"] == 1.0
    assert after == pytest.approx(joint_fit(model, test, 0.05), rel=1e-5)
    assert np.abs(np.log(after)).max() > 0.02  # and it moved


def test_exact_readings_give_exact_factors_and_noise_makes_all_of_them_fall() -> None:
    model, test = simulate(FACTORS, lines=3)
    met = DynamicResidual(readings="exact", error=1e-5)
    exact = [p.after for p in met.update(model, test, np.random.default_rng()).parameters]
    assert exact == pytest.approx(FACTORS, rel=1e-6)
    noisy = test.with_noise(np.random.default_rng(1))
    fallen = met.update(model, noisy, np.random.default_rng()).parameters
    weighted = DynamicResidual().update(model, noisy, np.random.default_rng()).parameters
    assert max(p.after / f for p, f in zip(fallen, FACTORS, strict=True)) < 0.6
    assert [p.after for p in weighted] == pytest.approx(FACTORS, rel=0.08)


def test_a_lost_sensor_says_nothing_and_a_wrong_option_is_one_line() -> None:
    model, test = simulate(FACTORS, lines=3)
    test.shapes[2] = np.nan
    met = DynamicResidual(readings="exact", error=1e-5)
    found = met.update(model, test, np.random.default_rng())
    assert [p.after for p in found.parameters] == pytest.approx(FACTORS, rel=1e-6)
    with pytest.raises(InputError, match="weighted or exact, not 'met'"):
        DynamicResidual(readings="met")
    with pytest.raises(InputError, match="a number > 0"):
        DynamicResidual(error=0.0)
