"""Least squares with more unknowns than data give what dense matrices of the unknowns give."""

from __future__ import annotations

import numpy as np
import pytest

import femubench
from femubench.core.fit import gauss_newton
from femubench.core.fit.dual_least_squares import DualPosterior, dual_step
from femubench.core.update import sensitivity_update as iteration
from femubench.core.update.change_lists import Changes
from femubench.update import UpdateOptions, sensitivity_update

RNG = np.random.default_rng(5)
S, RESIDUAL = RNG.standard_normal((4, 30)), RNG.standard_normal(4)
PRECISION = RNG.uniform(0.5, 20.0, 30)


def test_the_step_is_that_of_the_normal_equations() -> None:
    rest = RNG.standard_normal(30)
    normal = S.T @ S + np.diag(PRECISION)
    expected = np.linalg.solve(normal, S.T @ RESIDUAL + PRECISION * rest)
    np.testing.assert_allclose(dual_step(S, RESIDUAL, PRECISION, rest), expected, rtol=1e-10)


def test_the_posterior_has_the_covariance_of_the_normal_equations() -> None:
    covariance = np.linalg.inv(S.T @ S + np.diag(PRECISION))
    posterior = DualPosterior.of(S, PRECISION)
    np.testing.assert_allclose(posterior.std, np.sqrt(np.diagonal(covariance)), rtol=1e-10)
    root = posterior.draws(np.eye(30))
    np.testing.assert_allclose(root.T @ root, covariance, atol=1e-12)


@pytest.mark.parametrize("statistical", [True, False])
def test_an_update_of_many_parameters_is_that_of_few(
    monkeypatch: pytest.MonkeyPatch, statistical: bool
) -> None:
    case = femubench.cases["frame"]
    std = 0.1 if statistical else None
    unknowns = Changes(case.model).parts("elements", prior_std=std)
    options = UpdateOptions(weighting="statistical" if statistical else "unit")
    used = case.used_measurement()
    dense = sensitivity_update(case.model, unknowns, used, options)
    for module in (iteration, gauss_newton):
        monkeypatch.setattr(module, "MANY", 3)
    dual = sensitivity_update(case.model, unknowns, used, options)
    assert len(unknowns) > 3
    for one, two in zip(dense.parameters, dual.parameters, strict=True):
        assert two.after == pytest.approx(one.after, rel=1e-6)
        assert two.std == (None if one.std is None else pytest.approx(one.std, rel=1e-6))
    # Nobody reads the course of so many.
    assert set(dual.history[0]) == {"iteration", "cost", "step"}
    assert (dual.uncertainty is None) is not statistical


def test_many_parameters_without_a_prior_and_damping_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    case = femubench.cases["frame"]
    for module in (iteration, gauss_newton):
        monkeypatch.setattr(module, "MANY", 3)
    unknowns = Changes(case.model).parts("elements")
    with pytest.raises(femubench.NotApplicable, match="without damping or a prior"):
        sensitivity_update(
            case.model, unknowns, case.used_measurement(), UpdateOptions(damping=0.0)
        )
