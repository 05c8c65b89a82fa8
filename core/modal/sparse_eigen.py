"""Lowest eigenpairs of large sparse models, with a count that proves that none was missed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from femubench.core.errors import ModelError
from femubench.core.fem.model import LowRank, Model
from femubench.core.modal.generalised_mass import mass_normalised
from femubench.core.modal.rigid import rigid_modes_of
from femubench.core.typing import FloatArray

_RIGID_RESIDUAL = 1e-12
_MODE_RESIDUAL = 1e-6


@dataclass(frozen=True)
class ShiftedModel:
    """A factorised K - shift M, low-rank changes by the Woodbury identity.

    Arguments:
        model: any model.
        shift: in rad^2/s^2; negative for models whose K is singular.
    """

    model: Model
    shift: float

    @cached_property
    def _factor(self) -> SuperLU:
        matrix = sp.csc_matrix(self.model.stiffness - self.shift * self.model.mass)
        try:
            return splu(
                matrix,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise ModelError(
                "K - shift M is singular: a degree of freedom has neither mass nor stiffness"
            ) from error

    @cached_property
    def _change(self) -> tuple[FloatArray, FloatArray] | None:
        """Return (basis, eigenvalues) of the low-rank part of K - shift M, full rank."""
        parts: list[tuple[LowRank, float]] = []
        if self.model.stiffness_change is not None:
            parts.append((self.model.stiffness_change, 1.0))
        if self.model.mass_change is not None and self.shift != 0.0:
            parts.append((self.model.mass_change, -self.shift))
        if not parts:
            return None
        q, r = la.qr(np.hstack([part.basis for part, _ in parts]), mode="economic")
        core = r @ la.block_diag(*(factor * part.core for part, factor in parts)) @ r.T
        values, turn = la.eigh(0.5 * (core + core.T))
        keep = np.abs(values) > 1e-14 * np.abs(values).max(initial=0.0)
        return q @ turn[:, keep], values[keep]

    @cached_property
    def _woodbury(self) -> tuple[FloatArray, FloatArray] | None:
        if self._change is None or self._change[0].shape[1] == 0:
            return None
        basis, values = self._change
        solved = self._factor.solve(basis)
        return solved, np.diag(1.0 / values) + basis.T @ solved

    def solve(self, right: FloatArray) -> FloatArray:
        """Return (K - shift M)^-1 @ right, (n,) or (n, m)."""
        answer: FloatArray = self._factor.solve(np.ascontiguousarray(right))
        if self._woodbury is None or self._change is None:
            return answer
        solved, capacitance = self._woodbury
        correction = la.solve(capacitance, self._change[0].T @ answer, assume_a="sym")
        return np.asarray(answer - solved @ correction)

    @cached_property
    def eigenvalues_below(self) -> int | None:
        """Return how many eigenvalues lie below the shift (Sylvester's law of inertia).

        None where the factorisation pivoted off the diagonal, so that its signs mean nothing.
        """
        if not np.array_equal(self._factor.perm_r, self._factor.perm_c):
            return None
        below = int(np.sum(self._factor.U.diagonal() < 0.0))
        if self._woodbury is None or self._change is None:
            return below
        # neg(A + U C U') = neg(A) + neg(C) - neg(C^-1 + U' A^-1 U), Haynsworth (1968).
        inner = la.eigvalsh(self._woodbury[1])
        return below + int(np.sum(self._change[1] < 0.0)) - int(np.sum(inner < 0.0))


def _free_rigid_modes(model: Model) -> FloatArray:
    """Return rigid-body modes that the model, changes included, leaves at zero frequency."""
    rigid = rigid_modes_of(model)
    if rigid.shape[1] == 0:
        return rigid
    force = np.linalg.norm(model.stiffness_times(rigid))
    scale = np.linalg.norm(np.abs(model.stiffness) @ np.abs(rigid))
    gram = rigid.T @ model.mass_times(rigid)
    if force > _RIGID_RESIDUAL * scale:
        return np.zeros((model.size, 0))
    return np.asarray(la.solve_triangular(la.cholesky(gram, lower=True), rigid.T, lower=True).T)


def _project(model: Model, rigid: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return the vectors without their rigid-body part."""
    return vectors - rigid @ (rigid.T @ model.mass_times(vectors))


def _first_elastic(model: Model, rigid: FloatArray) -> tuple[float, ShiftedModel]:
    """Return an estimate of the first elastic eigenvalue and a factorisation shifted below it.

    A start that is too large makes the estimate too large as well, never too small, so the shift
    is lowered until estimate and shift agree.
    """
    m, k = model.mass.diagonal(), model.stiffness.diagonal()
    carrying = (m > 0.0) & (k > 0.0)
    if not carrying.any():
        raise ModelError("no degree of freedom has both mass and stiffness")
    shift = 1e-8 * float(np.median(k[carrying] / m[carrying]))
    start = np.random.default_rng(0).standard_normal((model.size, 4))
    estimate = shift
    for _ in range(12):
        shifted = ShiftedModel(model, -shift)
        vectors = start
        for _ in range(4):
            vectors = _project(model, rigid, shifted.solve(model.mass_times(vectors)))
            vectors, _ = la.qr(vectors, mode="economic")
        gram = vectors.T @ model.mass_times(vectors)
        energy = vectors.T @ model.stiffness_times(vectors)
        values = la.eigvals(la.solve(gram, energy)).real
        estimate = float(np.min(values[values > 0.0], initial=np.inf))
        if not np.isfinite(estimate):
            return shift, shifted
        if 0.01 * estimate <= shift <= estimate:
            break
        shift = 0.1 * estimate
    return estimate, shifted


def lowest_eigenpairs(model: Model, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the lowest eigenpairs, every negative eigenvalue among them.

    Arguments:
        model: a model with more dofs than modes wanted.
        count: number of modes from the lowest non-negative one on, rigid-body modes included.

    Raises:
        ModelError: when a residual is too large or modes are missed.
    """
    rigid = _free_rigid_modes(model)
    _, shifted = _first_elastic(model, rigid)
    wanted = max(count - rigid.shape[1], 1)
    extra = 2
    for _ in range(4):
        ask = min(wanted + extra, model.size - rigid.shape[1] - 1)
        eigenvalues, shapes = _shift_invert(shifted, rigid, ask)
        missed = _missed(model, eigenvalues, rigid.shape[1], wanted)
        if missed <= 0:
            break
        extra += missed + 4
    else:
        raise ModelError(f"{missed} eigenvalues below {eigenvalues[-1]:.6g} were not found")
    _check(model, eigenvalues, shapes)
    energy = np.einsum("ij,ij->j", rigid, model.stiffness_times(rigid))
    values = np.concatenate([energy, eigenvalues])
    order = np.argsort(values, kind="stable")
    keep = order[: count + int(np.sum(eigenvalues < -1e-3 * abs(shifted.shift)))]
    return values[keep], np.hstack([rigid, shapes])[:, keep]


def _shift_invert(
    shifted: ShiftedModel, rigid: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    model, size = shifted.model, shifted.model.size

    def operate(vector: FloatArray) -> FloatArray:
        return _project(model, rigid, shifted.solve(_strip(vector)))

    def _strip(vector: FloatArray) -> FloatArray:
        return vector - model.mass_times(rigid @ (rigid.T @ vector))

    inverse = LinearOperator((size, size), matvec=operate, dtype=float)
    mass = LinearOperator((size, size), matvec=model.mass_times, dtype=float)
    stiffness = LinearOperator((size, size), matvec=model.stiffness_times, dtype=float)
    start = operate(model.mass_times(np.random.default_rng(1).standard_normal(size)))
    below = shifted.eigenvalues_below
    if below is None:
        raise ModelError("negative eigenvalues cannot be counted: the factors were pivoted")
    pieces = []
    for which, k in (("LA", count), ("SA", below)):
        if k > 0:
            pieces.append(
                eigsh(stiffness, k=k, M=mass, sigma=shifted.shift, OPinv=inverse,
                      which=which, v0=start, tol=0.0)
            )  # fmt: skip
    eigenvalues = np.concatenate([values for values, _ in pieces])
    shapes = np.hstack([vectors for _, vectors in pieces])
    order = np.argsort(eigenvalues)
    shapes = shapes[:, order]
    return eigenvalues[order], mass_normalised(model, shapes)


def _missed(model: Model, eigenvalues: FloatArray, rigid: int, wanted: int) -> int:
    """Return how many eigenvalues lie below the widest gap near the end of the list, unfound."""
    last = max(len(eigenvalues) - 3, 0)
    gaps = np.diff(eigenvalues[last:])
    if len(gaps) == 0:
        return 0
    at = last + int(np.argmax(gaps))
    for share in (0.5, 0.4, 0.6):
        shift = eigenvalues[at] + share * (eigenvalues[at + 1] - eigenvalues[at])
        below = ShiftedModel(model, float(shift)).eigenvalues_below
        if below is not None:
            return below - rigid - (at + 1)
    raise ModelError(f"eigenvalues below {eigenvalues[at + 1]:.6g} cannot be counted")


def _check(model: Model, eigenvalues: FloatArray, shapes: FloatArray) -> None:
    force = model.stiffness_times(shapes)
    inertia = model.mass_times(shapes) * eigenvalues
    scale = np.linalg.norm(np.abs(model.stiffness) @ np.abs(shapes), axis=0)
    residual = np.linalg.norm(force - inertia, axis=0) / scale
    if residual.max(initial=0.0) > _MODE_RESIDUAL:
        worst = int(residual.argmax())
        raise ModelError(f"mode {worst + 1} has a residual of {residual[worst]:.2g}")
