"""Modes of a model after many attachments: its own modes and factors, and a proof for each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from femubench.core.errors import ModelError
from femubench.core.fem.attaching import few_dofs
from femubench.core.fem.frame import GroundSpring, PointMass
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import (
    DENSE_LIMIT,
    Modes,
    count_evaluation,
    solve_dense,
    solve_modes,
)
from femubench.core.modal.rigid import rigid_continuation, rigid_modes_of
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import FloatArray, IntArray, SparseArray

KNOWN_TO = 1e-5  # relative, of a frequency
_MOST_STEPS = 4
_MOST_DOFS = 200  # beyond them one solution of the whole is cheaper
_MOST_NUMBERS = 10_000_000  # of the answers to forces at these, 80 MB of which every step has two
_BELOW = 0.1  # the shift, of the first elastic eigenvalue
_DEPENDENT = 1e-12
_FREE = 1e-10
_RIGID_SHARE = 0.9
_RESIDUAL = 1e-6
_ZERO = 1e-6  # of the first elastic eigenvalue
_SPARE = 12
_NOISE = 1e-9  # of the first elastic eigenvalue: as near to zero nothing is proven
_INSIDE = 0.95  # of the highest mode at hand: what lies above it was not counted

Change = tuple[Sequence[PointMass], Sequence[GroundSpring]]


class _Place(NamedTuple):
    """Where a change acts: dofs of the model (t,), new ones (k,), and its blocks there.

    The first t rows of every block are those of the model's dofs.
    """

    old: IntArray
    new: int
    mass: FloatArray
    stiffness: FloatArray
    ground: FloatArray


class _Space(NamedTuple):
    """Residual static answers of a place's dofs, step by step.

    Arguments:
        vectors: (n, p t), orthogonal with the mass to the modes at hand.
        momentum: their products with M, (n, p t).
        mass, shifted: their products with M and K - shift M, (p t, p t).
        moments: E' (A^-1 M)^k A^-1 E of the residual, k = 0 .. 2p - 1, (t, t) each.
    """

    vectors: FloatArray
    momentum: FloatArray
    mass: FloatArray
    shifted: FloatArray
    moments: list[FloatArray]


@dataclass(frozen=True)
class ManyChanges:
    """A model whose modes are wanted after many attachments, each on the model as it is.

    The eigenproblem is solved in the space of the model's own modes, of the static answers to
    forces where the change acts, less what these modes have of them, and of the answers to the
    inertia of those. Its eigenvalues lie above those sought; how many may lie below a given one is
    counted by the inertia of the dynamic flexibility where the change acts, of which the modes that
    are not at hand have a share between known bounds. What cannot be proven is tried with one more
    step, then solved as a whole.

    Arguments:
        modes: its lowest ones, none missed; those wanted and some more.
        known_to: how closely every frequency has to be known, relative.

    Source: Craig & Chang (1977), residual flexibility; Haynsworth (1968), inertia; Golub & Meurant
    (1994), bounds of moments.
    """

    model: Model
    modes: Modes
    known_to: float = KNOWN_TO

    def after(
        self,
        masses: Sequence[PointMass],
        springs: Sequence[GroundSpring],
        count: int,
        hertz: float = 0.0,
    ) -> Modes:
        """Return the lowest modes of the model with attachments, on the dofs of `Model.attach`.

        Arguments:
            count: number of modes, rigid ones included; negative ones come on top.
            hertz: a frequency that the highest of them exceeds, where the modes at hand tell.

        Raises:
            ModelError: when an attachment lies off the structure.
        """
        return self.proven(masses, springs, count, hertz) or solve_modes(
            self.model.attach(masses, springs), count
        )

    def proven(
        self,
        masses: Sequence[PointMass],
        springs: Sequence[GroundSpring],
        count: int,
        hertz: float = 0.0,
    ) -> Modes | None:
        """Return the modes as in `after`; None where so few modes and steps do not prove them."""
        attached = self.model.assemble_attachments(masses, springs)
        if attached is None or count >= len(self.modes):
            return None
        structure, change = attached
        dofs, blocks = few_dofs((change.mass, change.stiffness, change.ground))
        old = dofs[dofs < self.model.size]
        place = _Place(old, len(dofs) - len(old), *blocks)
        if not 0 < len(place.old) + place.new <= _MOST_DOFS:
            return None
        if len(place.old) * self.model.size > _MOST_NUMBERS:
            return None
        rigid, momentum = self._rigid
        at = rigid[place.old]
        if structure is not None and place.new:
            kinematics, new = structure.kinematics, slice(self.model.size, None)
            xyz = structure.mesh.xyz[kinematics.node[new]]
            at = np.vstack([at, self._continued(xyz, kinematics.motions(new))])
        energy, size = at.T @ place.ground @ at, np.abs(at).T @ np.abs(place.ground) @ np.abs(at)
        values, turn = la.eigh(0.5 * (energy + energy.T))
        turn = turn[:, np.abs(values) <= _FREE * np.trace(size)]
        gram = turn.T @ (rigid.T @ momentum + at.T @ place.mass @ at) @ turn
        if gram.size:
            turn = la.solve_triangular(la.cholesky(gram, lower=True), turn.T, lower=True).T
        free = momentum @ turn, at @ turn
        space = None
        for _ in range(_MOST_STEPS):
            space = self._space(place.old, space)
            found = self._ritz(place, space, free, count, (2.0 * np.pi * hertz) ** 2)
            if found is not None:
                return found
        return None

    @cached_property
    def _shifted(self) -> ShiftedModel:
        return ShiftedModel(self.model, -_BELOW * self._first)

    @cached_property
    def _first(self) -> float:
        elastic = self.modes.eigenvalues[~self.modes.rigid & (self.modes.eigenvalues > 0.0)]
        if len(elastic) == 0:
            raise ModelError("none of the modes at hand is elastic")
        return float(elastic[0])

    @cached_property
    def _momentum(self) -> FloatArray:
        return self.model.mass_times(self.modes.shapes)

    @cached_property
    def _stiffness_sizes(self) -> SparseArray:
        return np.abs(self.model.stiffness)

    @cached_property
    def _rigid(self) -> tuple[FloatArray, FloatArray]:
        """Return the rigid-body motions and their momentum, (n, r) each."""
        rigid = rigid_modes_of(self.model)
        return rigid, self.model.mass_times(rigid)

    @cached_property
    def _continued(self) -> Callable[[FloatArray, FloatArray], FloatArray]:
        return rigid_continuation(self.model.dofs, self._rigid[0])

    def _space(self, place: IntArray, previous: _Space | None) -> _Space:
        """Return one step more of the residual answers to forces at a place."""
        count = len(place)
        if previous is None:
            force = np.zeros((self.model.size, count))
            force[place, np.arange(count)] = 1.0
        else:
            force = previous.momentum[:, -count:]
        more = self._shifted.solve(force)
        more = more - self.modes.shapes @ (self._momentum.T @ more)
        momentum = self.model.mass_times(more)
        if previous is None:
            first = _symmetric(more[place])
            mass = _symmetric(more.T @ momentum)
            return _Space(more, momentum, mass, first, [first, mass])
        vectors = np.hstack([previous.vectors, more])
        momenta = np.hstack([previous.momentum, momentum])
        side, corner = previous.vectors.T @ momentum, _symmetric(more.T @ momentum)
        # A P_(i+1) = M P_i: what a step has of A, the one before has of M.
        energy = np.block(
            [
                [previous.shifted, previous.mass[:, -count:]],
                [previous.mass[-count:], _symmetric(side[-count:])],
            ]
        )
        return _Space(
            vectors,
            momenta,
            np.block([[previous.mass, side], [side.T, corner]]),
            energy,
            [*previous.moments, _symmetric(side[-count:]), corner],
        )

    def _ritz(
        self,
        place: _Place,
        space: _Space,
        free: tuple[FloatArray, FloatArray],
        count: int,
        above: float,
    ) -> Modes | None:
        """Return the modes in a space of shapes; None where they are not proven.

        Arguments:
            free: rigid-body motions: momentum without the change, (n, r), and motion at its place.
        """
        count_evaluation()
        m, new = len(self.modes), place.new
        scale = 1.0 / np.sqrt(np.diagonal(space.mass))
        sizes, turn = la.eigh(space.mass * np.outer(scale, scale))
        keep = sizes > _DEPENDENT * sizes[-1]
        turn = scale[:, None] * turn[:, keep] / np.sqrt(sizes[keep])
        inner = turn.T @ space.shifted @ turn + self._shifted.shift * np.eye(turn.shape[1])
        at = np.hstack([self.modes.shapes[place.old], space.vectors[place.old] @ turn])
        at = la.block_diag(at, np.eye(new))
        bare = np.zeros((new, new))
        stiffness = la.block_diag(np.diag(self.modes.eigenvalues), _symmetric(inner), bare)
        mass = la.block_diag(np.eye(m + len(inner)), bare)
        values, vectors = solve_dense(
            _symmetric(mass + at.T @ place.mass @ at),
            _symmetric(stiffness + at.T @ place.stiffness @ at),
        )
        wanted = count + int(np.sum(values < -_ZERO * self._first))
        wanted = max(wanted, int(np.searchsorted(values, above)) + 1 if above else 0)
        if wanted > len(values) or values[wanted - 1] >= _INSIDE * self.modes.eigenvalues[-1]:
            return None
        # No eigenvalue may lie below a Ritz value by more than is allowed.
        elastic = values[:wanted][np.abs(values[:wanted]) > _ZERO * self._first]
        below = np.maximum(1.9 * self.known_to * np.abs(elastic), _NOISE * self._first)
        most = self._most_below(place, space.moments, elastic - below)
        if not len(elastic) or not np.array_equal(most, np.searchsorted(values, elastic - below)):
            return None
        values, vectors = values[:wanted], vectors[:, :wanted]
        shapes = self.modes.shapes @ vectors[:m]
        shapes += space.vectors @ (turn @ vectors[m : m + len(inner)])
        moved = at @ vectors
        force = self.model.stiffness_times(shapes) - self.model.mass_times(shapes) * values
        local = place.stiffness @ moved - (place.mass @ moved) * values
        force[place.old] += local[: len(place.old)]
        size = self._stiffness_sizes @ np.abs(shapes)
        size[place.old] += (np.abs(place.stiffness) @ np.abs(moved))[: len(place.old)]
        total = np.hypot(la.norm(force, axis=0), la.norm(local[len(place.old) :], axis=0))
        if float((total / la.norm(size, axis=0)).max()) > _RESIDUAL:
            return None
        share = free[0].T @ shapes + free[1].T @ place.mass @ moved
        rigid = np.square(share).sum(axis=0) > _RIGID_SHARE
        still = rigid & (np.abs(values) < _ZERO * self._first)
        every = np.vstack([shapes, moved[len(place.old) :]])
        return Modes(np.where(still, 0.0, values), every, rigid)

    def _most_below(
        self, place: _Place, moments: Sequence[FloatArray], shifts: FloatArray
    ) -> IntArray:
        """Return how many eigenvalues may lie below some shifts at the most, (k,)."""
        old, known = len(place.old), self.modes.eigenvalues
        shapes = self.modes.shapes[place.old]
        step = (shifts - self._shifted.shift)[:, None, None]
        highest = (1.0 - _NOISE) * known[-1] - self._shifted.shift
        # What is not at hand lies above the highest mode: 1 / (t - d) is between its own Taylor
        # series and that with the last term over the nearest t.
        flexible = step ** len(moments) / (highest - step) * moments[-1]
        for power, moment in enumerate(moments):
            flexible = flexible + step**power * moment
        flexible = flexible + (shapes / (known - shifts[:, None])[:, None, :]) @ shapes.T
        dynamic = place.stiffness - shifts[:, None, None] * place.mass
        inner = dynamic[:, old:, old:]
        core = dynamic[:, :old, :old] - dynamic[:, :old, old:] @ np.linalg.solve(
            inner, dynamic[:, old:, :old]
        )
        size = np.sqrt(np.diagonal(moments[0]))
        one = np.broadcast_to(np.eye(old), core.shape)
        whole = np.block(
            [[-flexible / np.outer(size, size), -one], [-one, core * np.outer(size, size)]]
        )
        counts = np.sum(known < shifts[:, None], axis=1) - old
        for matrices in (inner, whole):
            counts = counts + np.sum(np.linalg.eigvalsh(matrices) < 0.0, axis=-1)
        return np.asarray(counts)


def _symmetric(matrix: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (matrix + matrix.T))


def many_changes(model: Model, count: int) -> ManyChanges:
    """Return what gives the lowest modes of a model after any of many attachments.

    Arguments:
        model: with more dofs than are solved densely.
        count: how many modes will be wanted, rigid ones included.

    Raises:
        ModelError: when the model has no modes.
    """
    return ManyChanges(model, solve_modes(model, min(2 * count + _SPARE, model.size // 2)))


def modes_of_changes(model: Model, changes: Iterable[Change], count: int) -> list[Modes]:
    """Return the lowest modes of a model after each of many attachments, frequencies to 1e-5.

    A large model is solved and factorised once; what its modes cannot tell is solved as a whole.

    Arguments:
        model: any model; every change starts from it.
        changes: masses and springs of each.
        count: number of modes, rigid ones included.

    Raises:
        ModelError: when an attachment lies off the structure, or a model has no modes.

    Examples:
        >>> at = fem.Place(joint="J1")
        >>> heavier = [([fem.PointMass(at, mass)], []) for mass in (0.1, 0.2)]
        >>> for found in modal.modes_of_changes(model, heavier, 5):
        ...     print(found.elastic.natural_frequencies.round(1))
        [232.1 276.3]
        [220.1 276.1]
    """
    if model.size <= DENSE_LIMIT:
        return [solve_modes(model.attach(*change), count) for change in changes]
    many = many_changes(model, count)
    return [many.after(masses, springs, count) for masses, springs in changes]
