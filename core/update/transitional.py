"""Transitional Markov chain Monte Carlo: samples go from the prior to the posterior in stages.

Source: Ching & Chen (2007), Transitional Markov chain Monte Carlo method for Bayesian model
updating, model class selection, and model averaging, J. Eng. Mech. 133, 816-832.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from femubench.core.errors import StrategyFailure
from femubench.core.typing import FloatArray

_VARIATION = 1.0  # of the weights of a stage: their deviation over their mean
_SCALE = 2.4  # of a move in one dimension, over the deviation of the samples
_MOVES = 20  # of every sample in a stage
_ACCEPTED = 0.23, 0.21  # share that is aimed at: the first, and the second over the dimension
_STAGES = 100


@dataclass(frozen=True)
class Transitions:
    """What samples have become.

    Arguments:
        samples: each as probable as the others, (n, p).
        log_evidence: ln of the mean likelihood over the prior.
        accepted: share of the last moves.
    """

    samples: FloatArray
    log_evidence: float
    stages: int
    accepted: float


def sample_transitional(
    prior: FloatArray,
    log_prior: Callable[[FloatArray], FloatArray],
    log_likelihood: Callable[[FloatArray], FloatArray],
    rng: np.random.Generator,
) -> Transitions:
    """Return samples of the posterior, and the evidence.

    Of stage j the density is that of the prior times the likelihood to the power t_j, from 0 to 1;
    t_j is such that the weights L^(t_j - t_(j-1)) of the samples have a coefficient of variation
    of 1. Samples drawn by weight then make twenty Metropolis moves each, all at once, as long as
    makes the accepted share that of Betz et al. With one move of 0.2 deviations, as in the first
    paper, most of them would stay copies: of six parameters the deviations were half too small.

    Arguments:
        prior: samples of it, (n, p).
        log_prior, log_likelihood: from points (n, p) to (n,); the first but for a constant.

    Raises:
        StrategyFailure: when the likelihood is so narrow that a hundred stages do not reach it.

    Source: Ching & Chen (2007), the stages and the evidence; Betz, Papaioannou & Straub (2016),
    Transitional Markov chain Monte Carlo: observations and improvements, J. Eng. Mech. 142,
    04016016, the length of moves.
    """
    x, value, power, evidence = prior, log_likelihood(prior), 0.0, 0.0
    size = x.shape[1]
    scale = _SCALE / np.sqrt(size)
    for stage in range(1, _STAGES + 1):
        step = _next_step(value, 1.0 - power)
        weight = np.exp(step * (value - value.max()))
        evidence += float(np.log(weight.mean()) + step * value.max())
        weight /= weight.sum()
        power += step
        apart = x - weight @ x
        root = np.linalg.cholesky((apart.T * weight) @ apart)
        chosen = rng.choice(len(x), len(x), p=weight)
        x, value = x[chosen], value[chosen]
        for move in range(1, _MOVES + 1):
            trial = x + scale * rng.standard_normal(x.shape) @ root.T
            found = log_likelihood(trial)
            gain = power * (found - value) + log_prior(trial) - log_prior(x)
            taken = np.log(rng.random(len(x))) < gain
            x, value = np.where(taken[:, None], trial, x), np.where(taken, found, value)
            accepted = float(taken.mean())
            scale *= float(np.exp((accepted - _ACCEPTED[0] - _ACCEPTED[1] / size) / np.sqrt(move)))
        if power >= 1.0:
            return Transitions(x, evidence, stage, accepted)
    raise StrategyFailure(f"{_STAGES} stages reach the likelihood to the power {power:.2g} alone")


def _next_step(value: FloatArray, most: float) -> float:
    """Return by how much the power grows, so that weights vary as they are to; `most` at most."""

    def excess(step: float) -> float:
        weight = np.exp(step * (value - value.max()))
        return float(weight.std() / weight.mean() - _VARIATION)

    return most if excess(most) <= 0.0 else float(brentq(excess, 0.0, most, xtol=1e-12 * most))
