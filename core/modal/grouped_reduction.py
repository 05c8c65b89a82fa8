"""A model from matrices in a Ritz basis in which every group stays a group.

A diagnosis solves a model hundreds of times with its groups softer, stiffer or heavier. In one
basis V that holds what all of these do, V' K_g V of every group is enough: the reduced model is a
small one with the same groups, whatever the mesh. V starts from rigid motions, modes and the
static response at the degrees of freedom that are kept. Then each group is softened and stiffened
for itself, and the response to what its modes leave unbalanced there is added until neither this
response nor the last one moves a frequency. Where all of it is more than there is room for, the
motions that carry most energy of all these modes stay.

The kept degrees of freedom stay coordinates, so that sensors, masses and springs act on the
reduced model as on the whole one. No rigid motion moves the other coordinates.

Source: Craig & Bampton (1968), AIAA Journal 6, for kept degrees of freedom; Davidson (1975),
J. Comput. Phys. 17, for vectors from residuals; Sirovich (1987), Quart. Appl. Math. 45, for those
that carry most energy; Benner, Gugercin & Willcox (2015), SIAM Review 57,
for bases in which parameters stay affine.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import DENSE_LIMIT, solve_modes
from femubench.core.modal.group_prior import group_prior_std
from femubench.core.modal.rigid import rigid_body_vectors
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import FloatArray, IntArray, SparseArray

# What a joint or a clamp, of which little is known, may turn out to be; and any other part.
JOINT_FACTORS = (1e-3, 0.03, 3.0)
PART_FACTORS = (0.3, 3.0)
_UNKNOWN = 1.0  # deviation of the logarithm of a group from which on it is one of the former
_SHIFT = 0.5  # of the first elastic eigenvalue, below zero
_SPARE = 6  # modes above those that have to be right
_NOMINAL = 30  # elastic modes that are there as they are, at least
_ROUNDS = 24  # of residuals to a group and factor
_A_ROUND = 16  # vectors that one of them adds at most
_APART = 1e-7  # sine below which a vector lies in the span of the others
_SHARE = 0.3  # of the tolerance, below which a residual does not matter
_FAINT = 1e-4  # of the squared strength of all forces of a group, below which one has no response
_SPREAD = 3  # times the room: motions that are weighed before the best of them stay
_ROWS = 8192  # of motions that are turned at once


@dataclass(frozen=True)
class GroupedReduction:
    """The matrices of a model in a basis, and how good the basis is.

    Arguments:
        kept: rows of the whole model that are the first coordinates, (b,).
        stiffness, mass: (N, N).
        groups, mass_groups: parts of them by name, (N, N) each.
        moved: how far off a frequency is, relative: by the response to what its mode leaves
            unbalanced, and by what there was no room for; the largest of all groups, factors and
            modes.
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
    nominal = max(count + _SPARE, min(_NOMINAL, most - len(kept) - 2 * rigid.shape[1]))
    modes = solve_modes(model, nominal + int(rigid.shape[1]))
    least = len(kept) + len(modes) + rigid.shape[1]
    if least > most:
        raise ModelError(f"sensors, attachments and modes take {least} coordinates of {most}")
    groups = _parts_of(model)
    frame = _Frame(model, float(np.abs(modes.elastic.eigenvalues[0])))
    unit = np.zeros((model.size, len(kept)))
    unit[kept, np.arange(len(kept))] = 1.0
    base = frame.first([rigid, modes.shapes, frame.solver.solve(unit)])
    softest, pieces, room, moved = [], [], _SPREAD * (most - base.shape[1]), 0.0
    for name, part in groups.items():
        known = part.is_mass or group_prior_std(model, name[1]) < _UNKNOWN
        own = _Enriched(frame, part, count, tolerance)
        for i, factor in enumerate(PART_FACTORS if known else JOINT_FACTORS):
            try:
                reference, left = own.settle(factor, room)
            except la.LinAlgError:
                what = f"{factor:g} times the {name[0]} of group {name[1]!r} leaves no model"
                raise ModelError(what) from None
            moved = max(moved, left)
            if i == 0:  # where it moves by itself most, and loses most
                softest.append((name, factor, reference, left))
        pieces.append(own.motions())
        room -= pieces[-1].shape[1]
    frame.solver.forget()
    vectors = frame.strongest(pieces, most - base.shape[1])
    everything = {_K: _Part.of(model.stiffness), _M: _Part.of(model.mass), **groups}
    parts = {name: part.within(vectors) for name, part in everything.items()}
    for name, factor, reference, left in softest:
        change = (factor - 1.0) * parts[name]
        stiff, heavy = parts[_K], parts[_M]
        stiff, heavy = (stiff, heavy + change) if groups[name].is_mass else (stiff + change, heavy)
        values, _ = _ritz(heavy, stiff + frame.shift * heavy, frame.shift, len(reference))
        off = np.sqrt(np.maximum(values, 0.0)) / reference - 1.0
        moved = max(moved, left + float(off.max(initial=0.0)))
    turn = _physical_coordinates(vectors[kept], vectors.T @ frame.energy(rigid))
    small = {name: turn.T @ part @ turn for name, part in parts.items()}
    stiffness, mass = (
        {name: small[kind, name] for name in own}
        for kind, own in (("stiffness", model.groups), ("mass", model.mass_groups))
    )
    return GroupedReduction(kept, small[_K], small[_M], stiffness, mass, moved)


_Name = tuple[str, str]
_K, _M = ("stiffness", ""), ("mass", "")


@dataclass
class _Part:
    """One of the matrices: the rows that it touches, and itself there."""

    rows: IntArray
    matrix: SparseArray
    is_mass: bool

    @classmethod
    def of(cls, matrix: SparseArray, *, is_mass: bool = False) -> _Part:
        rows = np.flatnonzero(np.diff(matrix.tocsc().indptr))
        whole = len(rows) == matrix.shape[0]
        return cls(rows, matrix if whole else matrix.tocsr()[rows][:, rows], is_mass)

    def within(self, vectors: FloatArray) -> FloatArray:
        """Return the matrix in coordinates of some motions, (N, N)."""
        found = np.zeros((vectors.shape[1],) * 2)
        for start in range(0, vectors.shape[1], _A_ROUND * 4):
            own = slice(start, start + _A_ROUND * 4)
            found[:, own] = vectors[self.rows].T @ (self.matrix @ vectors[self.rows, own])
        return 0.5 * (found + found.T)


def _parts_of(model: Model) -> dict[_Name, _Part]:
    return {
        **{("stiffness", n): _Part.of(m) for n, m in model.groups.items()},
        **{("mass", n): _Part.of(m, is_mass=True) for n, m in model.mass_groups.items()},
    }


def _ritz(
    mass: FloatArray, shifted: FloatArray, shift: float, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return the first elastic eigenvalues of K + s M and M, (m,), and coordinates, (N, m)."""
    # Reciprocal: low eigenvalues come out with full relative accuracy.
    size = len(mass)
    mu, x = la.eigh(mass, shifted, subset_by_index=[max(size - count - _SPARE, 0), size - 1])
    values = 1.0 / np.maximum(mu[::-1], 1e-300) - shift
    elastic = np.flatnonzero(values > 1e-6 * shift)[:count]
    x = x[:, ::-1][:, elastic]
    return values[elastic], x / np.sqrt(np.einsum("ij,ij->j", x, mass @ x))


class _Frame:
    """A model at a shift, and the motions that every group begins with, orthonormal in A."""

    def __init__(self, model: Model, first: float) -> None:
        self.model, self.shift = model, _SHIFT * first
        self.solver = ShiftedModel(model, -self.shift)
        self.base = self.forces = np.zeros((model.size, 0))
        self.mass = np.zeros((0, 0))

    def energy(self, vectors: FloatArray) -> FloatArray:
        """Return A times vectors, A = K + s M, (n, m)."""
        return self.model.stiffness_times(vectors) + self.shift * self.model.mass_times(vectors)

    def first(self, vectors: Iterable[FloatArray]) -> FloatArray:
        """Keep what every group begins with."""
        for some in vectors:
            own, forces = self.apart(some, self.base, self.forces)
            self.base, self.forces = np.hstack([self.base, own]), np.hstack([self.forces, forces])
        self.mass = self.base.T @ self.model.mass_times(self.base)
        return self.base

    def apart(
        self, vectors: FloatArray, others: FloatArray, forces: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return what others lack of some vectors, orthonormal, and A times it, (n, k) each.

        Arguments:
            vectors: (n, m).
            others: orthonormal in A, (n, N).
            forces: A times these, (n, N).
        """
        own = vectors / np.sqrt(
            np.maximum(np.einsum("ij,ij->j", vectors, self.energy(vectors)), 1e-300)
        )
        for _ in range(2):  # the second time what rounding left
            own -= others @ (forces.T @ own)
            force = self.energy(own)
            values, turn = la.eigh(own.T @ force)
            strong = np.flatnonzero(values > _APART**2)[::-1]
            turn = turn[:, strong] / np.sqrt(values[strong])
            own, force = own @ turn, force @ turn
        return own, force

    def strongest(self, pieces: list[FloatArray], most: int) -> FloatArray:
        """Return the base and what is added to it, the motions of most energy, (n, N).

        Arguments:
            pieces: motions apart from the base, of the energy that modes have in them.
            most: how many are added.
        """
        start = self.base.shape[1]
        found = np.hstack([self.base, *pieces])
        own = found[:, start:]
        pieces.clear()
        gram = np.zeros((own.shape[1],) * 2)
        for at in range(0, own.shape[1], _A_ROUND * 4):
            some = slice(at, at + _A_ROUND * 4)
            own[:, some] -= self.base @ (self.forces.T @ own[:, some])
        for at in range(0, own.shape[1], _A_ROUND * 4):
            some = slice(at, at + _A_ROUND * 4)
            gram[:, some] = own.T @ self.energy(own[:, some])
        values, turn = la.eigh(0.5 * (gram + gram.T))
        strong = np.flatnonzero(values > _APART**2 * values.max(initial=0.0))[::-1][:most]
        turn = turn[:, strong] / np.sqrt(values[strong])
        for at in range(0, len(own), _ROWS):
            own[at : at + _ROWS, : len(strong)] = own[at : at + _ROWS] @ turn
        return found[:, : start + len(strong)]


class _Enriched:
    """The motions that one group asks for in addition to those that every group begins with.

    Only forces on the group's rows have a response, so all but inertia is known from these rows.
    """

    def __init__(self, frame: _Frame, part: _Part, count: int, tolerance: float) -> None:
        self.frame, self.part, self.count, self.tolerance = frame, part, count, tolerance
        rows, start = part.rows, frame.base.shape[1]
        self.mass = frame.mass
        self.answers = np.zeros((frame.model.size, 0))
        self._turn = np.eye(start)  # from the base and the answers to what is orthonormal in A
        # Of the base and the answers, before they are turned. A soft group is a difference of
        # large numbers, so that what is orthonormal but for rounding is not taken for it.
        self._weight, self._gram = frame.mass, np.eye(start)
        self.shifted = self._gram
        # On the rows of the group: motions, A and M times these, and forces of the group.
        self.inside, self.forces = frame.base[rows], frame.forces[rows]
        # Rows of a symmetric matrix are its columns.
        self.heavy = sp.csc_array(frame.model.mass)[:, rows].T.tocsr() @ frame.base
        self.moved = part.matrix @ self.inside
        model = frame.model
        diagonal = model.stiffness.diagonal() + frame.shift * model.mass.diagonal()
        self._size = np.sqrt(diagonal[rows])  # forces and moments alike
        self._modes: list[FloatArray] = []

    def settle(self, factor: float, room: int) -> tuple[FloatArray, float]:
        """Add what the modes with a factor on the group lack.

        Returns:
            Their natural frequencies, rad/s, (m,), and how far off these are, relative.
        """
        left = 0.0
        for _ in range(_ROUNDS):
            values, x = self._solve(factor)
            added, left = self._respond(factor, values, x, room)
            if not added:
                break
        energy = values + self.frame.shift
        self._modes.append(x[len(self.frame.mass) :] / np.sqrt(energy))
        return np.sqrt(np.maximum(values, 0.0)), left

    def motions(self) -> FloatArray:
        """Return what was added, as combinations of the energy that the modes have in them."""
        start, size = len(self.frame.mass), len(self.mass)
        modes = [np.pad(x, ((0, size - start - len(x)), (0, 0))) for x in self._modes]
        turn, strength, _ = la.svd(np.hstack(modes), full_matrices=False)
        lost = np.cumsum(np.square(strength)[::-1])[::-1]
        strong = lost > 0.1 * _SHARE * self.tolerance
        turn = self._turn[:, start:] @ (turn * strength)[:, strong]
        return np.asarray(self.frame.base @ turn[:start] + self.answers @ turn[start:])

    def _solve(self, factor: float) -> tuple[FloatArray, FloatArray]:
        """Return the first elastic eigenvalues with a factor on the group, and coordinates."""
        change = (factor - 1.0) * (self.inside.T @ self.moved)
        mass, shift = self.mass, self.frame.shift
        shifted = self.shifted + (shift if self.part.is_mass else 1.0) * change
        return _ritz(mass + change if self.part.is_mass else mass, shifted, shift, self.count)

    def _respond(
        self, factor: float, values: FloatArray, x: FloatArray, room: int
    ) -> tuple[int, float]:
        """Add the response to what modes with a factor on the group leave unbalanced there.

        Elsewhere they leave no more than the inertia of these responses.

        Returns:
            How many vectors were added, and how far they would move a frequency, relative.
        """
        frame, part = self.frame, self.part
        change = (factor - 1.0) * (self.moved @ x)
        residual = self.forces @ x - (values + frame.shift) * (self.heavy @ x)
        residual = (residual + (-values * change if part.is_mass else change)) / np.sqrt(values)
        # Few directions of force make up most residuals: those of what connects two parts.
        weighed = residual / self._size[:, None]
        strength, turn = la.eigh(weighed.T @ weighed)
        if not (strength > 0.0).any():
            return 0, 0.0
        residual = residual @ turn[:, strength > _FAINT * strength[-1]]
        loads = np.zeros((frame.model.size, residual.shape[1]))
        loads[part.rows] = residual
        answer = frame.solver.solve(loads)
        # What lies in the span is balanced by the inertia of the rest, which is left out here.
        known = self.inside.T @ residual
        own = answer[part.rows] - self.inside @ known
        pull = residual.T @ own
        # With energy H of the answers at this factor, G H^-1 G lowers the eigenvalues, relatively.
        energy = pull.copy()
        if not part.is_mass:
            # What the span then adds to an answer makes it softer.
            border = (factor - 1.0) * (self.moved.T @ own)
            within = self.shifted + (factor - 1.0) * (self.inside.T @ self.moved)
            energy += (factor - 1.0) * (own.T @ (part.matrix @ own))
            energy -= border.T @ la.solve(within, border, assume_a="pos")
        # The span leaves nothing of an answer that it has.
        answered = np.einsum("ij,ij->j", residual, answer[part.rows])
        lacking = np.flatnonzero(pull.diagonal() > _APART * answered)
        if not len(lacking):
            return 0, 0.0
        pull, energy = (part[np.ix_(lacking, lacking)] for part in (pull, energy))
        if not (energy.diagonal() > 0.0).all():
            raise la.LinAlgError("a motion without energy")
        scale = 1.0 / np.sqrt(energy.diagonal())
        strength, turn = la.eigh(scale[:, None] * energy * scale)
        sound = strength > 1e-12 * strength[-1]
        ways = scale[:, None] * turn[:, sound] / np.sqrt(strength[sound])
        left, gain, _ = la.svd(ways.T @ pull)
        most = min(_A_ROUND, room - self.answers.shape[1])
        kept = np.flatnonzero(np.square(gain) > 2.0 * _SHARE * self.tolerance)[: max(most, 0)]
        if len(kept):
            self._add(answer[:, lacking] @ (ways @ left[:, kept]))
        return len(kept), 0.5 * float(np.square(gain).max(initial=0.0))

    def _add(self, answer: FloatArray) -> None:
        """Add answers to forces on the rows of the group."""
        frame, rows, before = self.frame, self.part.rows, self._turn.shape[1]

        def by(forces: FloatArray) -> FloatArray:
            return np.vstack([frame.base.T @ forces, self.answers.T @ forces])

        pushed, weighted = frame.energy(answer), frame.model.mass_times(answer)
        side, corner = by(pushed), answer.T @ pushed
        known = self._turn.T @ side
        gram = corner - known.T @ known
        values, turn = la.eigh(0.5 * (gram + gram.T))
        strong = values > _APART * values[-1]
        turn = turn[:, strong] / np.sqrt(values[strong])
        # An answer less what the span has of it, in coordinates of the base and all answers.
        border, padded = by(weighted), np.zeros((answer.shape[1], before))
        self._weight = np.block([[self._weight, border], [border.T, answer.T @ weighted]])
        self._gram = np.block([[self._gram, side], [side.T, 0.5 * (corner + corner.T)]])
        self._turn = np.block([[self._turn, -self._turn @ known @ turn], [padded, turn]])
        self.mass = self._turn.T @ self._weight @ self._turn
        self.shifted = self._turn.T @ self._gram @ self._turn
        self.answers = np.hstack([self.answers, answer])
        news = {"inside": answer, "forces": pushed, "heavy": weighted}
        for name, new in news.items():
            old = getattr(self, name)
            setattr(self, name, np.hstack([old, (new[rows] - old @ known) @ turn]))
        self.moved = np.hstack([self.moved, self.part.matrix @ self.inside[:, before:]])


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
