"""Least squares with far more unknowns than data, solved in the space of the data.

With a weight D > 0 on every unknown, (s's + D)^-1 s' is D^-1 s' (I + s D^-1 s')^-1 (Woodbury 1950):
a matrix of the size of the data is solved, and none of the size of the unknowns is ever made.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femubench.core.typing import FloatArray

MANY = 1000  # unknowns, up to which matrices of their size are no burden


def dual_step(
    s: FloatArray, residual: FloatArray, weight: FloatArray, rest: FloatArray
) -> FloatArray:
    """Return the x that minimises |residual - s x|^2 + sum of weight (x - rest)^2, (p,).

    Arguments:
        s: sensitivities, (m, p).
        residual: (m,).
        weight: positive, (p,).
        rest: where the unknowns would be without data, (p,).
    """
    spread = s / weight
    inner = np.eye(len(s)) + spread @ s.T
    return np.asarray(rest + spread.T @ la.solve(inner, residual - s @ rest, assume_a="pos"))


@dataclass(frozen=True)
class DualPosterior:
    """The normal distribution with covariance (s's + P)^-1 of many unknowns.

    Arguments:
        prior_std: P^-1/2, (p,).
        directions: that the data tell of, in unknowns of prior deviation 1, orthonormal, (p, r).
        known: of every direction, by what share data shorten its standard deviation, (r,).
    """

    prior_std: FloatArray
    directions: FloatArray
    known: FloatArray

    @classmethod
    def of(cls, s: FloatArray, precision: FloatArray) -> DualPosterior:
        """Return the posterior of a linear problem.

        Arguments:
            s: sensitivities of data of deviation 1, (m, p).
            precision: of the prior, positive, (p,).
        """
        prior_std = 1.0 / np.sqrt(precision)
        _, size, directions = la.svd(s * prior_std, full_matrices=False)
        return cls(prior_std, directions.T, 1.0 - 1.0 / np.hypot(1.0, size))

    @property
    def std(self) -> FloatArray:
        """Return the standard deviation of every unknown, (p,)."""
        left = 1.0 - np.square(self.directions) @ (1.0 - np.square(1.0 - self.known))
        return np.asarray(self.prior_std * np.sqrt(np.maximum(left, 0.0)))

    def draws(self, normal: FloatArray) -> FloatArray:
        """Return draws about 0, (k, p), from standard normal ones, (k, p)."""
        shortened = (normal @ self.directions) * self.known
        return np.asarray(self.prior_std * (normal - shortened @ self.directions.T))
