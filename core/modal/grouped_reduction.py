"""A model from matrices in a Ritz basis in which every group stays a group.

A diagnosis solves a model hundreds of times with its groups softer, stiffer or heavier. In one
basis V that holds what all of these do, V' K_g V of every group is enough: the reduced model is a
small one with the same groups, whatever the mesh. V starts from rigid motions, modes and the
static response at the degrees of freedom that are kept; then each group is softened and stiffened
in turn, and what the modes lack, found from their residuals, is added until no frequency moves.

The kept degrees of freedom stay coordinates, so that sensors, masses and springs act on the
reduced model as on the whole one. No rigid motion moves the other coordinates.

Source: Craig & Bampton (1968), AIAA Journal 6, for kept degrees of freedom; Davidson (1975),
J. Comput. Phys. 17, for vectors from residuals; Benner, Gugercin & Willcox (2015), SIAM Review 57,
for bases in which parameters stay affine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import DENSE_LIMIT, solve_modes
from femubench.core.modal.group_prior import group_prior_std
from femubench.core.modal.rigid import rigid_body_vectors
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import FloatArray, IntArray, SparseArray

# What a joint or a clamp, of which little is known, may turn out to be; and any other part.
JOINT_FACTORS = (1e-3, 0.03, 30.0)
PART_FACTORS = (0.3, 3.0)
_SOFT = 0.05  # below which residuals are answered by the softened model: A takes many rounds
_UNKNOWN = 1.0  # deviation of the logarithm of a group from which on it is one of the former
_SHIFT = 0.5  # of the first elastic eigenvalue, below zero
_SPARE = 6  # modes above those that have to be right
_ROUNDS = 16  # of residuals to a group and factor
_A_ROUND = 16  # vectors that one of them adds at most
_APART = 1e-7  # sine below which a vector lies in the span of the others
_SHARE = 0.1  # of the tolerance, below which a residual does not matter


@dataclass(frozen=True)
class GroupedReduction:
    """The matrices of a model in a basis, and how good the basis is.

    Arguments:
        kept: rows of the whole model that are the first coordinates, (b,).
        stiffness, mass: (N, N).
        groups, mass_groups: parts of them by name, (N, N) each.
        moved: how far the last vectors that were added moved a frequency, relative; the largest
            of all groups, factors and modes.
    """

    kept: IntArray
    stiffness: FloatArray
    mass: FloatArray
    groups: dict[str, FloatArray]
    mass_groups: dict[str, FloatArray]
    moved: float


def reduce_groups(
    model: Model, kept: IntArray, count: int, *, tolerance: float = 1e-3, most: int = DENSE_LIMIT
) -> GroupedReduction:
    """Return a model with groups in a basis that holds what its groups do.

    Arguments:
        model: sparse, with groups of stiffness or mass, and no low-rank change.
        kept: rows that stay coordinates, those of sensors and attachments, (b,).
        count: number of elastic modes that have to be right.
        tolerance: of their frequencies, relative, with one group at a thousandth or thirty times.
        most: coordinates.

    Raises:
        ModelError: when kept rows and modes alone are more than the coordinates, the model has no
            modes, or a factor on a group leaves no model.
    """
    rigid = rigid_body_vectors(model.dofs)
    kept = _hold_rigid(kept, rigid)
    modes = solve_modes(model, count + _SPARE + int(rigid.shape[1]))
    least = len(kept) + len(modes) + rigid.shape[1]
    if least > most:
        raise ModelError(f"sensors, attachments and modes take {least} coordinates of {most}")
    basis = _Basis(model, float(np.abs(modes.elastic.eigenvalues[0])), most)
    unit = np.zeros((model.size, len(kept)))
    unit[kept, np.arange(len(kept))] = 1.0
    for vectors in (rigid, modes.shapes, basis.solver.solve(unit)):
        basis.add(vectors)
    moved = 0.0
    for name, part in basis.groups.items():
        known = part.is_mass or group_prior_std(model, name[1]) < _UNKNOWN
        for factor in PART_FACTORS if known else JOINT_FACTORS:
            try:
                moved = max(moved, basis.settle(name, factor, count, tolerance))
            except la.LinAlgError:
                what = f"{factor:g} times the {name[0]} of group {name[1]!r} leaves no model"
                raise ModelError(what) from None
    turn = _physical_coordinates(basis.vectors[kept], basis.coordinates(rigid))
    small = {name: turn.T @ part.small @ turn for name, part in basis.parts.items()}
    groups, mass_groups = (
        {name: small[kind, name] for name in own}
        for kind, own in (("stiffness", model.groups), ("mass", model.mass_groups))
    )
    return GroupedReduction(kept, small[_K], small[_M], groups, mass_groups, moved)


_Name = tuple[str, str]
_K, _M = ("stiffness", ""), ("mass", "")


@dataclass
class _Part:
    """One of the matrices: the rows that it touches, itself there, and in the basis."""

    rows: IntArray
    matrix: SparseArray
    small: FloatArray
    is_mass: bool

    @classmethod
    def of(cls, matrix: SparseArray, *, is_mass: bool) -> _Part:
        rows = np.flatnonzero(np.diff(matrix.tocsc().indptr))
        return cls(rows, matrix.tocsr()[rows][:, rows], np.zeros((0, 0)), is_mass)

    def times(self, vectors: FloatArray) -> FloatArray:
        """Return the product with vectors where it is not zero, (rows, m)."""
        return np.asarray(self.matrix @ vectors[self.rows])


class _Basis:
    """Motions of a model that are orthonormal in A = K + s M, and its matrices in them."""

    def __init__(self, model: Model, first: float, most: int) -> None:
        self.shift, self.most = _SHIFT * first, most
        self.solver = ShiftedModel(model, -self.shift)
        self.size = 0
        self._all = np.zeros((model.size, most), order="F")
        named = {("stiffness", n): m for n, m in model.groups.items()}
        heavy = {("mass", n): m for n, m in model.mass_groups.items()}
        self.groups = {
            name: _Part.of(matrix, is_mass=name in heavy)
            for name, matrix in (named | heavy).items()
        }
        self.parts: dict[_Name, _Part] = {
            _K: _Part.of(model.stiffness, is_mass=False),
            _M: _Part.of(model.mass, is_mass=True),
            **self.groups,
        }

    @property
    def vectors(self) -> FloatArray:
        """Return the motions, (n, N)."""
        return self._all[:, : self.size]

    def energy(self, vectors: FloatArray) -> FloatArray:
        """Return A times vectors, (n, m)."""
        model = self.solver.model
        return model.stiffness_times(vectors) + self.shift * model.mass_times(vectors)

    def coordinates(self, vectors: FloatArray) -> FloatArray:
        """Return vectors of the span by their coordinates, (N, m)."""
        return np.asarray(self.vectors.T @ self.energy(vectors))

    def add(self, vectors: FloatArray) -> int:
        """Add what the basis lacks of some vectors, as far as there is room; return how many."""
        own = vectors.astype(float, copy=True)
        for _ in range(2):  # the second time what rounding left
            own /= np.sqrt(np.maximum(np.einsum("ij,ij->j", own, self.energy(own)), 1e-300))
            before = self.size
            own -= self.vectors @ self.coordinates(own)
        gram = own.T @ self.energy(own)
        values, turn = la.eigh(gram)
        strong = np.flatnonzero(values > _APART**2)[::-1][: self.most - before]
        own = own @ (turn[:, strong] / np.sqrt(values[strong]))
        self._all[:, before : before + len(strong)] = own
        self.size += len(strong)
        for part in self.parts.values():
            border = self.vectors[part.rows].T @ part.times(own)
            grown = np.zeros((self.size, self.size))
            grown[:before, :before] = part.small
            grown[:, before:] = border
            grown[before:, :before] = border[:before].T
            part.small = grown
        return len(strong)

    def settle(self, name: _Name, factor: float, count: int, tolerance: float) -> float:
        """Add what the modes with a factor on a group lack; return how far the last still moved."""
        group, moved, before = self.groups[name], 0.0, None
        solver = self.solver
        if factor < _SOFT:
            model = self.solver.model
            softer = model.stiffness + (factor - 1.0) * model.groups[name[1]]
            solver = ShiftedModel(replace(model, stiffness=softer), -self.shift)
        for _ in range(_ROUNDS):
            values, x = self._ritz(group, factor, count)
            frequencies = np.sqrt(np.maximum(values, 0.0))
            if before is not None:
                moved = float(np.max((before - frequencies) / frequencies, initial=0.0))
                if moved < tolerance:
                    break
            before = frequencies
            added, left = self._add_residuals(group, factor, values, x, tolerance, solver)
            if not added:
                moved = left
                break
        return moved

    def _ritz(self, group: _Part, factor: float, count: int) -> tuple[FloatArray, FloatArray]:
        """Return the first elastic eigenvalues with a factor on a group, and coordinates."""
        stiffness, mass = self.parts[_K].small, self.parts[_M].small
        change = (factor - 1.0) * group.small
        if group.is_mass:
            mass = mass + change
        else:
            stiffness = stiffness + change
        # Reciprocal: low eigenvalues come out with full relative accuracy.
        size = len(mass)
        wanted = [max(size - count - _SPARE, 0), size - 1]
        mu, x = la.eigh(mass, stiffness + self.shift * mass, subset_by_index=wanted)
        values = 1.0 / mu[::-1] - self.shift
        elastic = np.flatnonzero(values > 1e-6 * self.shift)[:count]
        x = x[:, ::-1][:, elastic]
        return values[elastic], x / np.sqrt(np.einsum("ij,ij->j", x, mass @ x))

    def _add_residuals(
        self,
        group: _Part,
        factor: float,
        values: FloatArray,
        x: FloatArray,
        tolerance: float,
        solver: ShiftedModel,
    ) -> tuple[int, float]:
        """Add the response to the residuals of modes with a factor on a group.

        Returns:
            How many vectors were added, and how far they would move a frequency, relative.
        """
        model, shapes = self.solver.model, self.vectors @ x
        residual = model.stiffness_times(shapes) - values * model.mass_times(shapes)
        change = (factor - 1.0) * group.times(shapes)
        residual[group.rows] += -values * change if group.is_mass else change
        residual /= np.sqrt(values)
        # Few directions of force make up most residuals: those of what connects two parts.
        gram = residual.T @ residual
        strength, turn = la.eigh(gram)
        if not (strength > 0.0).any():
            return 0, 0.0
        residual = residual @ turn[:, strength > 1e-10 * strength[-1]]
        answer = solver.solve(residual)
        # With energy H of the answers at this factor, G H^-1 G lowers the eigenvalues, relatively.
        pull = residual.T @ answer
        energy = pull.copy()
        if solver is self.solver and not group.is_mass:
            own = answer[group.rows]
            energy += (factor - 1.0) * (own.T @ (group.matrix @ own))
        if not (energy.diagonal() > 0.0).all():
            raise la.LinAlgError("a motion without energy")
        scale = 1.0 / np.sqrt(energy.diagonal())
        strength, turn = la.eigh(scale[:, None] * energy * scale)
        sound = strength > 1e-12 * strength[-1]
        ways = scale[:, None] * turn[:, sound] / np.sqrt(strength[sound])
        left, gain, _ = la.svd(ways.T @ pull)
        kept = np.flatnonzero(np.square(gain) > 2.0 * _SHARE * tolerance)[:_A_ROUND]
        added = self.add(answer @ (ways @ left[:, kept])) if len(kept) else 0
        return added, 0.5 * float(np.square(gain).max(initial=0.0))


def _hold_rigid(kept: IntArray, rigid: FloatArray) -> IntArray:
    """Return rows with as many more as it takes for them to tell all rigid motions apart."""
    if rigid.shape[1] == 0:
        return np.unique(kept)
    pivots = la.qr(rigid.T, mode="economic", pivoting=True)[2][: rigid.shape[1]]
    return np.unique(np.concatenate([kept, pivots]).astype(np.int64))


def _physical_coordinates(kept: FloatArray, rigid: FloatArray) -> FloatArray:
    """Return the turn to coordinates of which the first are the kept rows, (N, N).

    Arguments:
        kept: those rows of the vectors, (b, N).
        rigid: rigid motions by their coordinates, (N, r); the new ones behind the kept are zero.
    """
    first = la.pinv(kept)
    rest = la.null_space(kept)
    if rigid.shape[1]:
        first = first + rest @ ((rest.T @ rigid) @ la.pinv(kept @ rigid))
    return np.hstack([first, rest])
