"""A least-squares problem with a prior about a point, and the bounded steps of Gauss-Newton.

To first order in a step s the cost is |r - J s|^2 + sum_i p_i (x_i + s_i)^2, with residuals r in
standard deviations, sensitivities J and precisions p of the prior. Strategies and the diagnosis
linearise their predictions differently and take their steps from here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femubench.core.errors import NotApplicable
from femubench.core.fit.dual_least_squares import MANY, dual_step
from femubench.core.typing import BoolArray, FloatArray


@dataclass(frozen=True)
class Linearised:
    """A least-squares problem about a point.

    Arguments:
        jacobian: sensitivities J of the predictions, (m, k).
        residual: measured minus predicted, r, (m,).
        x: coordinates of the point, (k,).
        precision: inverse variances of the prior about 0, 0 where nothing is known, (k,).
        well_posed: whether the prior of all coordinates is as narrow as the data need, so that the
            normal equations, a fraction of the work, lose no digits; else J is factorised.
    """

    jacobian: FloatArray
    residual: FloatArray
    x: FloatArray
    precision: FloatArray
    well_posed: bool = False

    @property
    def cost(self) -> float:
        """Return the sum of squares at the point."""
        return float(self.residual @ self.residual + self.precision @ np.square(self.x))

    @property
    def normal(self) -> FloatArray:
        """Return J'J + P, which is the inverse covariance of the coordinates, (k, k)."""
        return np.asarray(self.jacobian.T @ self.jacobian + np.diag(self.precision))

    def promise(self, step: FloatArray) -> float:
        """Return by how much a step would lower the cost, were the problem linear."""
        after, rest = self.residual - self.jacobian @ step, self.x + step
        return self.cost - float(after @ after + self.precision @ np.square(rest))

    def step(
        self,
        low: FloatArray,
        high: FloatArray,
        longest: float,
        *,
        ridge: float = 0.0,
        damping: float = 0.0,
    ) -> FloatArray:
        """Return a step on which no coordinate at a limit leaves its range, shortened as a whole.

        Arguments:
            low, high: limits of the coordinates, (k,).
            longest: largest component of a step.
            ridge: weight of the squared step (Tikhonov 1963; Horton et al. 1999, (4)).
            damping: of the diagonal of the normal matrix (Marquardt 1963).

        Raises:
            NotApplicable: for more coordinates than a dense matrix holds, without any penalty.
        """
        return solve_bounded_step(self._solver(ridge, damping), self.x, low, high, longest)

    def _solver(self, ridge: float, damping: float) -> Callable[[BoolArray], FloatArray]:
        """Return what solves for the step of the coordinates that are free."""
        s, r, x, precision = self.jacobian, self.residual, self.x, self.precision
        if len(x) > MANY:
            weight = ridge + precision
            if not (weight > 0.0).all():
                raise NotApplicable(
                    f"{len(x)} parameters without damping or a prior, expected one of them"
                )
            rest = -precision * x / weight
            return lambda free: dual_step(s[:, free], r, weight[free], rest[free])
        if self.well_posed:
            normal = self.normal + ridge * np.eye(len(x))
            normal += damping * np.diag(normal.diagonal())
            right = s.T @ r - precision * x
            return lambda free: np.asarray(
                la.solve(normal[np.ix_(free, free)], right[free], assume_a="pos")
            )
        root = np.sqrt(precision)
        rows = np.vstack([s, np.sqrt(ridge) * np.eye(len(x)), np.diag(root)])
        stacked = np.concatenate([r, np.zeros(len(x)), -root * x])
        return lambda free: np.asarray(np.linalg.lstsq(rows[:, free], stacked, rcond=None)[0])


def solve_bounded_step(
    solve: Callable[[BoolArray], FloatArray],
    at: FloatArray,
    low: FloatArray,
    high: FloatArray,
    longest: float,
) -> FloatArray:
    """Return a step on which no coordinate at a limit leaves its range, shortened as a whole.

    Coordinates that would leave are held and the rest is solved again, until none would. Off the
    limits a step may lead beyond them: clip where it ends.

    Arguments:
        solve: from which of the k coordinates are free (k,) to their step, the others held.
        at: the coordinates, (k,).
        low, high: their limits, (k,).
        longest: largest component of a step.
    """
    step = np.zeros(len(at))
    free = np.ones(len(at), dtype=bool)
    while free.any():
        step[:] = 0.0
        step[free] = solve(free)
        stuck = free & (((at <= low) & (step < 0.0)) | ((at >= high) & (step > 0.0)))
        if not stuck.any():
            break
        free &= ~stuck
    size = float(np.abs(step).max(initial=0.0))
    return step * min(1.0, longest / size) if size > 0.0 else step
