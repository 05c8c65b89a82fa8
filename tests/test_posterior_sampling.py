"""Sampling the posterior: the polynomial, the chain, the discrepancy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import harness_toys as toys
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from femubench import Measurement, StrategyFailure, UpdateResult
from femubench.core.fit.discrepancy import Discrepancy
from femubench.core.typing import FloatArray
from femubench.core.update import posterior_sampling
from femubench.core.update.posterior_sampling import StretchMove
from femubench.core.update.quadratic_fit import QuadraticFit, coefficients_of
from femubench.core.update.transitional import sample_transitional
from femubench.plugins.strategies.sampling import BayesianSampling
from femubench.plugins.strategies.transitional import TransitionalMcmc

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
    """Weighed draws of a wider distribution, every one solved, give the same mean and spread.

    And the same evidence, which the samples from the prior have.
    """
    measurement, discrepancy = CASE.used_measurement(), Discrepancy(0.02, 0.01)
    strategy = TransitionalMcmc(discrepancy_median=0.02, discrepancy_spread=0.01)
    led = strategy.update(CASE.model, measurement, np.random.default_rng(1))
    _, changes = strategy.pose(CASE.model, measurement)
    target = posterior_sampling.most_probable(
        CASE.model, changes, measurement, discrepancy, strategy.options
    )
    rng = np.random.default_rng(0)
    z = 1.8 * rng.standard_normal((700, len(changes)))
    points, values = target.predict(target.at(z))
    assert len(points) == len(z)
    log, _, _ = target.data
    variance = np.square(target.std(np.zeros(1)))
    misfit = (np.square(log - values) / variance + np.log(2.0 * np.pi * variance)).sum(axis=1)
    precision = target.iteration.parametric.precision
    prior = np.square(points) @ precision - np.log(precision / (2.0 * np.pi)).sum()
    wide = 1.8 * target.root
    drawn = np.square(z / 1.8).sum(axis=1) + np.linalg.slogdet(2.0 * np.pi * wide @ wide.T)[1]
    weight = np.exp(-0.5 * (misfit + prior - drawn))
    assert led.diagnostics["log_evidence"] == pytest.approx(np.log(weight.mean()), abs=0.2)
    weight /= weight.sum()
    assert 1.0 / np.square(weight).sum() > 100.0
    mean = weight @ points
    std = np.sqrt(weight @ np.square(points - mean))
    for found in (settled, led):
        for k, parameter in enumerate(found.parameters):
            assert parameter.std is not None
            assert abs(np.log(parameter.after) - mean[k]) < 0.3 * std[k]
            assert parameter.std / parameter.after == pytest.approx(std[k], rel=0.25)


def gaussian(x: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * np.square(x).sum(axis=1))


def test_samples_from_the_prior_have_the_exact_posterior_and_evidence_of_linear_data() -> None:
    rng = np.random.default_rng(2)
    a, y, sigma = rng.standard_normal((5, 6)), 2.0 * rng.standard_normal(5), 0.1
    covariance = np.linalg.inv(np.eye(6) + a.T @ a / sigma**2)
    mean, std = covariance @ a.T @ y / sigma**2, np.sqrt(np.diagonal(covariance))
    exact = multivariate_normal(np.zeros(5), a @ a.T + sigma**2 * np.eye(5)).logpdf(y)

    def likelihood(x: FloatArray) -> FloatArray:
        return gaussian((y - x @ a.T) / sigma) - len(y) * np.log(sigma * np.sqrt(2.0 * np.pi))

    found = sample_transitional(rng.standard_normal((2000, 6)), gaussian, likelihood, rng)
    assert found.log_evidence == pytest.approx(exact, abs=0.4)
    assert (np.abs(found.samples.mean(axis=0) - mean) < 0.15 * std).all()
    assert found.samples.std(axis=0) == pytest.approx(std, rel=0.1)
    assert 0.15 < found.accepted < 0.4


def test_samples_from_the_prior_find_both_of_two_explanations_and_weigh_them() -> None:
    """x^2 + x / 4 was measured: one of two answers is more probable by a known ratio."""

    def likelihood(x: FloatArray) -> FloatArray:
        return gaussian((x**2 + 0.25 * x - 1.0) / 0.02)

    grid = np.linspace(-4.0, 4.0, 400_001)
    density = np.exp(likelihood(grid[:, None]) + gaussian(grid[:, None])) / np.sqrt(2.0 * np.pi)
    rng = np.random.default_rng(0)
    found = sample_transitional(rng.standard_normal((2000, 1)), gaussian, likelihood, rng)
    assert found.log_evidence == pytest.approx(np.log(density.sum() * 2e-5), abs=0.2)
    above = float(density[grid > 0.0].sum() / density.sum())
    assert 0.5 < above < 0.7
    assert (found.samples > 0.0).mean() == pytest.approx(above, abs=0.08)
    with pytest.raises(StrategyFailure, match="100 stages reach"):
        sample_transitional(
            rng.standard_normal((200, 1)), gaussian, lambda x: gaussian(1e100 * x), rng
        )


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


def test_of_many_parameters_the_chain_has_what_the_data_know(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    few, words = CASE.used_measurement().select([1, 2]), {"discrepancy_median": 0.02}
    every = sampled(few, **words)
    assert len(every.parameters) > len(few)
    monkeypatch.setattr(posterior_sampling, "_ALL_KNOWN", len(few))
    solved = []
    predict = posterior_sampling.Target.predict

    def counting(target: posterior_sampling.Target, points: FloatArray) -> Any:
        solved.append(len(points))
        return predict(target, points)

    monkeypatch.setattr(posterior_sampling.Target, "predict", counting)
    found = sampled(few, **words)
    assert set(solved) == {24}  # four for each of the six coefficients of two variables
    assert "normal_approximation" not in found.diagnostics
    for one, other in zip(found.parameters, every.parameters, strict=True):
        assert one.std is not None
        assert abs(one.after - other.after) < 0.2 * one.std
        assert one.std == pytest.approx(other.std, rel=0.1)
    monkeypatch.setattr(posterior_sampling, "_OFF", 0.0)
    assert sampled(few, **words).diagnostics["normal_approximation"] == 1.0


def test_what_the_data_do_not_know_has_its_prior_within_the_bounds() -> None:
    """Draws one after the other are those that are drawn together, weighed by the prior."""
    rng, size = np.random.default_rng(4), 4
    precision = np.array([1.0, 4.0, 0.5, 2.0])
    turns, _ = np.linalg.qr(rng.standard_normal((size, size)))
    lower, upper = np.full(size, -1.2), np.array([0.4, 0.5, 3.0, np.inf])
    known: Any = SimpleNamespace(lower=lower, upper=upper, precision=precision)
    iteration: Any = SimpleNamespace(parametric=known)
    nothing: Any = None
    root, centre = precision[:, None] ** -0.5 * turns, np.array([0.39, 0.1, -0.3, 0.2])
    target = posterior_sampling.Target(iteration, nothing, centre, root, 1, nothing, nothing)
    z = np.zeros((40_000, size))
    z[:, 0] = 0.03
    for _ in range(40):
        target.redraw(z, rng)
    assert (z[:, 0] == 0.03).all()
    assert target.inside(target.at(z)).all()
    together = rng.standard_normal((800_000, size))
    together[:, 0] = 0.03
    together = together[target.inside(target.at(together))]
    q = target.at(together)
    weight = 0.5 * (np.square(together[:, 1:]).sum(axis=1) - np.square(q) @ precision)
    weight = np.exp(weight - weight.max())
    assert weight.sum() ** 2 / np.square(weight).sum() > 50_000.0
    for one, other in ((z, together), (target.at(z), q)):
        mean = np.average(other, axis=0, weights=weight)
        std = np.sqrt(np.average(np.square(other - mean), axis=0, weights=weight))
        assert one.mean(axis=0) == pytest.approx(mean, abs=0.02)
        assert one.std(axis=0) == pytest.approx(std, abs=0.02)


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
    monkeypatch.setattr(posterior_sampling, "_LONGEST", 250)
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
