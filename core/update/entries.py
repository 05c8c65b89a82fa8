"""Kabe's update: the smallest relative changes of the non-zero entries of a stiffness matrix."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femubench.core.errors import ModelError, NotApplicable, SelfCheckFailed, StrategyFailure
from femubench.core.fem.model import Model
from femubench.core.modal.factorisation import LU, Cholesky, Symmetric, cholmod_obstacle
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import AnyArray, FloatArray, IntArray, SparseArray
from femubench.core.update.promise import (
    ALLOWED,
    USED_ERROR,
    Residuals,
    check_used_modes,
    force_scale,
    measure_residuals,
)
from femubench.core.update.quasi import ITERATIONS, QuasiModes
from femubench.core.update.strategy import UpdateResult


@dataclass(frozen=True)
class EntryPattern:
    """The non-zero entries of the upper triangle of a symmetric matrix.

    Arguments:
        row, column: where they stand, row <= column, (n_entries,).
        values: their nominal values, (n_entries,).
    """

    row: IntArray
    column: IntArray
    values: FloatArray
    size: int

    @classmethod
    def of(cls, model: Model) -> EntryPattern:
        """Return the pattern of a model's stiffness matrix.

        Raises:
            NotApplicable: when the stiffness has a low-rank term, which has no zeros to keep.
        """
        if model.stiffness_change is not None:
            raise NotApplicable(
                "the stiffness has a low-rank term, so that it has no pattern of zeros"
            )
        upper = sp.triu(model.stiffness, format="coo")
        upper.sum_duplicates()
        kept = upper.data != 0.0
        row, column = upper.row[kept].astype(np.int64), upper.col[kept].astype(np.int64)
        return cls(row, column, upper.data[kept], model.size)

    def __len__(self) -> int:
        return len(self.row)

    def matrix(self, changes: FloatArray) -> SparseArray:
        """Return the full matrix after relative changes of the entries, sparse (n, n).

        Arguments:
            changes: of every entry, relative to its nominal size, (n_entries,).
        """
        values = self.values + np.abs(self.values) * changes
        rows, columns, which = self._both_triangles
        return sp.csc_array((values[which], (rows, columns)), shape=(self.size, self.size))

    @cached_property
    def _both_triangles(self) -> tuple[IntArray, IntArray, IntArray]:
        """Return row, column and entry of all that is not zero in the full matrix."""
        off = np.flatnonzero(self.row != self.column)
        rows = np.concatenate([self.row, self.column[off]])
        columns = np.concatenate([self.column, self.row[off]])
        return rows, columns, np.concatenate([np.arange(len(self)), off])

    def products(self, vectors: FloatArray, scale: FloatArray) -> SparseArray:
        """Return how scale * (K @ vectors) depends on the relative changes.

        Arguments:
            vectors: (n, m).
            scale: factor of every row of the product, (n,).

        Returns:
            Sparse (n m, n_entries); row i m + j belongs to dof i of vector j.
        """
        m, (target, source, which) = vectors.shape[1], self._both_triangles
        factor = scale[target] * np.abs(self.values[which])
        data = factor[:, None] * vectors[source]
        rows = target[:, None] * m + np.arange(m)
        columns = np.broadcast_to(which[:, None], data.shape)
        triplet = (data.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_array(triplet, shape=(self.size * m, len(self)))

    def energies(self, vectors: FloatArray) -> FloatArray:
        """Return how triu(vectors' K vectors) depends on the relative changes.

        Returns:
            (m (m + 1) / 2, n_entries), rows in the order of ``numpy.triu_indices(m)``.
        """
        i, j = np.triu_indices(vectors.shape[1])
        straight = vectors[self.row][:, i] * vectors[self.column][:, j]
        mirrored = vectors[self.column][:, i] * vectors[self.row][:, j]
        both = straight + np.where((self.row != self.column)[:, None], mirrored, 0.0)
        return np.asarray((np.abs(self.values)[:, None] * both).T)


_RANK = 1e-10
_REFINEMENTS, _GRADIENTS = 8, 30
_MET, _NEAR = 1e-12, 1e-8


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
    more, found = _shortest(
        equations.fitted @ rest,
        equations.fitted_right - equations.fitted @ change,
        equations.cutoff,
    )
    return change + rest @ more, rank + found


def least_squares_change(equations: Equations, free: FloatArray) -> tuple[FloatArray, int]:
    """Return the shortest x of least squares over all rows, and their rank.

    The rows that are exact elsewhere count like the others; what must hold in spite of the data
    is in ``free``.

    Arguments:
        equations: with at most some thousand unknowns; ``cutoff`` is that of all rows.
        free: orthonormal basis of the space in which x must lie, (n_unknowns, n_free).
    """
    rows = np.vstack([equations.exact @ free, equations.fitted @ free])
    right = np.concatenate([equations.exact_right, equations.fitted_right])
    change, found = _shortest(rows, right, equations.cutoff)
    return free @ change, found


def _shortest(rows: FloatArray, right: FloatArray, cutoff: float) -> tuple[FloatArray, int]:
    """Return the shortest x of least squares without the singular values up to a cutoff, and rank.

    LAPACK's solver makes no singular vectors, which takes half the time, but measures the cutoff
    by the largest singular value: one that is known is added to the others.
    """
    largest = max(float(np.linalg.norm(rows)), 2.0 * cutoff)
    bordered = la.block_diag(rows, largest)
    found = la.lstsq(bordered, np.append(right, 0.0), cond=cutoff / largest, lapack_driver="gelsd")
    return np.asarray(found[0][:-1]), int(found[2]) - 1


def smallest_change_sparse(equations: Equations) -> FloatArray:
    """Return x of many unknowns by one sparse factorisation, of as many rows as there are forces.

    Where singular values are cut off in the dense case, they are damped here:
    |fitted x - right|^2 + cutoff^2 |x|^2 is least subject to the exact rows. The normal matrix of
    the dual problem, fitted fitted' + cutoff^2, has the pattern of K; on fine meshes it is singular
    but for rounding, so that its factor serves for conjugate gradients in extended precision, and
    the whole system is refined.

    Raises:
        StrategyFailure: when the exact rows cannot be met.

    Source: Tikhonov (1963); Bjorck (1996), Numerical methods for least squares problems, section
        2.9, for the refinement of the augmented system.
    """
    system = _Dual.of(equations)
    exact, fitted = system.exact, system.fitted
    across = fitted @ exact.T
    pulled = np.stack([system.solve(column) for column in across.T], axis=1)
    inner = (exact @ exact.T - across.T @ pulled).astype(float)
    change = np.zeros(fitted.shape[1], np.longdouble)
    force, held = np.zeros(fitted.shape[0], np.longdouble), np.zeros(len(exact), np.longdouble)
    previous = np.inf
    for _ in range(_REFINEMENTS):
        slack = fitted.T @ force + exact.T @ held - change
        balance = equations.fitted_right - fitted @ (change + slack) - system.damping * force
        missing = equations.exact_right - exact @ (change + slack)
        step = system.solve(balance)
        more = la.lstsq(inner, (missing - exact @ (fitted.T @ step)).astype(float))[0]
        step = step - pulled @ more
        turn = fitted.T @ step + exact.T @ more + slack
        change, force, held = change + turn, force + step, held + more
        size = float(np.sqrt(turn @ turn))
        if size <= _MET * float(np.sqrt(change @ change)) or size > 0.5 * previous:
            break
        previous = size
    found = np.asarray(change, dtype=float)
    left = float(np.abs(equations.exact @ found - equations.exact_right).max(initial=0.0))
    # The iteration of the caller removes what is left; this only guards against nonsense.
    if not left <= 1e-3 * max(1.0, float(np.abs(equations.exact_right).max(initial=0.0))):
        raise StrategyFailure(f"the orthogonality equations are met to {left:.2g} only")
    return found


@dataclass(frozen=True)
class _Dual:
    """The normal matrix of the forces, fitted fitted' + damping, and its factor.

    Arguments:
        fitted, exact: rows of the equations in extended precision.
        damping: cutoff^2.
        factor: of the normal matrix, in double precision.
    """

    fitted: SparseArray
    exact: AnyArray
    damping: float
    factor: Symmetric

    @classmethod
    def of(cls, equations: Equations) -> _Dual:
        """Factorise the normal matrix."""
        fitted, damping = equations.fitted, equations.cutoff**2
        normal = fitted @ fitted.T + damping * sp.eye_array(fitted.shape[0])
        long = np.longdouble
        return cls(fitted.astype(long), equations.exact.astype(long), damping, _factor(normal))

    def solve(self, right: AnyArray) -> AnyArray:
        """Return the solution for one right side by conjugate gradients, its factor before them."""
        found, left = np.zeros_like(right), right
        way = np.zeros_like(right)
        gain: Any = np.longdouble(1.0)
        first = gain
        for k in range(_GRADIENTS):
            near = self.factor.solve(left.astype(float)).astype(np.longdouble)
            old, gain = gain, left @ near
            first = gain if k == 0 else first
            if not gain > _NEAR**2 * first:
                break
            way = near + (gain / old if k else 0.0) * way
            pushed = self.fitted @ (self.fitted.T @ way) + self.damping * way
            length = gain / (way @ pushed)
            found, left = found + length * way, left - length * pushed
        return found


def _factor(normal: SparseArray) -> Symmetric:
    """Factorise a matrix that is positive definite but for rounding."""
    if cholmod_obstacle() is None:
        cholesky = Cholesky(normal)
        if cholesky.factorise(normal):
            return cholesky
    return LU(normal)


# A direction in which entries change by 100 % and forces by less than 3 % of the inertia forces
# is taken for one that the modes do not show.
CUTOFF = 0.03
# The same where the equations contradict each other. Of 0.03, 0.1, 0.3 and 1, the smallest with
# which no built-in structure that keeps its rigid-body modes gets a negative eigenvalue.
LEAST_SQUARES_CUTOFF = 0.3
MOST_ITERATIONS = 40
# So many that leave more than so much of the least residual before them lead nowhere. Where the
# used modes are reached, ten iterations left 0.54 of it at most (60 structures).
_PATIENCE, _STALLED = 10, 0.9
# Beyond these numbers of entries: a sparse solution, refusal with and without rigid-body modes.
DENSE_UNKNOWNS = 1_500
MOST_RIGID_UNKNOWNS = 2_500
MOST_UNKNOWNS = 150_000


@dataclass(frozen=True)
class EntryUpdate:
    """A model with other entries in the pattern of the nominal stiffness matrix.

    Arguments:
        changes: relative to the nominal sizes, (n_entries,).
        free: number of unknowns that the rigid-body modes leave; None where it was not counted.
        rank: of the equations in the last step; None where it was not counted.
        history: one mapping an iteration.
        used_error: largest relative error of a used frequency where the equations are met by
            least squares only; None where they are met.
    """

    model: Model
    pattern: EntryPattern
    changes: FloatArray
    free: int | None
    rank: int | None
    residuals: Residuals
    history: tuple[Mapping[str, float], ...]
    used_error: float | None = None

    @property
    def result(self) -> UpdateResult:
        """Return what a strategy hands back."""
        diagnostics = {
            "residual": self.residuals.forces,
            "entries": float(len(self.pattern)),
            "largest_relative_change": float(np.abs(self.changes).max()),
        }
        if self.rank is not None:
            diagnostics["rank"] = float(self.rank)
        if self.used_error is not None:
            diagnostics[USED_ERROR] = self.used_error
        count = len(self.pattern) if self.free is None else self.free
        return UpdateResult(
            self.model, parameter_count=count, history=self.history, diagnostics=diagnostics
        )


def equations_of(
    pattern: EntryPattern, model: Model, quasi: QuasiModes, cutoff: float = CUTOFF
) -> Equations:
    """Return the equations for further relative changes of a current estimate.

    Phi' K Phi = Lambda is exact, K Phi = M Phi Lambda fitted, with rows scaled so that
    displacements and rotations count alike and every mode's inertia forces have size 1. As the
    shapes turn with the model, both hold in the end.

    Arguments:
        cutoff: change of forces, of the inertia forces for entries that change by 100 %, below
            which a direction is left alone.

    Source: Kabe (1985); Ahmadian, Gladwell & Ismail (1997), section 4.
    """
    scale, shapes, eigenvalues = force_scale(model), quasi.shapes, quasi.eigenvalues
    inertia = model.mass_times(shapes) * eigenvalues
    size = 1.0 / np.linalg.norm(scale[:, None] * inertia, axis=0)
    force = model.stiffness_times(shapes)
    modal = shapes / np.sqrt(eigenvalues)
    energy = modal.T @ model.stiffness_times(modal)
    return Equations(
        exact=pattern.energies(modal),
        exact_right=(np.eye(len(eigenvalues)) - energy)[np.triu_indices(len(eigenvalues))],
        fitted=pattern.products(shapes * size, scale),
        fitted_right=(scale[:, None] * (inertia - force) * size).ravel(),
        cutoff=cutoff,
    )


def update_entries(
    model: Model,
    measurement: Measurement,
    rigid: FloatArray,
    cutoff: float = CUTOFF,
    least_squares_cutoff: float = LEAST_SQUARES_CUTOFF,
) -> EntryUpdate:
    """Return the model whose changed entries give the used modes, pattern kept exactly.

    Five iterations, and further ones until the used modes are there. Where they do not get there,
    the equations contradict each other: they are then met by least squares, orthogonality and
    equations of motion alike, in five iterations that each start from the nominal model. The
    rigid-body modes stay exact.

    Arguments:
        model: the nominal model.
        measurement: the used modes.
        rigid: rigid-body modes that must stay at zero frequency, (n, r).
        cutoff: as in `equations_of`.
        least_squares_cutoff: the same where least squares decide.

    Raises:
        NotApplicable: when the matrix has too many entries, or a low-rank term.
        StrategyFailure: when a measured mode has no partner in the nominal model, or loses it
            on the way of least squares.
        SelfCheckFailed: when the matrix is too large for least squares and none with the used
            modes was found.

    Source: Ahmadian, Gladwell & Ismail (1997), section 4.1.

    Examples:
        >>> entries = update.update_entries(model, measurement, np.zeros((model.size, 0)))
        >>> entries.residuals.forces < 1e-8
        True
    """
    pattern = EntryPattern.of(model)
    free = _free_directions(pattern, model, rigid)
    try:
        found = _met(model, measurement, pattern, free, cutoff)
    except (SelfCheckFailed, ModelError, la.LinAlgError):
        if free is None:
            raise
        found = _fitted(model, measurement, pattern, free, least_squares_cutoff)
    outside = (found.model.stiffness != 0.0).astype(int) - (model.stiffness != 0.0).astype(int)
    if grown := int((outside > 0).sum()):
        raise SelfCheckFailed("number of zeros of K that are zero no more", float(grown), 0.0)
    if rigid.shape[1]:
        force = np.abs(found.model.stiffness_times(rigid)).max()
        size = (np.abs(found.model.stiffness) @ np.abs(rigid)).max()
        if not force <= ALLOWED * size:
            promise = "rigid-body motions of the updated model free of forces"
            raise SelfCheckFailed(promise, float(force / size), ALLOWED)
    return found


def _met(
    model: Model,
    measurement: Measurement,
    pattern: EntryPattern,
    free: FloatArray | None,
    cutoff: float,
) -> EntryUpdate:
    """Return the model that has the used modes; raise SelfCheckFailed where none was found."""
    changes, current, rank = np.zeros(len(pattern)), model, None
    history: list[Mapping[str, float]] = []
    for step in range(MOST_ITERATIONS):
        try:
            quasi = QuasiModes.of(current, measurement)
        except StrategyFailure as lost:
            if not history:
                raise
            promise = (
                f"after step {step} {lost}, with the zeros of K kept; stiffness forces against "
                "inertia forces of the used modes"
            )
            raise SelfCheckFailed(promise, history[-1]["residual"], ALLOWED) from lost
        equations = equations_of(pattern, current, quasi, cutoff)
        if free is not None:
            change, rank = smallest_change(equations, free)
        else:
            change = smallest_change_sparse(equations)
        changes = changes + change
        current = replace(model, stiffness=pattern.matrix(changes))
        found = measure_residuals(current, quasi.shapes, quasi.eigenvalues)
        history.append({"residual": found.forces, "change": float(np.linalg.norm(change))})
        if step + 1 >= ITERATIONS and found.forces <= max(0.1 * ALLOWED, found.rounding):
            break
        left = [row["residual"] for row in history]
        if step >= _PATIENCE and min(left[-_PATIENCE:]) > _STALLED * min(left[:-_PATIENCE]):
            break
    found = check_used_modes(current, quasi.shapes, quasi.eigenvalues)
    count = None if free is None else free.shape[1]
    return EntryUpdate(current, pattern, changes, count, rank, found, tuple(history))


def _fitted(
    model: Model, measurement: Measurement, pattern: EntryPattern, free: FloatArray, cutoff: float
) -> EntryUpdate:
    """Return the model that comes nearest to the used modes in the least-squares sense."""
    changes, current, rank = np.zeros(len(pattern)), model, 0
    history: list[Mapping[str, float]] = []
    for _ in range(ITERATIONS):
        quasi = _quasi_after(len(history), current, measurement)
        before = changes
        changes, rank = least_squares_change(equations_of(pattern, model, quasi, cutoff), free)
        current = replace(model, stiffness=pattern.matrix(changes))
        found = measure_residuals(current, quasi.shapes, quasi.eigenvalues)
        change = float(np.linalg.norm(changes - before))
        history.append({"residual": found.forces, "change": change})
    last = _quasi_after(ITERATIONS, current, measurement)
    return EntryUpdate(
        model=current,
        pattern=pattern,
        changes=changes,
        free=free.shape[1],
        rank=rank,
        residuals=measure_residuals(current, last.shapes, last.eigenvalues),
        history=tuple(history),
        used_error=last.frequency_error,
    )


def _free_directions(pattern: EntryPattern, model: Model, rigid: FloatArray) -> FloatArray | None:
    """Return a basis of the changes with K rigid = 0; None where all are free and many.

    As a hard constraint: least-squares rows leave rigid-body modes at tens of Hz.
    """
    most = MOST_RIGID_UNKNOWNS if rigid.shape[1] else MOST_UNKNOWNS
    if len(pattern) > most:
        why = "the factor of their equations takes some gigabytes"
        if rigid.shape[1]:
            why = "the directions that keep the rigid-body modes fill a dense matrix"
        raise NotApplicable(
            f"the stiffness has {len(pattern)} non-zero entries, and {why} beyond {most}"
        )
    if rigid.shape[1] == 0 and len(pattern) > DENSE_UNKNOWNS:
        return None
    return null_space(pattern.products(rigid, force_scale(model)).toarray())


def _quasi_after(step: int, current: Model, measurement: Measurement) -> QuasiModes:
    try:
        return QuasiModes.of(current, measurement)
    except StrategyFailure as lost:
        text = f"after step {step} of least squares over the entries {lost}"
        raise StrategyFailure(text) from lost
