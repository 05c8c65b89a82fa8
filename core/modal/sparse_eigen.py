"""Lowest eigenpairs of large sparse models, with a count that proves that none was missed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from femubench.core.errors import ModelError
from femubench.core.fem.model import LowRank, Model
from femubench.core.modal.factorisation import LU, Cholesky, DefiniteLU, Symmetric, cholmod_obstacle
from femubench.core.modal.inertia import Change, negative_after, negative_by_pins, signs_hold
from femubench.core.modal.nested_dissection import dissect
from femubench.core.modal.rigid import rigid_modes_of
from femubench.core.modal.smooth_fields import softest_smooth_field
from femubench.core.typing import FloatArray, IntArray, SparseArray

_RIGID_RESIDUAL = 1e-12
_MODE_RESIDUAL = 1e-6
_BELOW_SMOOTH = 1e-3  # shift over the softest smooth field's eigenvalue
_NEGATIVE = 1e-6  # of the highest eigenvalue found: above it a negative one is a zero
_SPARE = 2  # modes found above those that are wanted
_ROUNDS = 12
_RESTARTS = 100  # of Lanczos, for eigenvalues below a shift
_SEPARATE = 1e-5  # of an eigenvalue: closer ones are counted as one
_ROUNDING = 1e-13  # of the largest k/m, below which K - shift M may be indefinite by rounding
_LARGE, _THICK = 50_000, 60  # rows, and entries of one, from which on planes order solids best
_FLAT = 1e-3  # extent of a planar structure across its plane, over its size


@dataclass(frozen=True)
class ShiftedModel:
    """A factorised K - shift M, low-rank changes by the Woodbury identity.

    Arguments:
        shift: in rad^2/s^2; negative for models whose K is singular.
        spent: of the same model at another shift: its analysis and memory serve again.
    """

    model: Model
    shift: float
    spent: Cholesky | None = field(default=None, repr=False, compare=False)

    def move(self, shift: float) -> ShiftedModel:
        """Return the model at another shift; the factors of this one go, for their memory.

        This one may be used again once the other is not: it is factorised anew.
        """
        for kept in ("_factor", "_woodbury"):
            self.__dict__.pop(kept, None)
        moved = ShiftedModel(self.model, shift, self._cholesky)
        if "_order" in vars(self):  # of the pattern, which stays
            vars(moved)["_order"] = self._order
        return moved

    @property
    def _matrix(self) -> SparseArray:
        return sp.csc_array(self.model.stiffness - self.shift * self.model.mass)

    @cached_property
    def _cholesky(self) -> Cholesky | None:
        """Return what K - shift M is to be factorised by; None where CHOLMOD is not used."""
        if self.spent is not None or cholmod_obstacle() is not None:
            return self.spent
        stiffness, mass = self.model.stiffness, self.model.mass
        extent = np.ptp(self.model.dofs.xyz, axis=0)
        return Cholesky(
            abs(stiffness) + abs(mass) + sp.eye_array(self.model.size),
            spatial=bool(extent.min() > _FLAT * extent.max()),
        )

    @cached_property
    def _order(self) -> IntArray | None:
        """Return the order of rows for SuperLU where the model is a large solid."""
        stiffness, dofs = self.model.stiffness, self.model.dofs
        size, entries = self.model.size, stiffness.nnz
        if size < _LARGE or entries < _THICK * size or not np.isfinite(dofs.xyz).all():
            return None
        return dissect(stiffness, dofs.node, dofs.xyz)

    @cached_property
    def _factor(self) -> Symmetric:
        # Above the lowest eigenvalue there is no Cholesky factorisation.
        if self.shift <= 0.0 and (cholesky := self._cholesky) and cholesky.factorise(self._matrix):
            return cholesky
        try:
            return LU(self._matrix, order=self._order)
        except RuntimeError as error:
            raise ModelError(
                "K - shift M is singular: a degree of freedom has neither mass nor stiffness"
            ) from error

    @cached_property
    def _change(self) -> Change | None:
        """Return (basis, eigenvalues) of the low-rank part of K - shift M, full rank."""
        mass = self.model.mass_change
        if mass is not None:
            mass = LowRank(mass.basis, -self.shift * mass.core) if self.shift else None
        found = LowRank.total([self.model.stiffness_change, mass])
        return None if found is None else (found.basis, np.diagonal(found.core))

    @cached_property
    def _woodbury(self) -> tuple[FloatArray, FloatArray] | None:
        if self._change is None or self._change[0].shape[1] == 0:
            return None
        basis, values = self._change
        solved = self._factor.solve(basis)
        return solved, np.diag(1.0 / values) + basis.T @ solved

    def solve(self, right: FloatArray) -> FloatArray:
        """Return (K - shift M)^-1 @ right, (n,) or (n, m)."""
        answer = self._factor.solve(right)
        if self._woodbury is None or self._change is None:
            return answer
        solved, capacitance = self._woodbury
        correction = la.solve(capacitance, self._change[0].T @ answer, assume_a="sym")
        return np.asarray(answer - solved @ correction)

    def eigenvalues_below(self, about: int = 8) -> int | None:
        """Return how many eigenvalues lie below the shift (Sylvester's law of inertia).

        None where neither the signs of pivots nor pins tell, as within rounding of an eigenvalue.

        Arguments:
            about: how many are expected; a bad guess costs time alone.
        """
        matrix, change = self._matrix, self._change
        if self.shift > 0.0 and "_factor" not in self.__dict__ and self._cholesky is not None:
            found = negative_by_pins(self._cholesky, matrix, change, self.model, about)
            if found is not None:
                return found
        below = self._factor.negative
        # Of a definite matrix no factor grows.
        if below is None or (below and not signs_hold(self._factor, matrix)):
            for kept in ("_factor", "_woodbury"):  # one factorisation at a time
                self.__dict__.pop(kept, None)
            return negative_by_pins(DefiniteLU(self._order), matrix, change, self.model, about)
        if self._woodbury is None or change is None:
            return below
        return negative_after(below, change[1], self._woodbury[1])


@dataclass(frozen=True)
class _KnownModes:
    """Mass-orthonormal modes that are known, to be kept out of motions and forces.

    Arguments:
        modes: (n, r).
        weighted: mass times modes, (n, r).
    """

    modes: FloatArray
    weighted: FloatArray

    def out_of(self, motion: FloatArray) -> FloatArray:
        return motion - self.modes @ (self.weighted.T @ motion)

    def out_of_force(self, force: FloatArray) -> FloatArray:
        return force - self.weighted @ (self.modes.T @ force)


def _random(model: Model, seed: int) -> FloatArray:
    return np.random.default_rng(seed).standard_normal(model.size)


def _below_elastic(model: Model, rigid: _KnownModes) -> tuple[ShiftedModel, FloatArray]:
    """Return a factorisation shifted below the first elastic eigenvalue, and a start for Lanczos.

    The softest smooth field is stiffer than the first mode, on frames up to a few hundred times:
    the shift lies as far below it. A shift that is too low costs nothing, one that is too high
    iterations; where two steps of inverse iteration find a softer motion than the shift, that
    alone is worth another factorisation.
    """
    m, k = model.mass.diagonal(), model.stiffness.diagonal()
    carrying = (m > 0.0) & (k > 0.0)
    if not carrying.any():
        raise ModelError("no degree of freedom has both mass and stiffness")
    scale = k[carrying] / m[carrying]
    smooth = softest_smooth_field(model, rigid.modes, rigid.weighted)
    guess = 1e-8 * float(np.median(scale)) if smooth is None else _BELOW_SMOOTH * smooth
    shifted = ShiftedModel(model, -max(guess, _ROUNDING * float(scale.max())))
    for _ in range(_ROUNDS):
        start = _random(model, 0)
        for _ in range(2):
            start = rigid.out_of(shifted.solve(rigid.out_of_force(model.mass_times(start))))
            start /= la.norm(start)
        quotient = start @ model.stiffness_times(start) / (start @ model.mass_times(start))
        if not 0.0 < quotient < -shifted.shift:
            break
        shifted = shifted.move(-0.01 * float(quotient))
    return shifted, start


def lowest_eigenpairs(model: Model, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the lowest eigenpairs, every negative eigenvalue among them.

    One factorisation below the spectrum serves the iteration, a second one the proof.

    Arguments:
        model: a model with more dofs than modes wanted.
        count: number of modes from the lowest non-negative one on, rigid-body modes included.

    Raises:
        ModelError: when a residual is too large or modes are missed.
    """
    modes = rigid_modes_of(model)
    if modes.shape[1] > 0:
        force = np.linalg.norm(model.stiffness_times(modes))
        scale = np.linalg.norm(np.abs(model.stiffness) @ np.abs(modes))
        gram = modes.T @ model.mass_times(modes)
        if force > _RIGID_RESIDUAL * scale:
            modes = np.zeros((model.size, 0))
        else:
            lower = la.cholesky(gram, lower=True)
            modes = np.asarray(la.solve_triangular(lower, modes.T, lower=True).T)
    free = modes.shape[1]
    rigid = _KnownModes(modes, model.mass_times(modes))
    shifted, start = _below_elastic(model, rigid)
    ask = min(max(count - free, 1) + _SPARE, model.size - free - 1)
    eigenvalues, shapes = _shift_invert(shifted, rigid, ask, start)
    for number in range(1, _ROUNDS):
        missed = _missed(shifted, eigenvalues, free)
        if missed <= 0:
            break
        # One start leads to one direction of a repeated eigenvalue: another is needed for the next.
        start = _random(model, number)
        weighted = np.hstack([rigid.weighted, model.mass_times(shapes)])
        known = _KnownModes(np.hstack([rigid.modes, shapes]), weighted)
        more, others = _shift_invert(shifted, known, missed + _SPARE, start)
        order = np.argsort(np.concatenate([eigenvalues, more]), kind="stable")[: len(eigenvalues)]
        eigenvalues = np.concatenate([eigenvalues, more])[order]
        shapes = np.hstack([shapes, others])[:, order]
    else:
        raise ModelError(f"{missed} eigenvalues below {eigenvalues[-1]:.6g} were not found")
    del shifted  # and the factors with it, before matrices are copied
    _check(model, eigenvalues, shapes)
    energy = np.einsum("ij,ij->j", modes, model.stiffness_times(modes))
    values = np.concatenate([energy, eigenvalues])
    order = np.argsort(values, kind="stable")
    keep = order[: count + int(np.sum(eigenvalues < -_NEGATIVE * eigenvalues[-1]))]
    return values[keep], np.hstack([modes, shapes])[:, keep]


def _shift_invert(
    shifted: ShiftedModel, known: _KnownModes, count: int, start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return so many eigenpairs above the shift, the lowest, and all below it; known ones aside."""
    model, size = shifted.model, shifted.model.size

    def operate(force: FloatArray) -> FloatArray:
        return known.out_of(shifted.solve(known.out_of_force(force)))

    inverse = LinearOperator((size, size), matvec=operate, dtype=float)
    mass = LinearOperator((size, size), matvec=model.mass_times, dtype=float)
    stiffness = LinearOperator((size, size), matvec=model.stiffness_times, dtype=float)
    below = shifted.eigenvalues_below()
    if below is None:
        raise ModelError("negative eigenvalues cannot be counted: rounding hides their signs")
    rayleigh = np.einsum("ij,ij->j", known.modes, model.stiffness_times(known.modes))
    below -= int(np.sum(rayleigh < shifted.shift))
    count = min(count, size - known.modes.shape[1] - 1)
    first = operate(model.mass_times(start))
    pieces = []
    for which, side, k, most in (("LA", "above", count, None), ("SA", "below", below, _RESTARTS)):
        if k <= 0:
            continue
        try:
            pieces.append(
                eigsh(stiffness, k=k, M=mass, sigma=shifted.shift, OPinv=inverse,
                      which=which, v0=first, tol=0.0, maxiter=most)
            )  # fmt: skip
        except ArpackError as error:
            # Far below the shift they lie next to the highest ones of its inverse.
            what = f"{k} eigenvalues {side} {shifted.shift:.3g} (rad/s)^2 do not converge"
            raise ModelError(what) from error
    eigenvalues = np.concatenate([values for values, _ in pieces])
    shapes = pieces[0][1] if len(pieces) == 1 else np.hstack([vectors for _, vectors in pieces])
    order = np.argsort(eigenvalues, kind="stable")
    if np.any(np.diff(order) < 0):
        shapes = shapes[:, order]
    # In place: nothing is as large as these.
    shapes /= np.sqrt(np.einsum("ij,ij->j", shapes, model.mass_times(shapes)))
    return eigenvalues[order], shapes


def _missed(shifted: ShiftedModel, eigenvalues: FloatArray, rigid: int) -> int:
    """Return how many eigenvalues lie below the widest gap near the end of the list, unfound.

    A list that ends within a repeated eigenvalue is counted up to just below this one.
    """
    top = float(eigenvalues[-1])
    last = max(len(eigenvalues) - 3, 0)
    gaps = np.diff(eigenvalues[last:])
    shifts = [top - share * _SEPARATE * abs(top) for share in (1.0, 0.5, 2.0)]
    if gaps.max(initial=0.0) > _SEPARATE * abs(top):
        lower = eigenvalues[last + int(np.argmax(gaps))]
        shifts = [float(lower + share * gaps.max()) for share in (0.5, 0.4, 0.6)]
    for shift in shifts:
        found = rigid + int(np.sum(eigenvalues < shift))
        below = shifted.move(shift).eigenvalues_below(found)
        if below is not None:
            return below - found
    raise ModelError(f"eigenvalues below {top:.6g} cannot be counted")


def _check(model: Model, eigenvalues: FloatArray, shapes: FloatArray) -> None:
    size = abs(model.stiffness)
    residual = np.empty(len(eigenvalues))
    for i, (eigenvalue, shape) in enumerate(zip(eigenvalues, shapes.T, strict=True)):
        force = model.stiffness_times(shape)
        residual[i] = la.norm(force - eigenvalue * model.mass_times(shape))
        residual[i] /= la.norm(size @ np.abs(shape))
    if residual.max(initial=0.0) > _MODE_RESIDUAL:
        worst = int(residual.argmax())
        raise ModelError(f"mode {worst + 1} has a residual of {residual[worst]:.2g}")
