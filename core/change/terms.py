"""What an effect does to mass and stiffness, as a sum of fixed matrices with varying factors.

    K(values) = K + sum_i a_i(values) A_i ,   M(values) = M + sum_i b_i(values) B_i

The matrices are never global: each knows the few dofs or elements that it touches, so that a
modal basis is projected on them once and every further value costs a small sum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import scipy.sparse as sp

from femubench.core.fem.structure import Structure
from femubench.core.typing import FloatArray, IntArray, SparseArray

Coefficients = Callable[[FloatArray], FloatArray]


class Operator(Protocol):
    """A symmetric matrix on the dofs of the model and the ones that the effect adds."""

    def apply(self, vectors: FloatArray) -> FloatArray:
        """Return the product with vectors, (n + extra, m)."""
        ...

    def project(self, vectors: FloatArray) -> FloatArray:
        """Return vectors' A vectors, (m, m)."""
        ...


@dataclass(frozen=True)
class ElementOperator:
    """Element matrices of some elements in their local axes.

    Arguments:
        structure: the nominal frame.
        elements: their rows in its mesh, (k,).
        blocks: local matrices, (k, 12, 12) or (k, b, 12, 12); terms may share them.
        extra: dofs that the effect adds elsewhere.
        share: what each block is multiplied by, (k,) or (k, b); None for 1.
        kind: which of the blocks is an element's, (k,), where elements are alike; None for each
            its own.
    """

    structure: Structure
    elements: IntArray
    blocks: FloatArray
    extra: int = 0
    share: FloatArray | None = None
    kind: IntArray | None = None

    @property
    def matrices(self) -> FloatArray:
        """Return the local matrices, each times its share, (k, 12, 12)."""
        blocks, share = self.blocks, self.share
        if blocks.ndim == 3:
            own = blocks if self.kind is None else blocks[self.kind]
            return own if share is None else share[:, None, None] * own
        assert share is not None
        total = np.zeros((len(share), 12, 12))
        # One after the other: all of them at once would be as many times the memory.
        for b, factor in enumerate(share.T):
            own = blocks[:, b] if self.kind is None else blocks[self.kind, b]
            total += factor[:, None, None] * own
        return total

    @property
    def _rows(self) -> SparseArray:
        rows = (12 * self.elements[:, None] + np.arange(12)).ravel()
        return self.structure.gather[rows]

    def apply(self, vectors: FloatArray) -> FloatArray:
        """Return the product with vectors, (n + extra, m)."""
        rows = self._rows
        n, m = rows.shape[1], vectors.shape[1]
        local = (rows @ vectors[:n]).reshape(-1, 12, m)
        product = np.zeros(vectors.shape)
        product[:n] = rows.T @ (self.matrices @ local).reshape(-1, m)
        return product

    def project(self, vectors: FloatArray) -> FloatArray:
        """Return vectors' A vectors, (m, m)."""
        rows = self._rows
        local = np.asarray(rows @ vectors[: rows.shape[1]])
        force = (self.matrices @ local.reshape(-1, 12, local.shape[1])).reshape(local.shape)
        return np.asarray(local.T @ force)


@dataclass(frozen=True)
class RowOperator:
    """rows' core rows of a few relative or absolute displacements.

    Arguments:
        rows: displacements from dofs, sparse (p, n + extra).
        core: symmetric, (p, p).
    """

    rows: SparseArray
    core: FloatArray

    def apply(self, vectors: FloatArray) -> FloatArray:
        """Return the product with vectors, (n + extra, m)."""
        return np.asarray(self.rows.T @ (self.core @ (self.rows @ vectors)))

    def project(self, vectors: FloatArray) -> FloatArray:
        """Return vectors' A vectors, (m, m)."""
        seen = np.asarray(self.rows @ vectors)
        return np.asarray(seen.T @ (self.core @ seen))


@dataclass(frozen=True)
class MatrixOperator:
    """Any sparse symmetric matrix, (n + extra, n + extra)."""

    matrix: SparseArray

    def apply(self, vectors: FloatArray) -> FloatArray:
        """Return the product with vectors, (n + extra, m)."""
        return np.asarray(self.matrix @ vectors)

    def project(self, vectors: FloatArray) -> FloatArray:
        """Return vectors' A vectors, (m, m)."""
        return np.asarray(vectors.T @ np.asarray(self.matrix @ vectors))


@dataclass(frozen=True)
class Term:
    """One fixed matrix of a change: what it belongs to and where it acts.

    Arguments:
        matrix: what it is added to.
        operator: the matrix.
        weight: by how much a mass makes the structure heavier in kg, 0 for the inertia of what
            follows other dofs; None for what it weighs when the whole is moved.
    """

    matrix: Literal["mass", "stiffness"]
    operator: Operator
    weight: float | None = None


@dataclass(frozen=True)
class Change:
    """What an effect does to a model at one place.

    Arguments:
        terms: fixed matrices.
        coefficients: from values (g, n_parameters) to the factors of the terms (g, n_terms).
        extra: dofs that the effect adds behind those of the model; they have neither mass nor
            stiffness but what the terms give them.
    """

    terms: tuple[Term, ...]
    coefficients: Coefficients
    extra: int = 0


def proportional(*terms: Term, neutral: float = 0.0) -> Change:
    """Return a change that grows with the distance of one value from its neutral one.

    Examples:
        >>> mass = effect.proportional(effect.mass_term(model, [fem.Place(joint="J1")]))
        >>> print(mass.coefficients(np.array([[0.5]])))
        [[0.5]]
    """
    count = len(terms)
    return Change(terms, lambda values: np.repeat(values[:, :1] - neutral, count, axis=1))


def chebyshev_nodes(low: float, high: float, count: int) -> FloatArray:
    """Return the Chebyshev points of the second kind between two bounds, ascending, (count,).

    Examples:
        >>> print(effect.chebyshev_nodes(0.0, 2.0, 3))
        [0. 1. 2.]
    """
    return 0.5 * (low + high) - 0.5 * (high - low) * np.cos(np.pi * np.arange(count) / (count - 1))


def barycentric(nodes: FloatArray, points: FloatArray) -> FloatArray:
    """Return the Lagrange basis at points, (n_points, n_nodes) (Berrut & Trefethen 2004, (5.4)).

    Arguments:
        nodes: Chebyshev points of the second kind, (n_nodes,).
        points: where to evaluate, (n_points,).

    Examples:
        >>> nodes = effect.chebyshev_nodes(0.0, 2.0, 4)
        >>> np.allclose(effect.barycentric(nodes, np.array([0.7])) @ nodes**3, 0.7**3)
        True
    """
    weight = (-1.0) ** np.arange(len(nodes))
    weight[[0, -1]] *= 0.5
    gap = points[:, None] - nodes[None, :]
    hit = np.abs(gap) < 1e-14 * max(float(np.ptp(nodes)), 1e-300)
    share = weight / np.where(hit, 1.0, gap)
    share = share / share.sum(axis=1, keepdims=True)
    on_node = hit.any(axis=1)
    share[on_node] = hit[on_node]
    return np.asarray(share)


def sparse_term(matrix: Literal["mass", "stiffness"], change: SparseArray) -> Term:
    """Return a term of a sparse matrix.

    Examples:
        >>> effect.sparse_term("stiffness", model.stiffness).matrix
        'stiffness'
    """
    return Term(matrix, MatrixOperator(sp.csr_array(change)))
