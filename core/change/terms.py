"""Fixed matrices of a change: each knows the few dofs or elements that it touches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import scipy.sparse as sp

from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.typing import FloatArray, IntArray, SparseArray

_FULL = 0.25  # share of entries from which on products with the dense matrix are faster


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
    def local_rows(self) -> SparseArray:
        """Return the displacements of its elements from dofs, sparse (12 k, n)."""
        rows = (12 * self.elements[:, None] + np.arange(12)).ravel()
        return self.structure.gather[rows]

    def apply(self, vectors: FloatArray) -> FloatArray:
        """Return the product with vectors, (n + extra, m)."""
        rows = self.local_rows
        n, m = rows.shape[1], vectors.shape[1]
        local = (rows @ vectors[:n]).reshape(-1, 12, m)
        product = np.zeros(vectors.shape)
        product[:n] = rows.T @ (self.matrices @ local).reshape(-1, m)
        return product

    def project(self, vectors: FloatArray) -> FloatArray:
        """Return vectors' A vectors, (m, m)."""
        rows = self.local_rows
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
        matrix = self.matrix
        # Those of a reduced model have few zeros, and products of dense matrices take a tenth.
        if sp.issparse(matrix) and matrix.nnz > _FULL * matrix.shape[0] * matrix.shape[1]:
            matrix = matrix.toarray()
        return np.asarray(matrix @ vectors)

    def project(self, vectors: FloatArray) -> FloatArray:
        """Return vectors' A vectors, (m, m)."""
        return np.asarray(vectors.T @ self.apply(vectors))


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

    @classmethod
    def of(cls, matrix: Literal["mass", "stiffness"], change: SparseArray) -> Term:
        """Return the term of any symmetric matrix, sparse or of low rank.

        Examples:
            >>> effect.Term.of("stiffness", model.stiffness).matrix
            'stiffness'
        """
        return cls(matrix, MatrixOperator(sp.csr_array(change) if sp.issparse(change) else change))


def sparse_matrix(operator: Operator, size: int) -> SparseArray:
    """Return an operator as a sparse matrix, (n, n); of any other class, on those of a model."""
    if isinstance(operator, MatrixOperator):
        return sp.csr_array(operator.matrix)
    if isinstance(operator, RowOperator):
        return sp.csr_array(operator.rows.T @ sp.csr_array(operator.core) @ operator.rows)
    if isinstance(operator, ElementOperator):
        rows = operator.local_rows
        return sp.csr_array(rows.T @ sp.block_diag(operator.matrices, format="csr") @ rows)
    return sp.csr_array(operator.apply(np.eye(size)))


def translation_axis(structure: Structure) -> int:
    """Return the axis along which a frame is moved to weigh it."""
    return 0 if structure.frame.plane == "in-plane" else 2


def translation(structure: Structure) -> FloatArray:
    """Return the local displacements of all elements in a unit translation, (n_elements, 12)."""
    axis = structure.mesh.axes[:, :, translation_axis(structure)]
    motion = np.zeros((len(axis), 12))
    motion[:, 0:3] = motion[:, 6:9] = axis
    return motion


def heaviest_translation(model: Model) -> FloatArray:
    """Return the motion of all dofs in the unit translation that weighs a model, (n,)."""
    shift = model.dofs.motions[:, :3]
    if model.structure is not None:
        return np.asarray(shift[:, translation_axis(model.structure)])
    carried = np.einsum("nd,nd->d", shift, model.mass_times(shift))
    return np.asarray(shift[:, int(carried.argmax())])


def weigh_term(model: Model, term: Term) -> float:
    """Return by how much a term makes a structure heavier in kg for every unit of its factor."""
    if term.matrix == "stiffness":
        return 0.0
    if term.weight is not None:
        return term.weight
    operator = term.operator
    if isinstance(operator, ElementOperator):
        own = translation(operator.structure)[operator.elements]
        return float(np.einsum("ei,eij,ej->", own, operator.matrices, own))
    return float(operator.project(heaviest_translation(model)[:, None])[0, 0])
