"""A quadratic polynomial through what is costly to compute."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.typing import FloatArray


@dataclass(frozen=True)
class QuadraticFit:
    """Least-squares quadratic polynomials f = c + x b + x A x', with x = (q - centre) / size.

    Arguments:
        centre: mean of the points, (p,).
        size: standard deviation of the points, (p,).
        constant: c, (k,).
        linear: b, (p, k).
        square: A, (p, k, p).
        error: rms error of each function at a point that was left out, (k,).
    """

    centre: FloatArray
    size: FloatArray
    constant: FloatArray
    linear: FloatArray
    square: FloatArray
    error: FloatArray

    @classmethod
    def of(cls, points: FloatArray, values: FloatArray) -> QuadraticFit:
        """Return the polynomials that are next to given values.

        Arguments:
            points: more of them than there are coefficients, (n, p).
            values: of k functions, (n, k).
        """
        centre, size = points.mean(axis=0), points.std(axis=0)
        x = (points - centre) / size
        p, k = x.shape[1], values.shape[1]
        one, other = np.triu_indices(p)
        features = np.hstack([np.ones((len(x), 1)), x, x[:, one] * x[:, other]])
        basis, triangle = np.linalg.qr(features)
        found = np.linalg.solve(triangle, basis.T @ values)
        square = np.zeros((p, k, p))
        square[one, :, other] = found[1 + p :]
        # The residual at a point that has no part in the fit follows from that of one which has.
        left_out = (values - features @ found) / (1.0 - np.square(basis).sum(axis=1))[:, None]
        error = np.sqrt(np.mean(np.square(left_out), axis=0))
        linear = np.asarray(found[1 : 1 + p])
        return cls(centre, size, np.asarray(found[0]), linear, square, np.asarray(error))

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the values at points (n, p) as (n, k)."""
        x = (points - self.centre) / self.size
        n, (p, k, _) = len(x), self.square.shape
        turned = (x @ self.square.reshape(p, k * p)).reshape(n, k, p)
        return np.asarray(self.constant + x @ self.linear + (turned @ x[:, :, None])[:, :, 0])


def coefficients_of(size: int) -> int:
    """Return how many coefficients a polynomial of so many variables has."""
    return 1 + size + size * (size + 1) // 2
