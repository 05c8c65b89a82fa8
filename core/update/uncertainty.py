"""What a strategy says of the error of its own model: samples of it, and what no sample follows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.errors import FemubenchError, StrategyFailure
from femubench.core.fem.model import Model
from femubench.core.typing import FloatArray

MOST_SAMPLES = 64
_FEWEST, _SEED = 16, 0
_SYMMETRY, _NEGATIVE = 1e-8, 1e-8  # of the largest entry


@dataclass(frozen=True)
class Uncertainty:
    """How far a strategy's model may be off, in a form from which any frequency can be judged.

    Arguments:
        samples: models on the dofs of the updated one, each as probable as the others; 64 at most.
        discrepancy_std: relative standard deviation of a natural frequency by what no model of
            the kind can follow, apart from the samples.

    Source: Kennedy & O'Hagan (2001), J. R. Stat. Soc. B 63, 425-464, for the two parts.
    """

    samples: Sequence[Model] = ()
    discrepancy_std: float = 0.0

    @classmethod
    def draw(
        cls,
        make: Callable[[FloatArray], Model],
        mean: FloatArray,
        covariance: FloatArray,
        *,
        discrepancy_std: float = 0.0,
    ) -> Uncertainty:
        """Return samples from a normal distribution of parameters.

        The draws are the same ones every time, and their mean and covariance those given, so that
        what is linear in the parameters gets its standard deviation without a sampling error.
        Draws that give no model are left out.

        Arguments:
            make: returns the model of parameters (p,).
            mean: of the parameters, (p,).
            covariance: of the parameters, symmetric without a negative eigenvalue, (p, p).
            discrepancy_std: as in the class.

        Raises:
            StrategyFailure: when the covariance is none.

        Examples:
            >>> def make(q):
            ...     return femubench.Model.of(structure.with_values([stiffness], np.exp(q)))
            >>> len(update.Uncertainty.draw(make, np.zeros(1), np.array([[0.01]])).samples)
            16
        """
        root = _root(np.asarray(covariance, dtype=float), len(mean))
        draws = mean + standard_normal(root.shape[1]) @ root.T
        return cls.of_draws(make, draws, discrepancy_std=discrepancy_std)

    @classmethod
    def of_draws(
        cls, make: Callable[[FloatArray], Model], draws: FloatArray, *, discrepancy_std: float = 0.0
    ) -> Uncertainty:
        """Return the models of parameters that were drawn, without draws that give none.

        Arguments:
            make: returns the model of parameters (p,).
            draws: each as probable as the others, (k, p).
            discrepancy_std: as in the class.

        Examples:
            >>> def make(q):
            ...     return femubench.Model.of(structure.with_values([stiffness], np.exp(q)))
            >>> len(update.Uncertainty.of_draws(make, np.array([[0.0], [0.1]])).samples)
            2
        """
        models = []
        for draw in draws:
            with suppress(FemubenchError):
                made = make(draw)
                if made.groups or made.mass_groups:
                    # Each is as large as the whole, and nothing is asked of them any more.
                    made = replace(made, groups={}, mass_groups={}, powers={}, grounds={})
                models.append(made)
        return cls(tuple(models), discrepancy_std)


def _root(covariance: FloatArray, size: int) -> FloatArray:
    """Return R with R R' = C, (p, r), directions without variance left out."""
    if covariance.shape != (size, size):
        raise StrategyFailure(
            f"the covariance has shape {covariance.shape}, expected {(size, size)}"
        )
    if not np.isfinite(covariance).all():
        raise StrategyFailure("the covariance has entries that are not finite, expected none")
    largest = float(np.abs(covariance).max(initial=0.0))
    if np.abs(covariance - covariance.T).max(initial=0.0) > _SYMMETRY * largest:
        raise StrategyFailure("the covariance is not symmetric")
    values, vectors = np.linalg.eigh(covariance)
    if values.min(initial=0.0) < -_NEGATIVE * largest:
        raise StrategyFailure(
            f"the covariance has an eigenvalue of {values.min():.3g}, expected none below 0"
        )
    kept = values > 0.0
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


def standard_normal(size: int) -> FloatArray:
    """Return the same normal draws every time, (k, size); of few sizes exactly of covariance 1."""
    count = int(np.clip(2 * size, _FEWEST, MOST_SAMPLES))
    draws = np.random.default_rng(_SEED).standard_normal((count, size))
    if size >= count:
        return draws
    draws = np.linalg.qr(draws - draws.mean(axis=0))[0]
    return np.asarray(np.sqrt(count) * draws)
