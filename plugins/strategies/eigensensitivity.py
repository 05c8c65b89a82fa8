"""Regularised sensitivity updating on frequencies and shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.linalg as la

from femubench import Measurement, Model, UpdateResult
from femubench.fem import FloatArray
from femubench.update import ModalSpace, ParametricStrategy

_POINTS = 200
_LEAST = 1e-3  # weight, relative to the largest singular value: less is not determined by any data
_ZERO = 1e-12


@dataclass(frozen=True)
class Eigensensitivity(ParametricStrategy):
    """Fit frequencies and MAC by factors that Tikhonov's term keeps near 1.

    Every iteration linearises relative frequencies and unit shapes in the logarithms x of the
    factors and takes the x that makes |S x - b|^2 + mu^2 |x|^2 least; mu is the weight at the
    corner of the L-curve of that linear problem. The squares of a unit shape's misfit sum to
    1 - MAC. Of groups of matrices each x_j is divided by the spread of its prior, so that supports
    may change more than the structure.

    Arguments:
        changes: as of `ParametricStrategy`.
        shape_weight: of a MAC of 0 against a frequency that is 100 % off; 0 for frequencies alone.

    The authors' are the sensitivities (Fox & Kapoor), the damped least squares of Natke and
    Friswell & Mottershead, and the corner as the weight; ours are logarithms, the whole change
    rather than the step in the term, the weight of shapes and steps of at most 0.5.

    Source: Friswell, Mottershead & Ahmadian (2001), Finite-element model updating using
    experimental test data: parametrization and regularization; Hansen & O'Leary (1993).
    """

    name: ClassVar[str] = "eigensensitivity"
    citation: ClassVar[str] = (
        "Friswell, Mottershead & Ahmadian (2001), Finite-element model updating using experimental "
        "test data: parametrization and regularization, Phil. Trans. R. Soc. A 359, 169-186; "
        "Hansen & O'Leary (1993), SIAM J. Sci. Comput. 14, 1487-1503 (L-curve)"
    )

    shape_weight: float = 0.1

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the factors of the last iteration.

        Raises:
            NotApplicable: when the model has no such parameters.
            StrategyFailure: when no mode of the model looks like any measured mode.
        """
        parts = self.parameterise(model)
        share, most = self.shape_weight, self.max_solves
        space = ModalSpace.of(parts, measurement, shape_weight=share, max_solves=most)
        log, fit, history, weight = space.fit_penalised(l_curve_corner, tikhonov, squares=True)
        return self.result(parts, log, history, weight=weight, paired_modes=float(fit.paired))


def _spectrum(matrix: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the singular values that are not zero, b along their left vectors, right vectors."""
    left, singular, turn = la.svd(matrix, full_matrices=False)
    keep = singular > _ZERO * singular[0]
    return singular[keep], left.T[keep] @ right, turn[keep]


def tikhonov(matrix: FloatArray, right: FloatArray, weight: float) -> FloatArray:
    """Return the x that makes |A x - b|^2 + weight^2 |x|^2 least, (p,)."""
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
    """
    weights = la.svdvals(matrix)[0] * np.logspace(0.0, np.log10(_LEAST), _POINTS)
    return float(weights[int(np.argmax(l_curve_curvature(matrix, right, weights)))])
