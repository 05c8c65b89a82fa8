"""The smallest change of many unknowns that meets equations of unequal rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from femubench.core.errors import StrategyFailure
from femubench.core.typing import FloatArray, SparseArray

_RANK = 1e-10
_REFINEMENTS = 60
_MET = 1e-13
_WEAK = 1e-6


@dataclass(frozen=True)
class Equations:
    """Linear equations in unknowns x, in the order in which they are to be met.

    Arguments:
        exact: rows with exact @ x = exact_right, (k, n_unknowns), k small.
        exact_right: (k,).
        fitted: rows to be met in the least-squares sense, sparse (n_fitted, n_unknowns).
        fitted_right: (n_fitted,).
        cutoff: singular values of ``fitted`` below it count as zero.
    """

    exact: FloatArray
    exact_right: FloatArray
    fitted: SparseArray
    fitted_right: FloatArray
    cutoff: float


def null_space(rows: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what the rows leave free, (n_unknowns, n_free)."""
    if rows.shape[0] == 0:
        return np.eye(rows.shape[1])
    q, r, _ = la.qr(rows.T, pivoting=True)
    diagonal = np.abs(np.diagonal(r))
    return np.asarray(q[:, int(np.sum(diagonal > _RANK * diagonal[0])) :])


def smallest_change(equations: Equations, free: FloatArray) -> tuple[FloatArray, int]:
    """Return the shortest x and the rank of the equations, by singular values.

    Arguments:
        equations: with at most some thousand unknowns.
        free: orthonormal basis of the space in which x must lie, (n_unknowns, n_free).
    """
    left, singular, right = la.svd(equations.exact @ free)
    rank = int(np.sum(singular > _RANK * singular[0]))
    solved = (left[:, :rank].T @ equations.exact_right) / singular[:rank]
    change = free @ (right[:rank].T @ solved)
    rest = free @ right[rank:].T
    left, singular, right = la.svd(equations.fitted @ rest, full_matrices=False)
    found = int(np.sum(singular > equations.cutoff))
    target = left[:, :found].T @ (equations.fitted_right - equations.fitted @ change)
    return change + rest @ (right[:found].T @ (target / singular[:found])), rank + found


def smallest_change_sparse(equations: Equations) -> FloatArray:
    """Return x of many unknowns by one sparse factorisation.

    Where singular values are cut off in the dense case, they are damped here:
    |fitted x - right|^2 + cutoff^2 |x|^2 is least subject to the exact rows, which the method of
    multipliers meets to rounding.

    Raises:
        StrategyFailure: when the exact rows cannot be met.

    Source: Tikhonov (1963); Rockafellar (1976), proximal method of multipliers.
    """
    exact, weak = sp.csr_array(equations.exact), _WEAK * equations.cutoff**2
    factor = _factorised(equations, exact, weak)
    count, rows = exact.shape[1], equations.fitted.shape[0]
    head = np.concatenate([np.zeros(count), equations.fitted_right])
    force, previous = np.zeros(exact.shape[0]), np.inf
    for _ in range(_REFINEMENTS):
        solution = factor.solve(np.concatenate([head, equations.exact_right - weak * force]))
        change, force = solution[:count], solution[count + rows :]
        missing = float(np.abs(exact @ change - equations.exact_right).max())
        if missing <= _MET or missing > 0.5 * previous:
            break
        previous = missing
    # The iteration of the caller removes what is left; this only guards against nonsense.
    if not missing <= 1e-3 * max(1.0, float(np.abs(equations.exact_right).max())):
        raise StrategyFailure(f"the orthogonality equations are met to {missing:.2g} only")
    return np.asarray(change)


def _factorised(equations: Equations, exact: SparseArray, weak: float) -> SuperLU:
    """Factorise the equations of the damped problem, exact rows given way by ``weak``."""
    fitted = equations.fitted
    system = sp.block_array(
        [
            [equations.cutoff**2 * sp.eye_array(fitted.shape[1]), fitted.T, exact.T],
            [fitted, -sp.eye_array(fitted.shape[0]), None],
            [exact, None, -weak * sp.eye_array(exact.shape[0])],
        ]
    )
    # Quasidefinite: it has an LDL' factorisation in every symmetric order (Vanderbei 1995).
    return splu(
        sp.csc_matrix(system),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
