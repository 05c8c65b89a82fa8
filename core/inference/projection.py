"""Hypotheses in modal coordinates: what they act on, and by which small matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from femubench.core.effect.change import ElementOperator, RowOperator, Term
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.inference.hypothesis import Hypothesis
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray


@dataclass(frozen=True)
class Projection:
    """A hypothesis in modal coordinates: its terms are rows' core rows.

    A term touches few displacements, so that all that is done with it is done with small
    matrices; where it touches more than there are coordinates, the rows are the identity.

    Arguments:
        hypothesis: what is projected.
        rows: the displacements that it acts on, from the coordinates, (p, N + extra).
        cores: symmetric, one a term, (t, p, p).
        is_mass: which of them belong to the mass, (t,).
        weights: by how much each mass term makes the structure heavier in kg, (t,).
        whole: whether the rows are the coordinates themselves.
    """

    hypothesis: Hypothesis
    rows: FloatArray
    cores: FloatArray
    is_mass: BoolArray
    weights: FloatArray
    whole: bool = False

    @property
    def extra(self) -> int:
        """Return the number of coordinates that the hypothesis adds."""
        return self.hypothesis.change.extra

    def core(self, factors: FloatArray, *, mass: bool) -> FloatArray | None:
        """Return the sum of the cores of one matrix, (..., p, p); None where there is none.

        Arguments:
            factors: of all terms, (..., t).
            mass: whether of the mass or of the stiffness.
        """
        chosen = self.is_mass if mass else ~self.is_mass
        if not chosen.any():
            return None
        return np.asarray(np.tensordot(factors[..., chosen], self.cores[chosen], axes=1))

    def matrix(self, factors: FloatArray, *, mass: bool) -> FloatArray | None:
        """Return the change of one matrix, (N + extra, N + extra); None where there is none."""
        core = self.core(factors, mass=mass)
        return None if core is None else np.asarray(self.rows.T @ (core @ self.rows))

    def turned(self, first: int, turn: FloatArray) -> Projection:
        """Return the same in coordinates of which some are combinations of those here.

        Arguments:
            first: of the coordinates that change.
            turn: the new ones from as many old ones, orthogonal, (r, r).
        """
        rows, own = self.rows.copy(), slice(first, first + len(turn))
        rows[:, own] = rows[:, own] @ turn
        return replace(self, rows=rows, whole=False)

    def restricted(self, kept: IntArray) -> Projection:
        """Return the same in some of the coordinates."""
        if self.whole:
            cores = self.cores[:, kept[:, None], kept]
            return replace(self, rows=np.eye(len(kept)), cores=cores)
        return replace(self, rows=self.rows[:, kept])


class Projector:
    """Projects changes on given vectors.

    Arguments:
        model: the nominal model.
        vectors: basis on its dofs, (n, N).
    """

    def __init__(self, model: Model, vectors: FloatArray) -> None:
        self.vectors, self.structure = vectors, model.structure
        self.wider: dict[int, FloatArray] = {0: vectors}
        shift = model.dofs.motions[:, :3]
        if self.structure is None:
            carried = np.einsum("nd,nd->d", shift, model.mass_times(shift))
            self.unit = shift[:, int(carried.argmax())]
        else:
            # What cannot move in the plane of the frame has no part in any product.
            self.active = np.flatnonzero(self.structure.active_local)
            self.shift = _translation(self.structure)[:, self.active]
            self.unit = shift[:, _direction(self.structure)]

    @cached_property
    def local(self) -> FloatArray:
        """Return the displacements of all elements, (n_elements, n_active, N)."""
        assert self.structure is not None
        return self._gathered(self.vectors, np.arange(len(self.shift)))

    def __call__(self, hypothesis: Hypothesis) -> Projection:
        """Return a hypothesis in the coordinates of the basis."""
        change = hypothesis.change
        is_mass = np.array([term.matrix == "mass" for term in change.terms], dtype=bool)
        small = self._small(change.terms, change.extra)
        if small is not None:
            rows, cores, motion = small
            weights = np.einsum("p,tpq,q->t", motion, cores, motion)
        else:
            grown = self._grown(change.extra)
            motion = self._shifted(change.terms, change.extra)
            rows = np.eye(grown.shape[1])
            cores = np.array([self._core(term, grown) for term in change.terms])
            weights = np.array([self._weight(term, motion) for term in change.terms])
        known = [
            w if term.weight is None else term.weight
            for w, term in zip(weights, change.terms, strict=True)
        ]
        weights = np.where(is_mass, known, 0.0)
        return Projection(hypothesis, rows, cores, is_mass, weights, small is None)

    def widened(self, projection: Projection, added: FloatArray) -> Projection:
        """Return a projection on further vectors besides, which stand behind those of the basis.

        Arguments:
            projection: on the basis.
            added: the further vectors, (n, r).
        """
        change, known, r = projection.hypothesis.change, self.vectors.shape[1], added.shape[1]
        if not projection.whole:
            touched, shared = self._acted_on(change.terms)
            seen = [np.asarray(rows[:, : len(added)] @ added) for rows in shared.values()]
            if touched.size:
                seen.insert(0, self._gathered(added, touched).reshape(-1, r))
            old = projection.rows
            rows = np.hstack([old[:, :known], np.vstack(seen), old[:, known:]])
            return replace(projection, rows=rows)
        size = known + r + change.extra
        kept, new = np.delete(np.arange(size), known + np.arange(r)), known + np.arange(r)
        cores = np.zeros((len(change.terms), size, size))
        cores[:, kept[:, None], kept] = projection.cores
        for core, term in zip(cores, change.terms, strict=True):
            cross, core[np.ix_(new, new)] = self._beside(term, added, change.extra)
            core[np.ix_(kept, new)], core[np.ix_(new, kept)] = cross, cross.T
        return replace(projection, rows=np.eye(size), cores=cores)

    def crossed(self, terms: Sequence[Term], near: FloatArray) -> list[FloatArray]:
        """Return each of some fixed matrices, times some vectors, in the basis, (N, m) each.

        Arguments:
            terms: that add no dofs.
            near: combinations of the basis, (N, m).
        """
        found, seen = [], {}
        for term in terms:
            operator = term.operator
            if isinstance(operator, ElementOperator):
                every = np.array_equal(operator.elements, np.arange(len(self.local)))
                moved = self.local if every else self.local[operator.elements]
                pulls = (self._blocks(operator) @ (moved @ near)).reshape(-1, near.shape[1])
                found.append(moved.reshape(len(pulls), -1).T @ pulls)
            elif isinstance(operator, RowOperator):
                # Terms of one effect may share their rows.
                if id(operator.rows) not in seen:
                    seen[id(operator.rows)] = np.asarray(operator.rows @ self.vectors)
                rows = seen[id(operator.rows)]
                found.append(rows.T @ (operator.core @ (rows @ near)))
            else:
                found.append(self.vectors.T @ operator.apply(self.vectors @ near))
        return found

    def _gathered(self, vectors: FloatArray, elements: IntArray) -> FloatArray:
        """Return the displacements of some elements that can move, (k, n_active, N)."""
        assert self.structure is not None
        rows = (12 * elements[:, None] + self.active).ravel()
        moved = np.asarray(self.structure.gather[rows] @ vectors)
        return moved.reshape(len(elements), len(self.active), -1)

    def _core(self, term: Term, grown: FloatArray) -> FloatArray:
        """Return a term on all vectors, (N + extra, N + extra)."""
        operator = term.operator
        if not isinstance(operator, ElementOperator):
            return operator.project(grown)
        moved = self.local[operator.elements]
        force = (self._blocks(operator) @ moved).reshape(-1, moved.shape[2])
        return np.pad(moved.reshape(len(force), -1).T @ force, (0, len(grown) - len(self.vectors)))

    def _beside(self, term: Term, added: FloatArray, extra: int) -> tuple[FloatArray, FloatArray]:
        """Return a term between all vectors and further ones, and between these alone."""
        operator, r = term.operator, added.shape[1]
        if isinstance(operator, ElementOperator):
            base = self.local[operator.elements].reshape(-1, self.vectors.shape[1])
            moved = self._gathered(added, operator.elements)
            force = (self._blocks(operator) @ moved).reshape(-1, r)
            cross = np.pad(base.T @ force, ((0, extra), (0, 0)))
            return cross, moved.reshape(-1, r).T @ force
        grown = np.vstack([added, np.zeros((extra, r))])
        force = operator.apply(grown)
        return self._grown(extra).T @ force, grown.T @ force

    def _blocks(self, operator: ElementOperator) -> FloatArray:
        return operator.matrices[:, self.active[:, None], self.active]

    @staticmethod
    def _acted_on(terms: Sequence[Term]) -> tuple[IntArray, dict[int, SparseArray]]:
        """Return the elements, and by their identity the rows, that terms act on."""
        elements = [t.operator.elements for t in terms if isinstance(t.operator, ElementOperator)]
        touched = np.unique(np.concatenate(elements)) if elements else np.zeros(0, dtype=np.int64)
        # Terms of one effect may share their rows.
        points = (t.operator for t in terms if isinstance(t.operator, RowOperator))
        return touched, {id(operator.rows): operator.rows for operator in points}

    def _small(
        self, terms: Sequence[Term], extra: int
    ) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Return rows, cores and the rows' motion in a unit translation; None if too many."""
        if not all(isinstance(t.operator, ElementOperator | RowOperator) for t in terms):
            return None
        touched, shared = self._acted_on(terms)
        last = len(touched) * len(self.active) if touched.size else 0
        count = last + sum(rows.shape[0] for rows in shared.values())
        if count > self.vectors.shape[1] + extra:
            return None
        rows, motion = np.zeros((count, self.vectors.shape[1] + extra)), np.zeros(count)
        if touched.size:
            rows[:last, : self.vectors.shape[1]] = self.local[touched].reshape(last, -1)
            motion[:last] = self.shift[touched].ravel()
        moved, places = self._shifted(terms, extra), {}
        for key, found in shared.items():
            places[key] = slice(last, last + found.shape[0])
            rows[places[key]] = self._seen(found, extra)
            motion[places[key]] = found @ moved
            last = places[key].stop
        cores = np.zeros((len(terms), count, count))
        for core, term in zip(cores, terms, strict=True):
            operator = term.operator
            if isinstance(operator, ElementOperator):
                whole = self._block_diagonal(operator, touched)
                core[: len(whole), : len(whole)] = whole
            elif isinstance(operator, RowOperator):
                own = places[id(operator.rows)]
                core[own, own] = operator.core
        return rows, cores, motion

    def _block_diagonal(self, operator: ElementOperator, touched: IntArray) -> FloatArray:
        """Return the matrix on the displacements of elements, all of the operator's among them."""
        count, width = len(touched), len(self.active)
        blocks, each = np.zeros((count, width, width)), np.arange(count)
        np.add.at(blocks, np.searchsorted(touched, operator.elements), self._blocks(operator))
        whole = np.zeros((count, width, count, width))
        whole[each, :, each] = blocks
        return whole.reshape(count * width, -1)

    def _shifted(self, terms: Sequence[Term], extra: int) -> FloatArray:
        """Return all dofs in a unit translation; those that a change adds follow statically."""
        if not extra:
            return self.unit
        n = len(self.unit)
        motion = np.concatenate([self.unit, np.zeros(extra)])
        both = np.column_stack([motion, np.zeros((n + extra, extra))])
        both[n:, 1:] = np.eye(extra)
        springs = [term for term in terms if term.matrix == "stiffness"]
        pulled = np.sum([term.operator.apply(both) for term in springs], axis=0)
        motion[n:] = -np.linalg.solve(pulled[n:, 1:], pulled[n:, 0])
        return motion

    def _seen(self, rows: SparseArray, extra: int) -> FloatArray:
        """Return displacements in all vectors and in what a change adds, (p, N + extra)."""
        if not extra:
            return np.asarray(rows @ self.vectors)
        # By their few entries: to cut sparse rows in two takes longer than all the rest.
        entries, (n, known) = rows.tocoo(), self.vectors.shape
        line, column = entries.coords
        own = column < n
        found = np.zeros((rows.shape[0], known + extra))
        np.add.at(found[:, :known], line[own], entries.data[own, None] * self.vectors[column[own]])
        np.add.at(found, (line[~own], known + column[~own] - n), entries.data[~own])
        return found

    def _grown(self, extra: int) -> FloatArray:
        """Return vectors with unit vectors of added dofs behind them, (n + extra, N + extra)."""
        if extra not in self.wider:
            n, m = self.vectors.shape
            grown = np.zeros((n + extra, m + extra))
            grown[:n, :m] = self.vectors
            grown[n:, m:] = np.eye(extra)
            self.wider[extra] = grown
        return self.wider[extra]

    def _weight(self, term: Term, motion: FloatArray) -> float:
        if term.matrix == "stiffness":
            return 0.0
        operator = term.operator
        if isinstance(operator, ElementOperator):
            own = self.shift[operator.elements]
            return float(np.einsum("ei,eij,ej->", own, self._blocks(operator), own))
        return float(operator.project(motion[:, None])[0, 0])


def _direction(structure: Structure) -> int:
    """Return the axis along which the structure is moved to weigh it."""
    return 0 if structure.frame.plane == "in-plane" else 2


def _translation(structure: Structure) -> FloatArray:
    """Return the local displacements of all elements in a unit translation, (n_elements, 12)."""
    axis = structure.mesh.axes[:, :, _direction(structure)]
    motion = np.zeros((len(axis), 12))
    motion[:, 0:3] = motion[:, 6:9] = axis
    return motion
