"""Hypotheses in modal coordinates: what they act on, and by which small matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la

from femubench.core.change.hypothesis import Hypothesis
from femubench.core.change.terms import (
    ElementOperator,
    RowOperator,
    Term,
    heaviest_translation,
    translation,
)
from femubench.core.fem.model import Model
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

_MANY = 4  # elements to one kind, from which on these are taken together
_EQUAL = 1e-9  # of the largest factor
_APART = 1e-7  # the same of what couples coordinates
_AT_ONCE = 512  # elements whose forces are held at once


@dataclass(frozen=True)
class Projection:
    """A hypothesis in modal coordinates: its terms are rows' core rows.

    A term touches few displacements, so that all that is done with it is done with small
    matrices; where it touches more than there are coordinates, the rows are the identity.

    Arguments:
        rows: the displacements that it acts on, from the coordinates, (p, N + extra).
        cores: symmetric, one a term, (t, p, p).
        is_mass: which of them belong to the mass, (t,).
        weights: by how much each mass term makes the structure heavier in kg, (t,).
        whole: whether the rows are the coordinates themselves.
    """

    hypothesis: Hypothesis
    rows: FloatArray = field(repr=False)
    cores: FloatArray = field(repr=False)
    is_mass: BoolArray = field(repr=False)
    weights: FloatArray = field(repr=False)
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
        cores = self.cores if chosen.all() else self.cores[chosen]
        return np.asarray(np.tensordot(factors[..., chosen], cores, axes=1))

    def matrix(self, factors: FloatArray, *, mass: bool) -> FloatArray | None:
        """Return the change of one matrix, (N + extra, N + extra); None where there is none."""
        core = self.core(factors, mass=mass)
        if core is None or self.whole:
            return core
        return np.asarray(self.rows.T @ (core @ self.rows))

    @cached_property
    def apart(self) -> bool:
        """Tell whether each coordinate is acted on by itself, where the rows are the coordinates.

        As by Young's modulus, or the density, of everything.
        """
        if not self.whole or self.extra:
            return False
        own = np.einsum("tii->ti", self.cores)
        rest = np.abs(self.cores).sum(axis=2) - np.abs(own)
        return bool((rest <= _APART * np.abs(own).max(axis=1, initial=0.0)[:, None]).all())

    def follow(self, low: int, left: FloatArray) -> Projection:
        """Return the same where the coordinates from one on move as others say, (h, r)."""
        n, r = low + len(left), self.rows
        if not self.whole:
            return replace(self, rows=np.hstack([r[:, :low], r[:, low:n] @ left, r[:, n:]]))
        rows = la.block_diag(np.eye(low), left)
        return replace(self, rows=np.eye(rows.shape[1]), cores=rows.T @ self.cores @ rows)


class Projector:
    """Projects changes on given vectors.

    Arguments:
        vectors: basis on its dofs, (n, N).
    """

    def __init__(self, model: Model, vectors: FloatArray) -> None:
        self.vectors, self.structure = vectors, model.structure
        self.wider: dict[int, FloatArray] = {0: vectors}
        self.unit = heaviest_translation(model)
        if self.structure is not None:
            # What cannot move in the plane of the frame has no part in any product.
            self.active = np.flatnonzero(self.structure.active_local)
            self.shift = translation(self.structure)[:, self.active]

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
            cores = np.array(self._cores(change.terms, grown))
            weights = np.array([self._weight(term, motion) for term in change.terms])
        known = [
            w if term.weight is None else term.weight
            for w, term in zip(weights, change.terms, strict=True)
        ]
        weights = np.where(is_mass, known, 0.0)
        return Projection(hypothesis, rows, cores, is_mass, weights, small is None)

    def _gathered(self, vectors: FloatArray, elements: IntArray) -> FloatArray:
        """Return the displacements of some elements that can move, (k, n_active, N)."""
        assert self.structure is not None
        gather = self.structure.gather
        if 12 * len(elements) < gather.shape[0] or len(self.active) < 12:
            gather = gather[(12 * elements[:, None] + self.active).ravel()]
        moved = np.asarray(gather @ vectors)
        return moved.reshape(len(elements), len(self.active), -1)

    def _cores(self, terms: Sequence[Term], grown: FloatArray) -> list[FloatArray]:
        """Return terms on all vectors, (N + extra, N + extra) each."""
        found = self._between(terms, self.local, [self.local]) if self.structure is not None else {}
        more = len(grown) - len(self.vectors)
        return [
            np.pad(found[i], (0, more)) if i in found else term.operator.project(grown)
            for i, term in enumerate(terms)
        ]

    def _between(
        self, terms: Sequence[Term], right: FloatArray, left: Sequence[FloatArray]
    ) -> dict[int, FloatArray]:
        """Return those of some terms that are matrices of elements on motions, (a, b) each.

        Arguments:
            right: displacements of all elements, (n_elements, n_active, b).
            left: the same, whose rows stand one after the other in the result, (..., a_i) each.
        """
        groups: dict[tuple[int, int, int], list[int]] = {}
        for i, term in enumerate(terms):
            operator = term.operator
            if isinstance(operator, ElementOperator):
                key = id(operator.blocks), id(operator.elements), id(operator.kind)
                groups.setdefault(key, []).append(i)
        found: dict[int, FloatArray] = {}
        for members in groups.values():
            own = [terms[i].operator for i in members]
            operators = [one for one in own if isinstance(one, ElementOperator)]
            forms = _by_kinds(operators, left, right, self.active)
            if forms is None:
                forms = [self._form(one, left, right) for one in operators]
            found.update(zip(members, forms, strict=True))
        return found

    def _form(
        self, operator: ElementOperator, left: Sequence[FloatArray], right: FloatArray
    ) -> FloatArray:
        matrices, every = self._blocks(operator), operator.elements
        total = np.zeros((sum(x.shape[2] for x in left), right.shape[2]))
        # Some elements at once: the forces of all would be the largest array of all.
        for first in range(0, len(every), _AT_ONCE):
            own = slice(first, first + _AT_ONCE)
            rows = own if len(every) == len(right) else every[own]
            force = (matrices[own] @ right[rows]).reshape(-1, right.shape[2])
            total += np.vstack([x[rows].reshape(len(force), -1).T @ force for x in left])
        return total

    def _blocks(self, operator: ElementOperator) -> FloatArray:
        matrices = operator.matrices
        if len(self.active) == matrices.shape[1]:
            return matrices
        return matrices[:, self.active[:, None], self.active]

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
        pulled = np.sum([term.operator.project(both) for term in springs], axis=0)
        motion[n:] = -np.linalg.solve(pulled[1:, 1:], pulled[1:, 0])
        return motion

    def _seen(self, rows: SparseArray, extra: int) -> FloatArray:
        """Return displacements in all vectors and in what a change adds, (p, N + extra)."""
        if not extra:
            return np.asarray(rows @ self.vectors)
        # By their few entries: to cut sparse rows in two takes longer than all the rest.
        entries, (n, known) = rows.tocsr(), self.vectors.shape
        line = np.repeat(np.arange(len(entries.indptr) - 1), np.diff(entries.indptr))
        column = entries.indices
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


def _by_kinds(
    operators: Sequence[ElementOperator],
    left: Sequence[FloatArray],
    right: FloatArray,
    active: IntArray,
) -> list[FloatArray] | None:
    """Return element matrices on motions, (a, b) each; None where kinds of elements do not help.

    What the elements of a kind do together is the same for all operators but for a factor.

    Arguments:
        operators: with the same blocks, elements and kinds.
        left, right: as in `Projector._between`.
        active: which of an element's dofs the displacements are.
    """
    first, shares = operators[0], [one.share for one in operators]
    kind, elements, blocks = first.kind, first.elements, first.blocks
    if kind is None or blocks.ndim > 3 or len(operators) < 2:
        return None
    if len(blocks) > len(elements) / _MANY:
        return None
    share = np.array([np.ones(len(elements)) if own is None else own for own in shares])
    order = np.argsort(kind, kind="stable")
    known, begins = np.unique(kind[order], return_index=True)
    of_kind = share[:, order[begins]]
    if (
        np.abs(share - of_kind[:, np.searchsorted(known, kind)]).max()
        > _EQUAL * np.abs(share).max()
    ):
        return None
    total = np.zeros((len(operators), sum(x.shape[2] for x in left), right.shape[2]))
    for i, (k, rows) in enumerate(zip(known, np.split(elements[order], begins[1:]), strict=True)):
        force = (blocks[k][active[:, None], active] @ right[rows]).reshape(-1, right.shape[2])
        one = np.vstack([x[rows].reshape(len(force), -1).T @ force for x in left])
        for own, factor in zip(total, of_kind[:, i], strict=True):
            if factor:
                own += factor * one
    return list(total)
