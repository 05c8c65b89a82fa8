"""Least squares with the sum of absolute values as penalty, exactly."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from scipy.optimize import nnls

from femubench.core.typing import FloatArray

_RIDGE = 1e-8  # of the largest square of a column: equal columns share what one could have alone
_SAME = 1e-6  # of the largest column: mirrored members differ by 1e-9, others hardly by less


def lasso(matrix: FloatArray, right: FloatArray, weight: float) -> FloatArray:
    """Return the x that makes |A x - b|^2 / 2 + weight sum |x_j| least, (p,).

    x is the difference of two vectors that are not negative; with a triangular factor of their
    quadratic form the problem is one of non-negative least squares (Lawson & Hanson 1974). Columns
    that are equal but for rounding, as those of mirrored members, have equal x: of all x that are
    least the one of least length, whatever a processor adds up first.

    Arguments:
        matrix, right: A (k, p), not zero, and b (k,).
        weight: of the penalty, >= 0; from max |A'b| on x is zero.

    Source: Tibshirani (1996), Regression shrinkage and selection via the lasso, Journal of the
    Royal Statistical Society B 58, 267-288.

    Examples:
        >>> update.lasso(np.eye(2), np.array([3.0, 0.5]), 1.0).round(6).tolist()
        [2.0, 0.0]
    """
    size = np.linalg.norm(matrix, axis=0)
    apart = np.linalg.norm(matrix[:, :, None] - matrix[:, None, :], axis=0)
    first = (apart <= _SAME * size.max()).argmax(axis=1)
    kept, place, times = np.unique(first, return_inverse=True, return_counts=True)
    matrix, count = matrix[:, kept], len(kept)
    both = np.hstack([matrix, -matrix])
    ridge = _RIDGE * float(np.square(matrix).sum(axis=0).max())
    triangle = la.cholesky(both.T @ both + ridge * np.eye(2 * count))
    target = la.solve_triangular(triangle, both.T @ right - weight, trans="T")
    found, _ = nnls(triangle, target)
    return np.asarray(((found[:count] - found[count:]) / times)[place])
