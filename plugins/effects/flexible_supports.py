"""Supports that give: springs between a support and the ground, their motion condensed.

A support takes dofs q out of the model. Released, they come back with stiffness K_qq, K_qu and mass
M_qq, M_qu to the free dofs u, and each hangs on a spring. They follow statically, q = -G K_qu u
with G = (K_qq + D)^-1 and D the springs' stiffnesses on the diagonal. What is left is of low rank:

    dK = -K_uq G K_qu ,   dM = -(M_uq G K_qu + its transpose) + K_uq G M_qq G K_qu

The stiffness is exact; the mass is Guyan's (1965), whose error in an eigenvalue is at most its
share of the lowest eigenvalue of K_qq + D and M_qq.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations_with_replacement
from typing import Literal, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from femubench import Model
from femubench.effect import Change, ModelPlaces, Places, RowOperator, Term, once_for
from femubench.fem import FloatArray, Frame, GroundSpring, IntArray, SparseArray

_DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
Held = tuple[str, str]  # the word of a support, and a direction that it holds


def soften_supports(frame: Frame, series: Mapping[Held, float]) -> Frame:
    """Return the frame with springs in series with its supports and its springs to ground.

    Arguments:
        series: from the word of a support and a direction, as `supports_of` has them, to N/m or
            N m/rad; infinite for a support that does not give.
    """
    given = {held: value for held, value in series.items() if np.isfinite(value)}
    supports, freed = [], {}
    for support in frame.supports:
        word = str(Places(frame).point(str(support.at)))
        freed.update({(word, d): given[word, d] for d in support.fixed if (word, d) in given})
        kept = tuple(d for d in support.fixed if (word, d) not in given)
        supports += [replace(support, fixed=kept)] if kept else []
    springs = [GroundSpring(Places(frame).point(word), d, k) for (word, d), k in freed.items()]
    for spring in frame.springs:
        held = str(Places(frame).point(str(spring.at))), spring.direction.lstrip("+-")
        # A spring parallel to a support is at rest, and acts where that gives.
        other = np.inf if held in freed else given.get(held, np.inf)
        softer = spring.stiffness / (1.0 + spring.stiffness / other) if other else 0.0
        springs.append(replace(spring, stiffness=softer))
    return replace(frame, supports=tuple(supports), springs=tuple(springs))


def flexible_supports_change(model: Model, parts: Sequence[Sequence[Held]]) -> Change:
    """Return what springs in series with supports and springs to ground do.

    Arguments:
        parts: for every value of the change what it is the stiffness of, as `supports_of` has it.
            The values are in N/m or N m/rad, infinite for rigid supports. The geometric stiffness
            of preloads at the support is left out.
    """
    frame = model.frame_structure.frame
    listed = [(held, column) for column, part in enumerate(parts) for held in part]
    stiff = {
        (word, direction): value
        for word, _ in dict.fromkeys(held for held, _ in listed)
        for direction, value in Places(frame).supports_of(f"support:{word}")[word].items()
    }
    fixed = [(held, column) for held, column in listed if np.isinf(stiff[held])]
    condensed = _condensed(model, [held for held, _ in fixed], [column for _, column in fixed])
    terms, present, columns = [], [], []
    for (word, direction), column in listed:
        row = ModelPlaces(model).motion(Places(frame).point(word))[[_DIRECTIONS.index(direction)]]
        for spring in frame.springs if np.isfinite(stiff[word, direction]) else ():
            same = str(Places(frame).point(str(spring.at))) == word
            if same and spring.direction.lstrip("+-") == direction and spring.stiffness:
                terms.append(Term("stiffness", RowOperator(row, np.eye(1))))
                present.append(spring.stiffness)
                columns.append(column)
    own, taken = np.array(present), np.array(columns, dtype=np.int64)

    def coefficients(values: FloatArray) -> FloatArray:
        softer = -(own**2) / (own + values[:, taken])
        return np.hstack([condensed.coefficients(values), softer])

    return Change((*condensed.terms, *terms), coefficients)


def _condensed(model: Model, held: Sequence[Held], columns: Sequence[int]) -> Change:
    """Return what springs under fixed dofs do."""
    if not held:
        return Change((), lambda values: np.zeros((len(values), 0)))
    released = release_supports(model)
    stiffness, mass = (released.take(m) for m in (released.model.stiffness, released.model.mass))
    free = np.array([released.held[one] for one in held], dtype=np.int64)
    inner, inertia = (m[free][:, free].toarray() for m in (stiffness, mass))
    rows = sp.csr_array(sp.vstack([m[free, : model.size] for m in (stiffness, mass)]))
    first, second = _coupled(inner, inertia)
    terms = [
        *_terms("stiffness", rows, _cores(first, second, len(free))),
        *_terms("mass", rows, _cores(first, second, len(free), len(free))),
        *_terms("mass", rows, _cores(first, second, len(free))),
    ]
    taken = np.array(columns, dtype=np.int64)

    def coefficients(values: FloatArray) -> FloatArray:
        root = np.sqrt(1.0 / values[:, taken])
        both = root[:, :, None] * root[:, None, :]
        give = both * np.linalg.inv(np.eye(len(free)) + both * inner)
        moved = give @ inertia @ give
        pairs = np.s_[:, first, second]
        return np.hstack([-give[pairs], -give[pairs], moved[pairs]])

    return Change(tuple(terms), coefficients)


class ReleasedSupports(NamedTuple):
    """A frame whose supports are gone, and what they held.

    Arguments:
        model: the frame, on dofs of its own.
        order: its dofs, those of the supported one first, (n + h,).
        held: from the word of a support and a direction to the position behind those.
    """

    model: Model
    order: IntArray
    held: dict[Held, int]

    def take(self, matrix: SparseArray) -> SparseArray:
        """Return columns of the frame's dofs, or rows and columns, in order."""
        columns = sp.csr_array(matrix)[:, self.order]
        return columns[self.order] if matrix.shape[0] == len(self.order) else columns


def release_supports(model: Model) -> ReleasedSupports:
    """Return a frame without its supports, which still moves as before where it is held."""
    return once_for(model, "released supports", lambda: _release(model))


def _release(model: Model) -> ReleasedSupports:
    structure = model.frame_structure
    frame, active = structure.frame, structure.frame.active
    pairs = ((str(Places(frame).point(str(s.at))), d) for s in frame.supports for d in s.fixed)
    held = list(dict.fromkeys(pair for pair in pairs if pair[1] in active))
    # Between the dofs that are held there is no stress of a preload to find.
    bare = replace(frame, preloads=())
    released = Model.of(structure.rebuilt(soften_supports(bare, dict.fromkeys(held, 0.0))))
    places = ModelPlaces(released)
    rows = [
        places.motion(places.point(word))[[_DIRECTIONS.index(direction)]].indices[0]
        for word, direction in held
    ]
    order = np.array([*model.dofs_in(released), *rows], dtype=np.int64)
    return ReleasedSupports(released, order, {one: model.size + i for i, one in enumerate(held)})


def _coupled(inner: FloatArray, inertia: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the pairs of dofs, each once, that move one another; a dof itself is a pair too."""
    label = connected_components(sp.csr_array(np.abs(inner) + np.abs(inertia)), directed=False)[1]
    pairs = combinations_with_replacement(range(len(inner)), 2)
    kept = [(i, j) for i, j in pairs if label[i] == label[j]]
    first, second = np.array(kept, dtype=np.int64).T
    return first, second


def _cores(first: IntArray, second: IntArray, count: int, shift: int = 0) -> FloatArray:
    """Return symmetric cores that pick pairs of forces, of force and momentum where shifted."""
    cores = np.zeros((len(first), 2 * count, 2 * count))
    for core, i, j in zip(cores, first, second, strict=True):
        for a, b in {(i, j), (j, i)}:
            core[a, b + shift] += 1.0
            if shift:
                core[b + shift, a] += 1.0
    return cores


def _terms(
    matrix: Literal["mass", "stiffness"], rows: SparseArray, cores: FloatArray
) -> list[Term]:
    return [Term(matrix, RowOperator(rows, core), weight=0.0) for core in cores]
