"""The error in the constitutive relation: against a dense minimum, its slope, zones it names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from response_problems import simulate
from test_factor_strategies import FACTOR, frame_of_five, planted

from femubench import InputError, NotApplicable, solve_modes
from femubench.modal import rigid_modes_of
from femubench.plugins.strategies.constitutive_error import ConstitutiveError
from femubench.plugins.strategies.dynamic_residual import DynamicResidual
from femubench.plugins.strategies.response_error import response_error
from femubench.update import Changes

FACTORS = np.array([1.12, 0.9, 1.05])
RNG = np.random.default_rng(0)


def test_the_error_is_the_least_of_all_pairs_and_its_slope_that_of_differences() -> None:
    """With K v = lambda M u, u - v has the energy of (K - lambda M) u by the inverse of K."""
    model, exact = simulate(FACTORS, lines=3)
    test, parts, weight = exact.with_noise(RNG), Changes(model).parameterise("members"), 0.7 / 0.3
    test.shapes[1, 2] = np.nan
    energy, x, total = np.array([2.0, 1.0, 0.5, 3.0]), np.array([0.1, -0.2, 0.3]), 0.0
    at = parts.at(x)
    k, m, rows = (matrix.toarray() for matrix in (at.stiffness, at.mass, at.observe(test.sensors)))
    free = la.null_space((m @ rigid_modes_of(at)).T)  # motions whose forces have a K v
    root = la.sqrtm(la.pinvh(k, rtol=1e-12)).real
    for j, eigenvalue in enumerate(test.eigenvalues):
        known = np.isfinite(test.shapes[:, j])
        reading, std = test.shapes[known, j], test.shape_std[known, j]
        share = np.sqrt(weight) / std / np.linalg.norm(reading / std)
        forces = root @ (k - eigenvalue * m) / np.sqrt(2.0 * energy[j])
        matrix = np.vstack([forces, share[:, None] * rows[known]]) @ free
        right = np.concatenate([np.zeros(len(k)), share * reading])
        total += float(np.square(right - matrix @ la.lstsq(matrix, right)[0]).sum())
    strategy, step = ConstitutiveError(confidence=0.7), 1e-5
    cost, slope, zones = strategy.error(parts, test, energy, x)
    assert cost == pytest.approx(total, rel=1e-6)
    ends = [
        [strategy.error(parts, test, energy, x + sign * step * e)[0] for sign in (1, -1)]
        for e in np.eye(3)
    ]
    assert slope == pytest.approx([(up - down) / (2.0 * step) for up, down in ends], rel=1e-5)
    assert (zones > 0.0).all()
    assert zones.sum() < cost  # the rest is that of the readings


def test_the_error_of_responses_is_the_least_of_all_pairs_with_damping() -> None:
    """With K v = f - (i w C - w^2 M) u, u - v has the energy of Z u - f by the inverse of K."""
    model, exact = simulate(FACTORS, lines=3)
    test, parts, weight = exact.with_noise(RNG), Changes(model).parameterise("members"), 0.7 / 0.3
    assert test.responses is not None
    test.responses.values[1, 2] = np.nan
    test.responses.values[2] = np.nan
    energy, x, total = np.array([[2.0], [0.5], [1.0]]), np.array([0.1, -0.2, 0.3]), 0.0
    at, modes = parts.at(x), solve_modes(parts.at(x))
    k, m, rows = (matrix.toarray() for matrix in (at.stiffness, at.mass, at.observe(test.sensors)))
    inertia = m @ modes.shapes
    ratio = parts.answer(x, test)[0].ratios
    viscous = (inertia * (2.0 * ratio * np.sqrt(np.abs(modes.eigenvalues)))) @ inertia.T
    root = la.sqrtm(la.pinvh(k, rtol=1e-12)).real
    for f, omega in enumerate(2.0 * np.pi * test.responses.frequencies[:2]):
        known = np.isfinite(test.responses.values[f, :, 0])
        inert = 1j * omega * viscous - omega**2 * m
        reading, std = (
            values[f, known] for values in (test.responses.values, test.responses.receptance_std)
        )
        share = np.sqrt(weight) / std / np.linalg.norm(reading / std)
        forced = la.solve(k + inert, rows[0])
        free = la.null_space(rigid_modes_of(at).T @ inert)
        matrix = np.vstack(
            [root @ (k + inert) / np.sqrt(2.0 * energy[f]), share * rows[known]]
        ) @ free  # fmt: skip
        missed = reading - rows[known] @ forced[:, None]
        right = np.append(np.zeros(len(k)), share * missed)
        total += float(np.square(np.abs(right - matrix @ la.lstsq(matrix, right)[0])).sum())
    step = 1e-5
    cost, slope, zones = response_error(parts, test, energy, x, weight)
    assert cost == pytest.approx(total, rel=1e-6)

    def cost_at(point: np.ndarray) -> float:  # type: ignore[type-arg]
        return response_error(parts, test, energy, point, weight)[0]

    ends = [(cost_at(x + step * e), cost_at(x - step * e)) for e in np.eye(3)]
    assert slope == pytest.approx([(up - down) / (2.0 * step) for up, down in ends], rel=1e-5)
    assert (zones > 0.0).all()


def test_responses_alone_find_far_factors_and_name_the_member_that_is_softer() -> None:
    for factors, localise in ((np.array([2.0, 0.5, 1.0]), 0.0), (np.array([1.0, 0.7, 1.0]), 0.8)):
        strategy = ConstitutiveError(responses=True, localise=localise)
        model, test = simulate(factors, lines=20)
        found = strategy.update(model, test, RNG)
        assert [p.after for p in found.parameters] == pytest.approx(factors, rel=1e-6)
    assert found.history[1]["cost"] < 1e-9 * found.history[0]["cost"]  # BC first
    found = strategy.update(model, test.with_noise(np.random.default_rng(1)), RNG)
    assert [p.after for p in found.parameters] == pytest.approx(factors, rel=0.1)
    assert test.responses is not None
    for responses in (None, replace(test.responses, deviations=None)):
        with pytest.raises(NotApplicable, match=r"no (given )?frequency response"):
            strategy.update(model, replace(test, responses=responses), RNG)


def test_the_zone_of_largest_error_is_the_member_that_is_softer() -> None:
    model, measurement = planted(frame_of_five(), "m-CD", 6)
    result = ConstitutiveError(confidence=0.99).update(model, measurement, RNG)
    after = {p.name.removeprefix("E "): p.after for p in result.parameters}
    assert after.pop("m-CD") == pytest.approx(FACTOR, abs=1e-3)
    assert list(after.values()) == pytest.approx([1.0] * len(after), abs=1e-3)
    assert result.history[1]["zones"] == 1.0


def test_noise_moves_the_factors_by_little_and_wrong_options_are_one_line() -> None:
    model, exact = simulate(FACTORS, lines=3)
    found = ConstitutiveError(localise=0.0).update(model, exact, RNG)
    assert [p.after for p in found.parameters] == pytest.approx(FACTORS, rel=1e-3)
    noisy = exact.with_noise(np.random.default_rng(1))
    found = ConstitutiveError(localise=0.0).update(model, noisy, RNG)
    assert [p.after for p in found.parameters] == pytest.approx(FACTORS, rel=0.08)
    with pytest.raises(InputError, match=r"confidence is 1 \(expected between 0 and 1\)"):
        ConstitutiveError(confidence=1.0)
    with pytest.raises(InputError, match=r"localise is -1 \(expected 0 to 1\)"):
        ConstitutiveError(localise=-1.0)
    bare = exact.select(exact.numbers)
    bare.shapes[:] = np.nan
    with pytest.raises(NotApplicable):
        ConstitutiveError().update(model, bare, RNG)
    exact.shape_std[:, 1] = np.nan
    for strategy in (ConstitutiveError(), DynamicResidual()):
        with pytest.raises(NotApplicable, match="no reading of mode 2 has a standard deviation"):
            strategy.update(model, exact, RNG)
