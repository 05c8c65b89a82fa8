"""Updating by the equation error of quasi-measured modes, for any family of element matrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee

from femubench.core.errors import NotApplicable, SelfCheckFailed, StrategyFailure
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import DENSE_LIMIT, dense_matrices
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.rigid import rigid_modes_of
from femubench.core.typing import FloatArray, IntArray, SparseArray
from femubench.core.update.element_families import Family
from femubench.core.update.quasi import ITERATIONS, Expansion, Frequencies, QuasiModes, WantedModes
from femubench.core.update.strategy import ParameterEstimate, UpdateResult

FLOOR = 0.01  # what an element keeps at least of its nominal stiffness, in every strain motion
_GAP = 1e-9  # of the squared size of the equations
_SHRINK = 0.2
_MOST_STEPS = 400
_RIDGE = 1e-14  # decides motions of x that no equation sees
_REFINED = 2  # solutions of what the last one left


def smallest_core_eigenvalue(family: Family, x: FloatArray) -> float:
    """Return the smallest eigenvalue of all relative element cores; 1 for the nominal model."""
    return float(np.linalg.eigvalsh(family.relative_cores(x)).min())


def nearest_positive(family: Family, rows: SparseArray, best: FloatArray) -> FloatArray:
    """Return the least-squares solution among cores with eigenvalues of at least `FLOOR`.

    The problem is convex; a logarithmic barrier with Newton steps from the nominal model solves
    it. Where the unbounded solution `best` qualifies, it is the answer.

    Arguments:
        family: elements with cores, linear in the unknowns.
        rows: A of the equations, sparse (m, n).
        best: the solution of least squares without bounds, (n,).

    Raises:
        StrategyFailure: when the steps do not converge.

    Source: Boyd & Vandenberghe (2004), sections 11.3 and 11.6 (log-determinant barrier).
    """
    if smallest_core_eigenvalue(family, best) >= FLOOR:
        return best
    hessian = Hessian.of(family, rows)
    objective = float(best @ hessian.times(best))
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
    raise StrategyFailure(
        f"no element stiffness without negative values found in {_MOST_STEPS} steps"
    )


@dataclass(frozen=True)
class Hessian:
    """A'A of equations, its largest diagonal term 1, and a ridge.

    Equations of motion couple unknowns of elements that meet, which stand near each other in the
    right order; those of orthogonality see all unknowns, are few, and are kept apart.

    Arguments:
        rows: A, sparse (m, n).
        wide: those of its rows that see many unknowns, in that order, (k, n).
        order: of the unknowns, (n,).
        band: what the other rows and the ridge are in that order, below the diagonal, (b + 1, n).
        places: in the band of each pair of patterns of an element, behind it where there is none,
            (n_e, n_a, n_a).
    """

    rows: SparseArray
    wide: FloatArray
    order: IntArray
    band: FloatArray
    places: IntArray

    @classmethod
    def of(cls, family: Family, rows: SparseArray) -> Hessian:
        """Find an order of the unknowns of a family with a narrow band."""
        rows = sp.csr_array(rows / np.sqrt(max(float(rows.power(2).sum(axis=0).max()), 1e-300)))
        n = rows.shape[1]
        wide = np.diff(rows.indptr) > n // 4
        wide &= wide.sum() <= n // 4
        thin = rows[~wide]
        used = family.columns >= 0
        own = sp.csr_array(
            (np.ones(used.sum()), (np.nonzero(used)[0], family.columns[used])), shape=(len(used), n)
        )
        normal = sp.coo_array(thin.T @ thin + _RIDGE * sp.eye_array(n))
        order = reverse_cuthill_mckee(sp.csr_array(abs(normal) + own.T @ own), symmetric_mode=True)
        at = np.append(np.argsort(order), -n)  # the last one for what is no unknown
        i, j = at[family.columns][:, :, None], at[family.columns][:, None, :]
        low, right = at[normal.row] - at[normal.col], at[normal.col]
        width = 1 + max(int(low.max()), int(np.where((i >= 0) & (j >= 0), i - j, 0).max()))
        band = np.zeros((width, n))
        band[low[low >= 0], right[low >= 0]] = normal.data[low >= 0]
        places = np.where((j >= 0) & (i >= j), (i - j) * n + j, width * n)
        return cls(rows, rows[wide].toarray()[:, order], order, band, places)

    def times(self, x: FloatArray) -> FloatArray:
        """Return the matrix times a vector, (n,)."""
        return np.asarray(self.rows.T @ (self.rows @ x) + _RIDGE * x)

    def solve(self, bend: FloatArray, right: FloatArray) -> FloatArray:
        """Return the solution for a right side, blocks of elements added, (n,).

        Arguments:
            bend: added to the unknowns of each pair of patterns of an element, (n_e, n_a, n_a).

        Source: Woodbury (1950) for the rows that see many unknowns.
        """
        added = np.bincount(self.places.ravel(), bend.ravel(), self.band.size + 1)[:-1]
        band = self.band + added.reshape(self.band.shape)
        factor = _definite(band), True
        turned = la.cho_solve_banded(factor, self.wide.T)
        inner = la.cho_factor(np.eye(len(self.wide)) + self.wide @ turned)
        found, left = np.zeros(len(right)), right[self.order]
        for _ in range(_REFINED):
            near = la.cho_solve_banded(factor, left)
            found += near - turned @ la.cho_solve(inner, self.wide @ near)
            pushed = la.blas.dsbmv(len(band) - 1, 1.0, band, found, lower=1)
            left = right[self.order] - pushed - self.wide.T @ (self.wide @ found)
        return found[np.argsort(self.order)]


def _definite(band: FloatArray) -> FloatArray:
    """Return the Cholesky factor of a band, its diagonal raised until it has one."""
    band, shift = band.copy(), np.finfo(float).eps * float(band[0].max())
    while True:
        try:
            return np.asarray(la.cholesky_banded(band, lower=True))
        except la.LinAlgError:
            band[0] += shift
            shift *= 10.0


def _newton(
    family: Family, hessian: Hessian, best: FloatArray, x: FloatArray, barrier: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return gradient, Newton step and Newton decrement squared."""
    assert family.cores is not None
    room = family.relative_cores(x) - FLOOR * np.eye(family.cores.shape[-1])
    tilted = np.asarray(np.linalg.solve(room[:, None], family.cores), dtype=float)  # e, a, q, q
    pull = np.einsum("eaqq->ea", tilted)
    flat = tilted.reshape(*tilted.shape[:2], -1)
    bend = flat @ np.swapaxes(tilted, 2, 3).reshape(flat.shape).swapaxes(1, 2)
    n = len(x)
    row = np.where(family.columns < 0, n, family.columns)  # row n collects what is no unknown
    gradient = np.bincount(row.ravel(), -pull.ravel(), n + 1)[:n]
    total = hessian.times(x - best) + barrier * gradient
    step = -hessian.solve(np.asarray(barrier * bend, dtype=float), total)
    return total, step, float(-total @ step)


def _line_search(
    family: Family, hessian: Hessian, best: FloatArray, x: FloatArray,
    slope: FloatArray, step: FloatArray, barrier: float,
) -> FloatArray:  # fmt: skip
    """Return the next point, inside the cone and lower by Armijo's rule; x itself if none is."""

    def value(point: FloatArray) -> float:
        room = np.linalg.eigvalsh(family.relative_cores(point)) - FLOOR
        if room.min() <= 0.0:
            return np.inf
        apart = point - best
        return float(0.5 * apart @ hessian.times(apart) - barrier * np.log(room).sum())

    start, gain, length = value(x), float(slope @ step), 1.0
    while length > 1e-10:
        if value(x + length * step) <= start + 0.1 * length * gain:
            return np.asarray(x + length * step)
        length *= 0.5
    return x


MOST_UNKNOWNS = 2000  # dense, so that rank is decidable: about 20 s for five iterations
# Weights of phi_i' K phi_j / (omega_i omega_j) = delta_ij, relative to the inertia forces. An error
# of a shape enters the diagonal in second order and the others in first order, so the others weigh
# less. Heavier ones bring no closer frequencies on the ladder frame, and take single elements of
# the H-frame, whose nominal model cannot meet them, down to no stiffness at all.
DIAGONAL_WEIGHT = 10.0
CROSS_WEIGHT = 2.0
_CUTOFF = 1e-10
_RIGID_FORCE = 1e-9
_NEGATIVE = 1e-9


@dataclass(frozen=True)
class Solution:
    """The answer of one iteration.

    Arguments:
        x: relative changes, (n_unknowns,).
        condition: ratio of the largest to the smallest singular value that counts.
        residual: norm of A x - b over that of the inertia forces.
        equations: number of rows.
        free: unknowns left by hard constraints.
    """

    x: FloatArray
    rank: int
    condition: float
    residual: float
    equations: int
    free: int


def row_scale(model: Model, family: Family) -> FloatArray:
    """Return 1 for forces and 1/L for moments, L being the length of the family, (n,)."""
    turning = np.array([direction.startswith("r") for direction in model.dofs.direction])
    return np.where(turning, 1.0 / family.length, 1.0)


def equations(
    model: Model, family: Family, quasi: QuasiModes, *, orthogonality: bool
) -> tuple[SparseArray, FloatArray, float]:
    """Return A, b of A x = b and the norm of the inertia forces.

    Rows: S (sum x_j K_j) Phi = S (M Phi Lambda - K0 Phi), and optionally the upper triangle of
    Phi' (sum x_j K_j) Phi = Lambda - Phi' K0 Phi.

    Source: Ahmadian, Gladwell & Ismail (1997), section 4.
    """
    scale = row_scale(model, family)
    columns = family.forces(quasi.shapes)
    inertia = model.mass_times(quasi.shapes) * quasi.eigenvalues
    elastic = model.stiffness_times(quasi.shapes)
    size = float(np.linalg.norm(scale[:, None] * inertia))
    blocks = [sp.diags_array(scale) @ block for block in columns]
    right = [(scale[:, None] * (inertia - elastic)).T.ravel()]
    if orthogonality:
        omega = np.sqrt(quasi.eigenvalues)
        missing = np.diag(quasi.eigenvalues) - quasi.shapes.T @ elastic
        for j, block in enumerate(columns):
            weight = np.where(np.arange(j + 1) == j, DIAGONAL_WEIGHT, CROSS_WEIGHT)
            weight = weight * size / (omega[j] * omega[: j + 1])
            blocks.append(sp.csr_array(weight[:, None] * (block.T @ quasi.shapes[:, : j + 1]).T))
            right.append(weight * missing[: j + 1, j])
    return sp.csr_array(sp.vstack(blocks)), np.concatenate(right), size


def _triangular(matrix: SparseArray, right: FloatArray) -> FloatArray:
    """Return the R factor of [A b], block of rows by block of rows."""
    count = matrix.shape[1] + 1
    block, kept = max(4 * count, 2048), np.zeros((0, count))
    for start in range(0, matrix.shape[0], block):
        rows = slice(start, start + block)
        part = np.column_stack([matrix[rows].toarray(), right[rows]])
        stacked = np.vstack([kept, part])
        kept = la.qr(stacked, mode="r", check_finite=True)[0][:count]
    return np.asarray(kept)


def solve_least_change(
    matrix: SparseArray, right: FloatArray, family: Family, basis: FloatArray | None
) -> Solution:
    """Return the smallest x that solves A x = b in the sense of least squares.

    Arguments:
        basis: x = basis @ y, from hard constraints; None for all x.

    Raises:
        StrategyFailure: when element cores must stay positive and no such x is found.
    """
    reduced = _triangular(matrix, right)
    a, b = reduced[:, :-1], reduced[:, -1]
    inner = a if basis is None else a @ basis
    y, _, rank, singular = la.lstsq(inner, b, cond=_CUTOFF, lapack_driver="gelsd")
    x = y if basis is None else basis @ y
    if family.cores is not None:
        x = nearest_positive(family, matrix, x)
    return Solution(
        x=np.asarray(x),
        rank=int(rank),
        condition=float(singular[0] / singular[rank - 1]) if rank else 0.0,
        residual=float(np.linalg.norm(a @ x - b)),
        equations=matrix.shape[0],
        free=inner.shape[1],
    )


def rigid_basis(model: Model, family: Family, rigid: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the changes that leave rigid-body modes free, (n, k).

    Arguments:
        rigid: rigid-body modes of the model, (n, r).
    """
    scale = sp.diags_array(row_scale(model, family))
    rows = sp.csr_array(sp.vstack([scale @ block for block in family.forces(rigid)]))
    reduced = _triangular(rows, np.zeros(rows.shape[0]))[:, :-1]
    _, singular, right = la.svd(reduced)
    rank = int(np.sum(singular > _CUTOFF * singular[0]))
    return np.asarray(right[rank:].T)


def update_by_equation_error(
    model: Model,
    measurement: Measurement,
    family: Family,
    *,
    orthogonality: bool = True,
    keep_rigid: bool = False,
    expansion: Expansion = "rotation",
    frequencies: Frequencies = "measured",
    iterations: int = ITERATIONS,
) -> UpdateResult:
    """Return the model after five iterations, or fewer, of expansion and solution.

    Arguments:
        family: where updated element or group matrices are looked for; with cores they stay
            positive semidefinite.
        orthogonality: whether the orthogonality of the modes adds equations.
        keep_rigid: whether the rigid-body modes of the model are hard constraints.
        expansion: `rotation`, equations (16)-(17) with the current model; `force`, equation (15)
            with the nominal one (small models only).
        frequencies: those of the equations; `nominal` are the nominal model's own, so that shapes
            alone are measured.

    Raises:
        NotApplicable: when there are too many unknowns, or no rigid-body modes to keep.
        StrategyFailure: when a measured mode has no partner, or a promise is not kept.

    Source: Ahmadian, Gladwell & Ismail (1997), section 4.
    """
    if len(family) > MOST_UNKNOWNS:
        raise NotApplicable(
            f"{len(family)} unknowns: their rank comes from a dense matrix, whose work grows "
            f"with the cube, so that {MOST_UNKNOWNS} at most are solved for; "
            "changes=members, sections or sets has fewer"
        )
    rigid = rigid_modes_of(model)
    if keep_rigid and rigid.shape[1] == 0:
        raise NotApplicable("the model has no free rigid-body modes that could be kept")
    basis = rigid_basis(model, family, rigid) if keep_rigid else None
    modes = WantedModes(model, measurement, expansion, frequencies)
    current, x, history = model, np.zeros(len(family)), []
    for _ in range(iterations):  # mass and zero point stay nominal
        a, b, size = equations(model, family, modes.at(current), orthogonality=orthogonality)
        solution = solve_least_change(a, b, family, basis)
        change = np.linalg.norm(solution.x - x) / max(float(np.linalg.norm(solution.x)), 1e-300)
        x = solution.x
        current = family.change_model(model, x)
        history.append({"residual": solution.residual / size, "change": float(change)})
    promised = keep_rigid or family.cores is not None
    diagnostics = {
        "equations": float(solution.equations),
        "unknowns": float(len(family)),
        "rank": float(solution.rank),
        "condition": solution.condition,
        **_self_check(current, family, x, rigid, promised=promised),
    }
    columns = family.names, family.before, family.values(x), family.units, family.places
    estimates = tuple(
        ParameterEstimate(name, float(before), float(after), unit, places=places)
        for name, before, after, unit, places in zip(*columns, strict=True)
    )
    return UpdateResult(current, solution.free, estimates, tuple(history), diagnostics)


def _self_check(
    model: Model, family: Family, x: FloatArray, rigid: FloatArray, *, promised: bool
) -> Mapping[str, float]:
    """Return the measured figures; raise where a family that promises them does not hold them."""
    checks = {}
    if rigid.shape[1]:
        force = np.linalg.norm(model.stiffness @ rigid)
        scale = np.linalg.norm(np.abs(model.stiffness) @ np.abs(rigid))
        checks["rigid_force"] = float(force / scale)
        if promised and checks["rigid_force"] > _RIGID_FORCE:
            promise = "rigid-body motions of the updated model free of forces"
            raise SelfCheckFailed(promise, checks["rigid_force"], _RIGID_FORCE)
    if family.cores is None:
        return checks
    checks["smallest_core"] = smallest_core_eigenvalue(family, x)
    if checks["smallest_core"] < 0.0:
        promise = "stiffness of every element positive, relative to what it was"
        raise SelfCheckFailed(promise, -checks["smallest_core"], 0.0)
    if model.size <= DENSE_LIMIT:
        stiffness = dense_matrices(model)[1]
        root = np.sqrt(np.diagonal(stiffness))
        lowest = float(la.eigvalsh(stiffness / np.outer(root, root), subset_by_index=(0, 0))[0])
        checks["smallest_eigenvalue"] = lowest
        if lowest < -_NEGATIVE:
            promise = "stiffness of the updated model without a negative eigenvalue"
            raise SelfCheckFailed(promise, -lowest, _NEGATIVE)
    return checks
