"""Antiresonances: read off lines, of a model, and factors that are fitted to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from response_problems import simulate

import femubench
from femubench import NotApplicable
from femubench.core.modal.antiresonances import (
    antiresonance_slopes,
    find_antiresonances,
    frequency_shares,
    predict_antiresonances,
)
from femubench.core.modal.receptances import PredictedResponses
from femubench.update import Changes, UpdateOptions

FACTORS = np.array([1.12, 0.9, 1.05])
RNG = np.random.default_rng(0)


def test_those_of_a_point_are_the_resonances_of_the_model_held_there() -> None:
    """Wahl, Schmidt & Forrai (1999); the lines show the same ones."""
    model, test = simulate(np.ones(3), noise=1e-4)
    still = replace(test, damping=np.full(4, 1e-7))
    row = model.observe(still.responses.references).toarray()  # type: ignore[union-attr]
    free = la.null_space(row)
    pencil = (free.T @ matrix.toarray() @ free for matrix in (model.stiffness, model.mass))
    held = np.sqrt(la.eigh(*pencil, eigvals_only=True)) / (2.0 * np.pi)
    own = predict_antiresonances(PredictedResponses.of(model, still))
    at_point = own.response == 0
    shown = own.frequencies[at_point]
    near = held[np.abs(held[:, None] / shown - 1.0).argmin(axis=0)]
    assert len(set(near)) == len(shown) > 1
    assert shown == pytest.approx(near, rel=1e-6)
    found = find_antiresonances(test.responses, test.frequencies, test.damping)  # type: ignore[arg-type]
    predicted = predict_antiresonances(PredictedResponses.of(model, test))
    partner = found.pair(predicted)
    assert (partner >= 0).all()
    assert len(found) >= 3
    far = replace(predicted, frequencies=1.3 * predicted.frequencies)
    assert (found.pair(far) == -1).all()
    off = found.frequencies - predicted.frequencies[partner]
    assert (np.abs(off) < 1e-4 * found.frequencies).all()
    assert (found.std < 1e-3 * found.frequencies).all()


def test_their_slopes_are_those_of_differences() -> None:
    model, test = simulate(np.ones(3))
    parametric, x = Changes(model).parameterise("members"), np.log(FACTORS)
    there, step = parametric.at(x), 1e-5
    answer = PredictedResponses.of(there, test)
    own = predict_antiresonances(answer)
    slopes = antiresonance_slopes(answer, own, parametric.slopes(x, there)) * parametric.steps(x)
    for column, each in zip(slopes.T, np.eye(3), strict=True):
        ends = (parametric.at(x + sign * step * each) for sign in (-1.0, 1.0))
        low, high = (predict_antiresonances(PredictedResponses.of(m, test)) for m in ends)
        rise = high.frequencies[own.pair(high)] - low.frequencies[own.pair(low)]
        assert column == pytest.approx(rise / (2.0 * step), rel=1e-4, abs=1e-4)


def test_they_move_with_each_resonance_by_their_shares() -> None:
    """Residues fitted to the lines, against the model with one eigenvalue after the other moved."""
    model, test = simulate(np.ones(3), noise=1e-4, lines=300)
    answer, step = PredictedResponses.of(model, test), 1e-4
    own, modes = predict_antiresonances(answer), answer.modes
    own = own.take(own.frequencies < answer.at[2][-1])  # what lines show
    shares = frequency_shares(test, own)
    assert len(own) > 4
    for column, at in zip(shares.T, answer.partner, strict=True):
        moved = [modes.eigenvalues.copy() for _ in range(2)]
        for values, sign in zip(moved, (-1.0, 1.0), strict=True):
            values[at] *= np.exp(2.0 * sign * step)
        ends = (replace(modes, eigenvalues=values) for values in moved)
        low, high = (predict_antiresonances(replace(answer, modes=end)) for end in ends)
        rise = np.log(high.frequencies[own.pair(high)] / low.frequencies[own.pair(low)])
        assert column == pytest.approx(rise / (2.0 * step), abs=0.02 * np.abs(shares).max())


def test_a_channel_that_holds_noise_alone_shows_none() -> None:
    _, test = simulate(np.ones(3), lines=300)
    given, rng = test.responses, np.random.default_rng(3)
    assert given is not None
    noise = given.deviations * (rng.standard_normal(given.values.shape) * (1.0 + 1.0j))
    silent = replace(given, values=noise)
    assert (noise.real[1:] * noise.real[:-1] < 0.0).sum() > 500
    assert len(find_antiresonances(silent, test.frequencies, test.damping)) == 0


def within_two_deviations(draws: range) -> int:
    """Return in how many draws all factors lie within two stated deviations of the truth."""
    model, test = simulate(FACTORS)
    strategy, count = femubench.strategies["antiresonances"](), 0
    for draw in draws:
        noisy = test.with_noise(np.random.default_rng(draw))
        parameters = strategy.update(model, noisy, RNG).parameters
        after, std = np.array([(p.after, p.std) for p in parameters], dtype=float).T
        assert (std < 0.1).all()  # a third of the prior's
        count += bool((np.abs(after - FACTORS) < 2.0 * std).all())
    return count


@pytest.mark.slow(6)
def test_factors_lie_within_two_stated_deviations() -> None:
    assert within_two_deviations(range(10)) >= 9


@pytest.mark.nightly
def test_factors_lie_within_two_stated_deviations_in_ninety_of_a_hundred_draws() -> None:
    assert within_two_deviations(range(100)) >= 90


def test_refusals_are_one_line() -> None:
    case, strategy = femubench.cases["frame"], femubench.strategies["antiresonances"]()
    with pytest.raises(NotApplicable, match="no frequency responses are given"):
        strategy.update(case.model, case.used_measurement(), RNG)
    model, test = simulate(FACTORS, lines=12)  # too far apart
    with pytest.raises(NotApplicable, match="no antiresonance stands out of the noise"):
        strategy.update(model, test, RNG)
    with pytest.raises(ValueError, match="not both"):
        UpdateOptions(responses=True, antiresonances=True)
