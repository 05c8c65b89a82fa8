"""Hypotheses in modal coordinates: what they act on, and by which small matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femubench.core.effect.change import ElementOperator, RowOperator, Term
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.inference.hypothesis import Hypothesis
from femubench.core.typing import BoolArray, FloatArray, IntArray


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
    """

    hypothesis: Hypothesis
    rows: FloatArray
    cores: FloatArray
    is_mass: BoolArray
    weights: FloatArray

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
            local = (self.structure.gather @ vectors).reshape(-1, 12, vectors.shape[1])
            self.local = local[:, self.active]
            self.shift = _translation(self.structure)[:, self.active]
            self.unit = shift[:, _direction(self.structure)]

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
            cores = np.array([term.operator.project(grown) for term in change.terms])
            weights = np.array([self._weight(term, motion) for term in change.terms])
        known = [
            w if term.weight is None else term.weight
            for w, term in zip(weights, change.terms, strict=True)
        ]
        return Projection(hypothesis, rows, cores, is_mass, np.where(is_mass, known, 0.0))

    def _small(
        self, terms: Sequence[Term], extra: int
    ) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Return rows, cores and the rows' motion in a unit translation; None if too many."""
        elements = [t.operator.elements for t in terms if isinstance(t.operator, ElementOperator)]
        points = [t.operator for t in terms if isinstance(t.operator, RowOperator)]
        if len(elements) + len(points) < len(terms):
            return None
        touched = np.unique(np.concatenate(elements)) if elements else np.zeros(0, dtype=np.int64)
        width = len(self.active) if elements else 0
        last = len(touched) * width
        # Terms of one effect may share their rows.
        shared = {id(operator.rows): operator.rows for operator in points}
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
            rows[places[key]] = found @ self._grown(extra)
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
        own = operator.blocks[:, self.active[:, None], self.active]
        np.add.at(blocks, np.searchsorted(touched, operator.elements), own)
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
            own, blocks = self.shift[operator.elements], operator.blocks
            blocks = blocks[:, self.active[:, None], self.active]
            return float(np.einsum("ei,eij,ej->", own, blocks, own))
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
