"""Least squares over element cores that stay positive definite."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femubench.core.errors import StrategyFailure
from femubench.core.typing import FloatArray
from femubench.core.update.element_families import ElementFamily

FLOOR = 0.01  # what an element keeps at least of its nominal stiffness, in every strain motion
_GAP = 1e-9  # of the squared size of the equations
_SHRINK = 0.2
_MOST_STEPS = 400
_RIDGE = 1e-14  # decides motions of x that no equation sees


def smallest_core_eigenvalue(family: ElementFamily, x: FloatArray) -> float:
    """Return the smallest eigenvalue of all relative element cores; 1 for the nominal model."""
    return float(np.linalg.eigvalsh(family.relative_cores(x)).min())


def nearest_positive(family: ElementFamily, normal: FloatArray, best: FloatArray) -> FloatArray:
    """Return the least-squares solution among cores with eigenvalues of at least `FLOOR`.

    The problem is convex; a logarithmic barrier with Newton steps from the nominal model solves
    it. Where the unbounded solution `best` qualifies, it is the answer.

    Arguments:
        family: elements with cores, linear in the unknowns.
        normal: A'A of the equations, (n, n).
        best: the solution of least squares without bounds, (n,).

    Raises:
        StrategyFailure: when the steps do not converge.

    Source: Boyd & Vandenberghe (2004), sections 11.3 and 11.6 (log-determinant barrier).
    """
    if smallest_core_eigenvalue(family, best) >= FLOOR:
        return best
    size = max(float(np.abs(np.diagonal(normal)).max()), 1e-300)
    hessian = normal / size + _RIDGE * np.eye(len(best))
    objective = float(best @ hessian @ best)
    x, barrier = np.zeros_like(best), objective
    count = family.cores.shape[0] * family.cores.shape[-1] if family.cores is not None else 1
    for _ in range(_MOST_STEPS):
        slope, step, size_of_step = _newton(family, hessian, best, x, barrier)
        moved = x
        if size_of_step > 0.1 * barrier:
            moved = _line_search(family, hessian, best, x, slope, step, barrier)
        if moved is x:
            if barrier * count <= _GAP * objective:
                return x
            barrier *= _SHRINK
        x = moved
    raise StrategyFailure(f"positive element stiffness: no convergence in {_MOST_STEPS} steps")


def _newton(
    family: ElementFamily, hessian: FloatArray, best: FloatArray, x: FloatArray, barrier: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return gradient, Newton step and Newton decrement squared."""
    assert family.cores is not None
    room = family.relative_cores(x) - FLOOR * np.eye(family.cores.shape[-1])
    tilted = np.linalg.solve(room[:, None], family.cores)  # e, a, q, q
    pull = np.einsum("eaqq->ea", tilted)
    bend = np.einsum("eaij,ebji->eab", tilted, tilted)
    n = len(x)
    row = np.where(family.columns < 0, n, family.columns)  # row n collects what is no unknown
    gradient = np.zeros(n + 1)
    np.add.at(gradient, row, -pull)
    second = np.zeros((n + 1, n + 1))
    np.add.at(second, (row[:, :, None], row[:, None, :]), bend)
    total = hessian @ (x - best) + barrier * gradient[:n]
    curvature = hessian + barrier * second[:n, :n]
    try:
        step = -la.cho_solve(la.cho_factor(curvature), total)
    except la.LinAlgError:  # singular to roundoff: the shortest step will do
        step = -la.lstsq(curvature, total)[0]
    return total, step, float(-total @ step)


def _line_search(
    family: ElementFamily, hessian: FloatArray, best: FloatArray, x: FloatArray,
    slope: FloatArray, step: FloatArray, barrier: float,
) -> FloatArray:  # fmt: skip
    """Return the next point, inside the cone and lower by Armijo's rule; x itself if none is."""

    def value(point: FloatArray) -> float:
        room = np.linalg.eigvalsh(family.relative_cores(point)) - FLOOR
        if room.min() <= 0.0:
            return np.inf
        apart = point - best
        return float(0.5 * apart @ hessian @ apart - barrier * np.log(room).sum())

    start, gain, length = value(x), float(slope @ step), 1.0
    while length > 1e-10:
        if value(x + length * step) <= start + 0.1 * length * gain:
            return np.asarray(x + length * step)
        length *= 0.5
    return x
