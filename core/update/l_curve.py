"""Tikhonov regularisation with its weight at the corner of the L-curve."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femubench.core.typing import FloatArray

_POINTS = 200
_LEAST = 1e-3  # weight, relative to the largest singular value: less is not determined by any data
_ZERO = 1e-12


def _spectrum(matrix: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the singular values that are not zero, b along their left vectors, right vectors."""
    left, singular, turn = la.svd(matrix, full_matrices=False)
    keep = singular > _ZERO * singular[0]
    return singular[keep], left.T[keep] @ right, turn[keep]


def tikhonov(matrix: FloatArray, right: FloatArray, weight: float) -> FloatArray:
    """Return the x that makes |A x - b|^2 + weight^2 |x|^2 least, (p,).

    Examples:
        >>> update.tikhonov(np.eye(2), np.array([1.0, 2.0]), 1.0).tolist()
        [0.5, 1.0]
    """
    singular, along, turn = _spectrum(matrix, right)
    return np.asarray(turn.T @ (singular / (np.square(singular) + weight**2) * along))


def l_curve_curvature(matrix: FloatArray, right: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the curvature of (ln |A x - b|, ln |x|) at regularisation weights, (k,).

    Positive where the curve bends as the corner of an L does.

    Source: Hansen & O'Leary (1993). With eta = |x|^2, rho = |A x - b|^2 and the slope of eta by
    the weight all follows from the singular values.
    """
    singular, along, _ = _spectrum(matrix, right)
    outside = max(float(right @ right - along @ along), 0.0)
    square = np.square(weights)
    kept = np.square(singular) / (np.square(singular) + square[:, None])  # k, q: filter factors
    parts = np.square(kept * along / singular)
    eta, rho = parts.sum(axis=1), np.square((1.0 - kept) * along).sum(axis=1) + outside
    slope = -4.0 / weights * ((1.0 - kept) * parts).sum(axis=1)
    bend = square * slope * rho + 2.0 * weights * eta * rho + square**2 * eta * slope
    return np.asarray(-2.0 * eta * rho / slope * bend / (square**2 * eta**2 + rho**2) ** 1.5)


def l_curve_corner(matrix: FloatArray, right: FloatArray) -> float:
    """Return the weight at the corner of the L-curve, where it bends most.

    Arguments:
        matrix, right: A (k, p), not zero, and b (k,), not zero.

    Source: Hansen & O'Leary (1993), The use of the L-curve in the regularization of discrete
    ill-posed problems, SIAM Journal on Scientific Computing 14, 1487-1503.

    Examples:
        >>> 1e-3 < update.l_curve_corner(np.diag([1.0, 1e-4]), np.array([1.0, 1e-2])) < 1.0
        True
    """
    weights = la.svdvals(matrix)[0] * np.logspace(0.0, np.log10(_LEAST), _POINTS)
    return float(weights[int(np.argmax(l_curve_curvature(matrix, right, weights)))])
