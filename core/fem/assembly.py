"""Assembly of element matrices into sparse global ones, planned once and repeated cheaply."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from femubench.core.typing import FloatArray, IntArray, SparseArray


@dataclass(frozen=True)
class AssemblyPlan:
    """The place of every entry of every element matrix in the global sparse matrix.

    Arguments:
        size: number of dofs n.
        source: flat index into the (n_elements, r, r) batch, (n_entries,).
        weight: factor of that entry, (n_entries,).
        target: position in the sparse data, (n_entries,).
        indices, indptr: the compressed column pattern.
    """

    size: int
    source: IntArray
    weight: FloatArray
    target: IntArray
    indices: IntArray
    indptr: IntArray

    def assemble(self, matrices: FloatArray) -> SparseArray:
        """Return the sum of G_e' k_e G_e over all elements as a sparse matrix, (n, n)."""
        values = matrices.reshape(-1)[self.source] * self.weight
        data = np.bincount(self.target, weights=values, minlength=len(self.indices))
        return sp.csc_array((data, self.indices, self.indptr), shape=(self.size, self.size))


def plan_assembly(gather: SparseArray, order: int) -> AssemblyPlan:
    """Return the plan for elements whose local displacements are `gather @ free dofs`.

    Arguments:
        gather: sparse, (n_elements * order, n).
        order: local dofs of an element.
    """
    size = gather.shape[1]
    g = sp.coo_array(gather)
    element, local = np.divmod(g.row.astype(np.int64), order)
    by_element = np.argsort(element, kind="stable")
    element, local = element[by_element], local[by_element]
    column, weight = g.col.astype(np.int64)[by_element], g.data[by_element]
    counts = np.bincount(element, minlength=gather.shape[0] // order)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    left, right = [], []
    for count in np.unique(counts[counts > 0]):
        entries = starts[counts == count][:, None] + np.arange(count)
        left.append(np.repeat(entries, count, axis=1).ravel())
        right.append(np.tile(entries, count).ravel())
    i = np.concatenate(left) if left else np.zeros(0, dtype=np.int64)
    j = np.concatenate(right) if right else np.zeros(0, dtype=np.int64)
    source = (element[i] * order + local[i]) * order + local[j]
    pattern, target = np.unique(column[j] * size + column[i], return_inverse=True)
    columns, rows = np.divmod(pattern, size)
    indptr = np.concatenate([[0], np.cumsum(np.bincount(columns, minlength=size))])
    return AssemblyPlan(size, source, weight[i] * weight[j], target, rows, indptr)


def prune(matrix: SparseArray, reference: SparseArray | None = None) -> SparseArray:
    """Return the matrix without the entries that cancelled to roundoff.

    Arguments:
        matrix: sparse symmetric, (n, n).
        reference: what sets the scale of a row; the matrix's own diagonal by default.
    """
    scale = np.sqrt(np.abs((matrix if reference is None else reference).diagonal()))
    entries = sp.coo_array(matrix)
    keep = np.abs(entries.data) > 1e-13 * scale[entries.row] * scale[entries.col]
    kept = (entries.data[keep], (entries.row[keep], entries.col[keep]))
    return sp.csc_array(kept, shape=matrix.shape)
