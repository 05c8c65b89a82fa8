"""Sparse updating: few factors change, found by an l1 penalty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.linalg as la
from scipy.optimize import nnls

from femubench import Measurement, Model, UpdateResult
from femubench.fem import FloatArray
from femubench.update import ModalSpace, ParametricStrategy

_RIDGE = 1e-8  # of the largest square of a column: equal columns share what one could have alone
_SAME = 1e-6  # of the largest column: mirrored members differ by 1e-9, others hardly by less
_WEIGHTS = np.logspace(0.0, -5.0, 21)  # of the least weight at which nothing changes
_ZERO = 1e-3  # a smaller ln(factor) is no change


@dataclass(frozen=True)
class Sparse(ParametricStrategy):
    """Fit the frequencies by few factors, all others left as they are.

    Every iteration linearises relative frequencies in the logarithms x of the factors and takes
    the x that makes |S x - b|^2 / 2 + mu sum |x_j| least. mu is the weight at which the linear
    problem without one of the frequencies foretells that one best, each left out in turn. Of groups
    of matrices each x_j is divided by the spread of its prior.

    Arguments:
        changes: as of `ParametricStrategy`.

    The authors' are the l1 penalty on the changes and the frequencies' sensitivities; the
    criterion for its weight (Tibshirani's cross-validation), logarithms, and a new
    linearisation until nothing moves are ours.
    """

    name: ClassVar[str] = "sparse"
    citation: ClassVar[str] = (
        "Hou, Xia & Zhou (2018), Structural damage detection based on l1 regularization using "
        "natural frequencies and mode shapes, Structural Control and Health Monitoring 25, e2107; "
        "Tibshirani (1996), Regression shrinkage and selection via the lasso"
    )

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the factors of the last iteration.

        Raises:
            NotApplicable: when the model has no such parameters.
            StrategyFailure: when no mode of the model looks like any measured mode.
        """
        parts = self.parameterise(model)
        space = ModalSpace.of(parts, measurement, shape_weight=0.0, max_solves=self.max_solves)
        log, _, history, weight = space.fit_penalised(cross_validated_weight, lasso, squares=False)
        changed = float((np.abs(log) > _ZERO).sum())
        return self.result(parts, log, history, weight=weight, changed=changed)


def cross_validated_weight(slope: FloatArray, right: FloatArray) -> float:
    """Return the l1 weight at which equations left out one by one are predicted best.

    Arguments:
        slope, right: S (m, p) and b (m,).
    """
    weights = float(np.abs(slope.T @ right).max()) * _WEIGHTS
    count = len(right)
    share = (count - 1) / count  # a sum of fewer squares is to be penalised less
    error = np.zeros(len(weights))
    for row in range(count):
        rest = np.arange(count) != row
        if not slope[rest].any():
            continue
        for k, weight in enumerate(weights):
            x = lasso(slope[rest], right[rest], share * weight)
            error[k] += float(slope[row] @ x - right[row]) ** 2
    return float(weights[int(np.argmin(error))])


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
