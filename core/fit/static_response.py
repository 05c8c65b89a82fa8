"""Large models: some of their modes, and their response to what each hypothesis exerts on these.

A few modes say what a change of the structure does to first order; how it bends where it is changed
is in all the others. Their response to a force is static but for (omega / omega_rest)^2, so that
one factorisation of K - s M gives a basis in which a hypothesis acts as in the whole model: the
modes, (K - s M)^-1 (dK - lambda_j dM) phi_j, and the same for forces at the sensors, with which the
readings of a small change are right whatever it is.

Source: MacNeal (1971), residual flexibility; Fox & Kapoor (1968) for the forces of a change.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from weakref import WeakValueDictionary

import numpy as np
import scipy.linalg as la

from femubench.core.change.hypothesis import Hypothesis, magnitudes
from femubench.core.change.terms import ElementOperator, RowOperator, Term
from femubench.core.fem.model import Model
from femubench.core.fit.modal_basis import Space, nominal_space, rigid_first
from femubench.core.fit.modal_fit import Problem
from femubench.core.fit.noise import Noise
from femubench.core.fit.projection import Projection, Projector
from femubench.core.fit.residuals import Data
from femubench.core.modal.eigen import DENSE_LIMIT, Modes, modes_of, once_for
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import FloatArray, IntArray, SparseArray

_IS_LINUX = sys.platform == "linux"
_A_MODE, _SPARE = 4, 20  # modes that are solved for every measured one, and as well
_RIGID, _MISSED = 6, 6
_SHIFT = 0.5  # of the first elastic eigenvalue, below zero
_FROM_SENSORS, _FROM_HYPOTHESIS = 40, 64  # vectors at most
_AT_ONCE, _COLUMNS = 32, 32  # forces that are held, and solved for, at once
_APART = 1e-10  # squared sine below which a vector lies in the span of the others
_FELT = 1e-7  # of the largest force
_FEW_TERMS = 6
_MANY = 4  # of so many elements one that is touched: no longer few


@dataclass(frozen=True, eq=False)
class Basis:
    """All modes of a small model; of a large one some, and its response to forces at the sensors.

    Arguments:
        modes: rigid-body modes first, then ascending; behind the exact ones the Ritz vectors of
            the response, orthogonal to them.
        exact: number of modes that are exact.
        tracked: number of modes whose change by a hypothesis matters.
        solver: K - s M, s below the first elastic eigenvalue.
        rows: sensor readings from dofs, sparse (n_sensors, n).
    """

    modes: Modes
    exact: int
    tracked: int
    solver: ShiftedModel
    rows: SparseArray

    @classmethod
    def of(cls, model: Model, measurement: Measurement) -> Basis:
        """Solve a model for the modes that the diagnosis of a measurement needs.

        What somebody still has is not made again: a factorisation is as large as all the rest.

        Raises:
            ModelError: when the model has no modes.
        """
        kept: WeakValueDictionary[Hashable, Basis]
        kept = once_for(model, "bases", WeakValueDictionary)
        sensors = measurement.sensors
        key = len(measurement), sensors.labels, sensors.directions, sensors.xyz.tobytes()
        found = kept.get(key)
        if found is None:
            kept[key] = found = cls._solved(model, measurement)
        return found

    @classmethod
    def _solved(cls, model: Model, measurement: Measurement) -> Basis:
        count = _RIGID + _A_MODE * len(measurement) + _SPARE
        modes = rigid_first(modes_of(model, count if model.size > DENSE_LIMIT else None))
        first = float(np.abs(modes.eigenvalues[~modes.rigid]).min(initial=np.inf))
        shift = min(-_SHIFT * first, 2.0 * float(modes.eigenvalues.min()))
        tracked = min(int(modes.rigid.sum()) + len(measurement) + _MISSED, len(modes))
        rows = model.observe(measurement.sensors)
        bare = cls(modes, len(modes), tracked, ShiftedModel(model, shift), rows)
        if bare.complete:
            return bare
        added = bare.response(np.asarray(rows.T.toarray()), _FROM_SENSORS)
        values, turn = la.eigh(added.T @ model.stiffness_times(added))
        full = Modes(
            np.concatenate([modes.eigenvalues, values]),
            np.hstack([modes.shapes, added @ turn]),
            np.append(modes.rigid, np.zeros(len(values), dtype=bool)),
        )
        return replace(bare, modes=full)

    @property
    def model(self) -> Model:
        """Return the model."""
        return self.solver.model

    @property
    def complete(self) -> bool:
        """Tell whether the modes are all that the model has."""
        return self.model.size <= DENSE_LIMIT

    @cached_property
    def momentum(self) -> FloatArray:
        """Return the mass times all vectors, (n, N)."""
        return self.model.mass_times(self.modes.shapes)

    @cached_property
    def readings(self) -> FloatArray:
        """Return the readings of all vectors, (n_sensors, N)."""
        return np.asarray(self.rows @ self.modes.shapes)

    @cached_property
    def projector(self) -> Projector:
        """Return what projects on all vectors."""
        return Projector(self.model, self.modes.shapes)

    @cached_property
    def bare(self) -> Basis:
        """Return the exact modes alone."""
        e, m = self.exact, self.modes
        modes = Modes(m.eigenvalues[:e], m.shapes[:, :e], m.rigid[:e])
        bare = replace(self, modes=modes)
        vars(bare)["momentum"] = self.momentum[:, :e]  # a view of what is there, not a copy
        return bare

    def forget(self) -> None:
        """Let go what is as large as all the rest of a large model, and soon worked out anew."""
        if not self.complete:
            for name in ("bare", "projector", "momentum"):
                vars(self).pop(name, None)
            # glibc keeps what large arrays leave behind; see malloc_trim(3). musl has no such call.
            trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if _IS_LINUX else None
            if trim is not None:
                trim(0)

    def response(
        self, forces: FloatArray, most: int, known: FloatArray | None = None
    ) -> FloatArray:
        """Return what the basis lacks of the response to some forces, M-orthonormal, (n, r).

        Arguments:
            forces: on the dofs, (n, c).
            most: number of vectors that are kept.
            known: further vectors, orthonormal to the basis, that it has, (n, k).
        """
        return self.responses([forces], most, known)[0]

    def responses(
        self, forces: Sequence[FloatArray], most: int, known: FloatArray | None = None
    ) -> list[FloatArray]:
        """Return the `response` to each of several sets of forces, (n, r) each."""
        shapes, momentum = self.modes.shapes[:, : self.exact], self.momentum[:, : self.exact]
        moved = np.hstack(forces)
        if moved.shape[1] == 0:
            return list(forces)
        # A few columns at once: the largest arrays of all would be their like.
        parts = [slice(i, i + _COLUMNS) for i in range(0, moved.shape[1], _COLUMNS)]
        for own in parts:
            moved[:, own] -= momentum @ (shapes.T @ moved[:, own])
            moved[:, own] = self.solver.solve(moved[:, own])
        there = [(self.modes.shapes, self.momentum)]
        if known is not None and known.shape[1]:
            there.append((known, self.model.mass_times(known)))
        counts = [block.shape[1] for block in forces]
        whole = np.sqrt(np.einsum("ij,ij->j", moved, self.model.mass_times(moved)))
        for _ in range(2):  # the second time what rounding left of the basis
            shares = [heavy.T @ moved for _, heavy in there]
            for own in (slice(i, i + _COLUMNS) for i in range(0, moved.shape[1], _COLUMNS)):
                for (vectors, _), share in zip(there, shares, strict=True):
                    moved[:, own] -= vectors @ share[:, own]
            moved /= np.where(whole > 0.0, whole, 1.0)
            mass, blocks, last = self.model.mass_times(moved), [], 0
            for count in counts:
                own, last = slice(last, last + count), last + count
                # Not SciPy's, which refuses the empty matrix of what exerts nothing.
                values, turn = np.linalg.eigh(moved[:, own].T @ mass[:, own])
                kept = np.flatnonzero(values > _APART)[-most:]
                blocks.append(moved[:, own] @ (turn[:, kept] / np.sqrt(values[kept])))
            del mass
            moved, counts = np.hstack(blocks), [block.shape[1] for block in blocks]
            whole = np.ones(moved.shape[1])
        return blocks

    def enrich(self, space: Space, parts: Sequence[Projection]) -> Coordinates:
        """Return coordinates of their own for some hypotheses.

        They hold the response to what these exert on the modes, and that to what they exert on
        this response as well, and to its inertia.

        Arguments:
            space: the coordinates of the basis.
            parts: the hypotheses, in any coordinates of the model.
        """
        near = self.modes.take(np.arange(self.tracked))
        forces = [find_forces(part.hypothesis, near) for part in parts]
        nothing = np.zeros((self.model.size, 0))
        added = self.response(np.hstack([nothing, *forces]), _FROM_HYPOTHESIS * len(parts))
        if added.shape[1]:
            there = Modes(np.full(added.shape[1], near.eigenvalues[-1]), added, near.rigid[:0])
            forces = [find_forces(part.hypothesis, there) for part in parts]
            forces.append(self.model.mass_times(added))
            more = self.response(np.hstack(forces), _FROM_HYPOTHESIS * len(parts), added)
            added = np.hstack([added, more])
        return self.with_motions(space, [self.projector(part.hypothesis) for part in parts], added)

    def first_response(self, space: Space, parts: Sequence[Projection]) -> Iterator[Space]:
        """Yield coordinates of its own for each of some hypotheses, with it in them.

        They hold the exact modes and the response to what it exerts on these; many are solved at
        once. Forces at the sensors, which serve those that have none of their own, are left out.
        """
        near, known = self.modes.take(np.arange(self.tracked)), len(self.modes)
        self.forget()
        waiting: list[tuple[Projection, FloatArray]] = []
        for part in parts:
            kept = np.delete(np.arange(known + part.extra), np.arange(self.exact, known))
            force = find_forces(part.hypothesis, near)
            if sum(f.shape[1] for _, f in waiting) + force.shape[1] > _AT_ONCE:
                yield from self._answered(space, waiting)
                waiting = []
            waiting.append((part.restrict(kept), force))
        yield from self._answered(space, waiting)
        self.forget()

    def _answered(
        self, space: Space, waiting: Sequence[tuple[Projection, FloatArray]]
    ) -> Iterator[Space]:
        """Yield the coordinates of some hypotheses, whose forces are solved for at once."""
        if waiting:
            found = self.bare.responses([force for _, force in waiting], _FROM_HYPOTHESIS)
            for (one, _), added in zip(waiting, found, strict=True):
                yield self.bare.with_motions(space, [one], added).space

    def with_motions(
        self, space: Space, parts: Sequence[Projection], added: FloatArray
    ) -> Coordinates:
        """Return coordinates for some hypotheses in which the model can move as given as well.

        Arguments:
            space: any coordinates of the model.
            parts: the hypotheses in those of the basis.
            added: motions, orthonormal to the basis, (n, r).
        """
        old = np.arange(self.exact, len(self.modes))
        pulled = self.model.stiffness_times(added)
        cross = np.vstack([self.modes.shapes[:, old].T @ pulled, added.T @ pulled])
        inner = np.diag(np.append(self.modes.eigenvalues[old], np.zeros(added.shape[1])))
        inner[:, len(old) :], inner[len(old) :, : len(old)] = cross, cross[: len(old)].T
        values, turn = np.linalg.eigh(inner)
        values = np.concatenate([space.eigenvalues[: self.exact], values])
        readings = np.hstack([self.readings, self.rows @ added])
        readings[:, self.exact :] = readings[:, self.exact :] @ turn
        there = Coordinates(
            self, replace(space, eigenvalues=values, readings=readings), added, turn
        )
        own = tuple(map(there.project, parts))
        return replace(there, space=replace(there.space, projections=own))


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Coordinates in which some hypotheses act as in the whole model.

    Arguments:
        basis: of the model.
        space: the coordinates with the hypotheses in them.
        added: motions next to those of the basis, (n, r).
        turn: the last coordinates from the response of the basis and these, orthogonal.
    """

    basis: Basis
    space: Space
    added: FloatArray
    turn: FloatArray

    @property
    def vectors(self) -> FloatArray:
        """Return the motions of all coordinates, (n, N + r)."""
        shapes, exact = self.basis.modes.shapes, self.basis.exact
        tail = shapes[:, exact:] @ self.turn[: shapes.shape[1] - exact]
        tail += self.added @ self.turn[shapes.shape[1] - exact :]
        return np.hstack([shapes[:, :exact], tail])

    def project(self, part: Projection) -> Projection:
        """Return a hypothesis in these coordinates, from how it is in those of the basis."""
        widened = self.basis.projector.widen(part, self.added)
        return widened.turn(self.basis.exact, self.turn)


def find_forces(hypothesis: Hypothesis, near: Modes) -> FloatArray:
    """Return forces that span what a hypothesis exerts on some modes at any magnitude, (n, r)."""
    change, shapes = hypothesis.change, near.shapes
    rows = _touched(change.terms, len(shapes))
    if len(change.terms) > _FEW_TERMS:
        blocks = list(_at_sizes(hypothesis, near, rows))
    else:
        blocks = [_range(term, shapes, change.extra)[rows] for term in change.terms]
    scaled = []
    for block in blocks:
        if size := float(np.linalg.norm(block)):
            block /= size  # in place: they may be the largest arrays of all
            scaled.append(block)
    if not scaled:
        return np.zeros((len(shapes), 0))
    felt = np.any([block.any(axis=1) for block in scaled], axis=0)
    rows, own = rows[felt], _principal([block[felt] for block in scaled])
    result = np.zeros((len(shapes), own.shape[1]))
    result[rows] = own
    return result


def _touched(terms: Sequence[Term], count: int) -> IntArray:
    """Return the dofs of the model that some terms act on: mostly few of them."""
    every, found = np.arange(count), [np.zeros(0, dtype=np.int64)]
    members: list[ElementOperator] = []
    for operator in (term.operator for term in terms):
        if isinstance(operator, ElementOperator):
            members.append(operator)
        elif isinstance(operator, RowOperator):
            found.append(operator.rows.tocsr().indices)
        else:
            return every
    if members:
        gather = members[0].structure.gather
        known = np.unique(np.concatenate([operator.elements for operator in members]))
        if 12 * len(known) > gather.shape[0] / _MANY:
            return every
        found.append(gather[(12 * known[:, None] + np.arange(12)).ravel()].indices)
    dofs = np.unique(np.concatenate(found))
    return dofs[dofs < count]


def _at_sizes(hypothesis: Hypothesis, near: Modes, rows: IntArray) -> FloatArray:
    """Return the forces at a few magnitudes, where single terms are too many, (g, k, m).

    Arguments:
        hypothesis: what exerts them.
        near: the modes.
        rows: dofs outside of which there are none, (k,).
    """
    factors = hypothesis.factors(magnitudes(hypothesis))
    forces = np.zeros((len(factors), len(rows), near.shapes.shape[1]))
    # One term after the other: a hundred of them at once would take a gigabyte.
    for term, own in zip(hypothesis.change.terms, factors.T, strict=True):
        pull = _applied(term, near.shapes, hypothesis.change.extra)[rows]
        if term.matrix == "mass":
            pull *= -near.eigenvalues
        for total, factor in zip(forces, own, strict=True):
            total += factor * pull
    return forces


def _principal(blocks: Sequence[FloatArray]) -> FloatArray:
    """Return orthonormal forces that span the largest of some, (k, r).

    Arguments:
        blocks: forces, side by side, (k, c_i) each.
    """
    if len(blocks[0]) < sum(block.shape[1] for block in blocks):
        left, size, _ = la.svd(np.hstack(blocks), full_matrices=False)
        kept = np.flatnonzero(size > _FELT * size[0])[:_FROM_HYPOTHESIS]
        return np.asarray(left[:, kept])
    gram = np.vstack([np.hstack([one.T @ other for other in blocks]) for one in blocks])
    square, turn = la.eigh(gram)
    size = np.sqrt(np.maximum(square[::-1], 0.0))
    kept = np.flatnonzero(size > _FELT * size[0])[:_FROM_HYPOTHESIS]
    turn = turn[:, ::-1][:, kept] / size[kept]
    last = np.cumsum([block.shape[1] for block in blocks])[:-1]
    own = np.zeros((len(blocks[0]), len(kept)))
    for block, part in zip(blocks, np.split(turn, last), strict=True):
        own += block @ part
    return own


def _range(term: Term, shapes: FloatArray, extra: int) -> FloatArray:
    """Return forces that span those of one term: where few rows move it, all it can exert."""
    operator = term.operator
    if isinstance(operator, RowOperator) and operator.rows.shape[0] <= shapes.shape[1]:
        return np.asarray(operator.rows[:, : len(shapes)].T.toarray())
    return _applied(term, shapes, extra)


def _applied(term: Term, shapes: FloatArray, extra: int) -> FloatArray:
    """Return the forces of one term on the dofs of the model, (n, m)."""
    grown = np.vstack([shapes, np.zeros((extra, shapes.shape[1]))]) if extra else shapes
    return term.operator.apply(grown)[: len(shapes)]


@dataclass(frozen=True)
class LargeProblem(Problem):
    """A problem on a large model, in the coordinates of its basis or in those of some hypotheses.

    The coordinates hold a short list of the hypotheses; `hypotheses` are all of them.
    """

    basis: Basis | None = field(default=None, repr=False)
    hypotheses: tuple[Hypothesis, ...] = field(default=(), repr=False)

    @property
    def common(self) -> Basis:
        """Return the basis."""
        assert self.basis is not None
        return self.basis


def enrich_problem(
    problem: Problem, parts: Sequence[Projection]
) -> tuple[Problem, tuple[Projection, ...]]:
    """Return the data in coordinates that hold the response to some hypotheses, and these there.

    The problem itself where its coordinates are complete.

    Arguments:
        problem: of the model.
        parts: the hypotheses, in any coordinates of the model.
    """
    if not isinstance(problem, LargeProblem) or not parts:
        return problem, tuple(parts)
    space = problem.common.enrich(problem.space, parts).space
    return replace(problem, space=space), space.projections


def place_data(basis: Basis, data: Data, noise: Noise, hypotheses: Sequence[Hypothesis]) -> Problem:
    """Return data in modal coordinates; none of the hypotheses is in them yet if some lack.

    Arguments:
        basis: of the model.
        data, noise: the used modes.
        hypotheses: what may be missing.
    """
    known, sensors = tuple(hypotheses), data.measurement.sensors
    if basis.complete:
        space = nominal_space(basis.model, basis.modes, sensors, known)
        return Problem(basis.model, space, data, noise)
    space = nominal_space(basis.model, basis.modes, sensors, ())
    return LargeProblem(basis.model, space, data, noise, basis=basis, hypotheses=known)
