"""Sampling the posterior: the polynomial, the chain, the discrepancy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import harness_toys as toys
import numpy as np
import pytest

from femubench import Measurement, StrategyFailure, UpdateResult
from femubench.core.fit.discrepancy import Discrepancy
from femubench.core.typing import FloatArray
from femubench.core.update import posterior_sampling
from femubench.core.update.posterior_sampling import StretchMove
from femubench.core.update.quadratic_fit import QuadraticFit, coefficients_of
from femubench.plugins.strategies.sampling import BayesianSampling

CASE = toys.tiny_case()


def sampled(measurement: Measurement, seed: int = 1, **options: float) -> UpdateResult:
    strategy = BayesianSampling(**options)  # type: ignore[arg-type]
    return strategy.update(CASE.model, measurement, np.random.default_rng(seed))


def test_a_quadratic_function_is_met_and_others_have_their_error() -> None:
    rng = np.random.default_rng(5)
    points = rng.standard_normal((40, 3)) * [0.1, 1.0, 5.0] + [1.0, 0.0, -2.0]
    square = rng.standard_normal((3, 3))
    exact = 0.5 + points @ [1.0, -2.0, 0.3] + np.einsum("ni,ij,nj->n", points, square, points)
    bent = exact + 0.2 * points[:, 1] ** 3
    fit = QuadraticFit.of(points, np.column_stack([exact, bent]))
    assert fit(points)[:, 0] == pytest.approx(exact, rel=1e-9)
    assert fit.error[0] < 1e-9
    left_out = []
    for k in range(len(points)):
        kept = np.arange(len(points)) != k
        again = QuadraticFit.of(points[kept], bent[kept, None])
        left_out.append(again(points[k : k + 1])[0, 0] - bent[k])
    assert fit.error[1] == pytest.approx(np.sqrt(np.mean(np.square(left_out))), rel=1e-9)
    assert coefficients_of(3) == 10


@pytest.fixture(scope="module")
def settled() -> UpdateResult:
    """Return the usual answer to the case."""
    return sampled(CASE.used_measurement(), discrepancy_median=0.02, discrepancy_spread=0.01)


@pytest.mark.slow(5)
def test_the_posterior_is_that_of_exact_solutions(settled: UpdateResult) -> None:
    """Weighed draws of a wider distribution, every one solved, give the same mean and spread."""
    measurement, discrepancy = CASE.used_measurement(), Discrepancy(0.02, 0.01)
    strategy = BayesianSampling(discrepancy_median=0.02, discrepancy_spread=0.01)
    _, changes = strategy.pose(CASE.model, measurement)
    target = posterior_sampling.most_probable(
        CASE.model, changes, measurement, discrepancy, strategy.options
    )
    rng = np.random.default_rng(0)
    z = 1.8 * rng.standard_normal((700, len(changes)))
    points, values = target.predict(target.at(z))
    assert len(points) == len(z)
    log, _, _ = target.data
    misfit = np.square((log - values) / target.std(np.zeros(1))).sum(axis=1)
    posterior = -0.5 * (misfit + np.square(points) @ target.iteration.parametric.precision)
    weight = np.exp(posterior + 0.5 * np.square(z / 1.8).sum(axis=1))
    weight /= weight.sum()
    assert 1.0 / np.square(weight).sum() > 100.0
    mean = weight @ points
    std = np.sqrt(weight @ np.square(points - mean))
    for k, parameter in enumerate(settled.parameters):
        assert parameter.std is not None
        assert abs(np.log(parameter.after) - mean[k]) < 0.3 * std[k]
        assert parameter.std / parameter.after == pytest.approx(std[k], rel=0.25)


@pytest.mark.nightly
def test_the_discrepancy_grows_with_what_the_model_cannot_follow() -> None:
    measurement = CASE.used_measurement()
    spoiled = replace(measurement, frequencies=measurement.frequencies * [1.0, 1.25, 0.8])
    fine, odd = sampled(measurement), sampled(spoiled)
    assert fine.diagnostics["discrepancy_median"] < 0.02
    assert odd.diagnostics["discrepancy_median"] > 0.03
    for result in (fine, odd):
        assert result.uncertainty is not None
        assert result.uncertainty.discrepancy_std == result.diagnostics["discrepancy_std"]
        assert len(result.uncertainty.samples) == 40
        assert result.diagnostics["effective_samples"] > 1000.0
        assert result.diagnostics["surrogate_error"] < 0.01


def test_the_generator_alone_decides_on_the_result(settled: UpdateResult) -> None:
    np.random.seed(2)  # noqa: NPY002 - what other code may have done
    again = sampled(CASE.used_measurement(), discrepancy_median=0.02, discrepancy_spread=0.01)
    assert again.parameters == settled.parameters
    assert again.diagnostics == settled.diagnostics
    assert (again.model.stiffness != settled.model.stiffness).nnz == 0


@pytest.mark.slow(3)
def test_rounding_does_not_grow_along_the_chain(settled: UpdateResult) -> None:
    measurement = CASE.used_measurement()
    moved = replace(measurement, frequencies=measurement.frequencies * [1.0, 1.0 + 1e-13, 1.0])
    again = sampled(moved, discrepancy_median=0.02, discrepancy_spread=0.01)
    for one, other in zip(again.parameters, settled.parameters, strict=True):
        assert (one.after, one.std) == pytest.approx((other.after, other.std), rel=1e-8)


def chain_of(density: Callable[[FloatArray], FloatArray], steps: int, **options: Any) -> Any:
    import emcee

    sampler = emcee.EnsembleSampler(24, 3, density, vectorize=True, **options)
    sampler.random_state = np.random.RandomState(7).get_state()
    sampler.run_mcmc(0.3 * np.random.default_rng(3).standard_normal((24, 3)), steps)
    return sampler


def test_the_stretch_move_is_that_of_emcee() -> None:
    def density(x: FloatArray) -> FloatArray:
        inside = -0.5 * np.square(x * [1.0, 2.0, 0.5]).sum(axis=1)
        return np.where(x[:, 0] > -1.5, inside, -np.inf)

    plain, ours = chain_of(density, 200), chain_of(density, 200, moves=StretchMove())
    np.testing.assert_array_equal(ours.get_chain(), plain.get_chain())
    np.testing.assert_array_equal(ours.get_log_prob(), plain.get_log_prob())
    np.testing.assert_array_equal(ours.acceptance_fraction, plain.acceptance_fraction)
    assert 0.1 < ours.acceptance_fraction.mean() < 0.9


def test_a_density_without_a_value_ends_the_chain() -> None:
    def density(x: FloatArray) -> FloatArray:
        return np.where(np.abs(x).max(axis=1) < 4.0, 0.0, np.nan)

    with pytest.raises(StrategyFailure, match="no value at a point"):
        chain_of(density, 200, moves=StretchMove())


def test_a_chain_that_is_too_short_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(posterior_sampling, "_LONGEST", 500)
    monkeypatch.setattr(posterior_sampling, "_LONG_ENOUGH", 400.0)
    monkeypatch.setattr(posterior_sampling, "_OFF", np.inf)  # no polynomials are to blame
    with pytest.raises(StrategyFailure, match=r"^500 steps are \d+ autocorrelation times, expec"):
        sampled(CASE.used_measurement())


def test_over_rough_polynomials_it_says_that_it_is_the_normal_approximation(
    settled: UpdateResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in (("_LONGEST", 500), ("_LONG_ENOUGH", 400.0), ("_OFF", 0.0), ("_ROUNDS", 1)):
        monkeypatch.setattr(posterior_sampling, name, value)
    found = sampled(CASE.used_measurement(), discrepancy_median=0.02, discrepancy_spread=0.01)
    assert "normal_approximation" not in settled.diagnostics
    assert found.diagnostics["normal_approximation"] == 1.0
    assert found.diagnostics["steps"] == 500.0
    for one, other in zip(found.parameters, settled.parameters, strict=True):
        assert one.std is not None
        assert abs(one.after - other.after) < one.std
