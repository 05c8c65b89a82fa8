"""Stiffness matrices with a fixed pattern of zeros, entry by entry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import NotApplicable
from femubench.core.model import Model
from femubench.core.typing import FloatArray, IntArray, SparseArray


@dataclass(frozen=True)
class EntryPattern:
    """The non-zero entries of the upper triangle of a symmetric matrix.

    Arguments:
        row, column: where they stand, row <= column, (n_entries,).
        values: their nominal values, (n_entries,).
        size: number of dofs n.
    """

    row: IntArray
    column: IntArray
    values: FloatArray
    size: int

    @classmethod
    def of(cls, model: Model) -> EntryPattern:
        """Return the pattern of a model's stiffness matrix.

        Raises:
            NotApplicable: when the stiffness has a low-rank term, which has no zeros to keep.
        """
        if model.stiffness_change is not None:
            raise NotApplicable("a stiffness with a low-rank term has no pattern of zeros")
        upper = sp.triu(model.stiffness, format="coo")
        upper.sum_duplicates()
        kept = upper.data != 0.0
        row, column = upper.row[kept].astype(np.int64), upper.col[kept].astype(np.int64)
        return cls(row, column, upper.data[kept], model.size)

    def __len__(self) -> int:
        return len(self.row)

    def matrix(self, changes: FloatArray) -> SparseArray:
        """Return the full matrix after relative changes of the entries, sparse (n, n).

        Arguments:
            changes: of every entry, relative to its nominal size, (n_entries,).
        """
        values = self.values + np.abs(self.values) * changes
        off = self.row != self.column
        entries = np.concatenate([values, values[off]])
        rows = np.concatenate([self.row, self.column[off]])
        columns = np.concatenate([self.column, self.row[off]])
        return sp.csc_array((entries, (rows, columns)), shape=(self.size, self.size))

    def products(self, vectors: FloatArray, scale: FloatArray) -> SparseArray:
        """Return how scale * (K @ vectors) depends on the relative changes.

        Arguments:
            vectors: (n, m).
            scale: factor of every row of the product, (n,).

        Returns:
            Sparse (n m, n_entries); row i m + j belongs to dof i of vector j.
        """
        m, off = vectors.shape[1], self.row != self.column
        entry = np.arange(len(self))
        target = np.concatenate([self.row, self.column[off]])
        source = np.concatenate([self.column, self.row[off]])
        which = np.concatenate([entry, entry[off]])
        factor = scale[target] * np.abs(self.values[which])
        data = factor[:, None] * vectors[source]
        rows = target[:, None] * m + np.arange(m)
        columns = np.broadcast_to(which[:, None], data.shape)
        triplet = (data.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_array(triplet, shape=(self.size * m, len(self)))

    def energies(self, vectors: FloatArray) -> FloatArray:
        """Return how triu(vectors' K vectors) depends on the relative changes.

        Returns:
            (m (m + 1) / 2, n_entries), rows in the order of ``numpy.triu_indices(m)``.
        """
        i, j = np.triu_indices(vectors.shape[1])
        straight = vectors[self.row][:, i] * vectors[self.column][:, j]
        mirrored = vectors[self.column][:, i] * vectors[self.row][:, j]
        both = straight + np.where((self.row != self.column)[:, None], mirrored, 0.0)
        return np.asarray((np.abs(self.values)[:, None] * both).T)
