"""Assembly of element matrices into sparse global ones, planned once and repeated cheaply."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy.sparse as sp

from femubench.core.typing import FloatArray, IntArray, SparseArray

AT_ONCE = 4096  # elements whose dense matrices are held at a time, 5 MB each kind
_KEPT_ENTRIES = 20_000  # of a pattern, up to which its plan is kept


@dataclass(frozen=True)
class _Batch:
    """Elements that move with equally many dofs c.

    Arguments:
        elements: their numbers, (m,).
        entries: of the data of `gather`, those of these elements, (k,).
        place: where such an entry stands in the dense (m, r, c) rows of these elements, (k,).
        dofs: with which they move, ascending, (m, c).
    """

    elements: IntArray
    entries: IntArray
    place: IntArray
    dofs: IntArray

    @property
    def triangle(self) -> tuple[IntArray, IntArray]:
        """Return rows and columns of the upper triangle of a (c, c) matrix."""
        return np.triu_indices(self.dofs.shape[1])


@dataclass(frozen=True)
class AssemblyPlan:
    """The place of every entry of every symmetric element matrix in the global sparse matrix.

    Arguments:
        order: local dofs r of an element.
        weights: the data of `gather`.
        batches: the elements, some thousand at a time.
        targets: of every batch, where the upper triangles of its elements stand in that of the
            whole, (m, c (c + 1) / 2).
        source: where a sparse entry stands in the upper triangle of the whole, (n_entries,).
        indices, indptr: the compressed column pattern.
    """

    order: int
    weights: FloatArray
    batches: tuple[_Batch, ...]
    targets: tuple[IntArray, ...]
    source: IntArray
    indices: IntArray
    indptr: IntArray

    def assemble(self, matrices: FloatArray) -> SparseArray:
        """Return the sum of G_e' k_e G_e over all elements as a sparse matrix, (n, n).

        Arguments:
            matrices: symmetric, (n_elements, r, r).
        """
        return self.assemble_from(matrices.__getitem__)

    def assemble_from(self, matrices: Callable[[IntArray], FloatArray]) -> SparseArray:
        """Return the same of matrices that are made some thousand at a time.

        Arguments:
            matrices: from numbers of elements (m,) to their symmetric matrices, (m, r, r).
        """
        size = len(self.indptr) - 1
        total = np.zeros(int(self.source.max(initial=-1)) + 1)
        for batch, target in zip(self.batches, self.targets, strict=True):
            rows = np.zeros((len(batch.elements), self.order, batch.dofs.shape[1]))
            rows.reshape(-1)[batch.place] = self.weights[batch.entries]
            whole = np.swapaxes(rows, 1, 2) @ (matrices(batch.elements) @ rows)
            i, j = batch.triangle
            np.add.at(total, target, whole[:, i, j])
        return sp.csc_array((total[self.source], self.indices, self.indptr), shape=(size, size))


def plan_assembly(gather: SparseArray, order: int) -> AssemblyPlan:
    """Return the plan for elements whose local displacements are `gather @ free dofs`.

    Arguments:
        gather: sparse, (n_elements * order, n).
        order: local dofs of an element.
    """
    g = sp.csr_array(gather)
    if g.nnz > _KEPT_ENTRIES or {g.indices.dtype, g.indptr.dtype} != {np.dtype(np.int32)}:
        return _planned(g, order)
    # Frames that are meshed anew with other numbers in them mostly have the same pattern.
    bare = _known_plan(g.shape, g.indices.tobytes(), g.indptr.tobytes(), order)
    return replace(bare, weights=g.data)


@lru_cache(maxsize=32)
def _known_plan(shape: tuple[int, int], indices: bytes, bounds: bytes, order: int) -> AssemblyPlan:
    """Return the plan of a pattern, whatever the entries of `gather` are."""
    pattern = np.frombuffer(indices, np.int32), np.frombuffer(bounds, np.int32)
    one = np.ones(len(pattern[0]), dtype=np.int8)
    return _planned(sp.csr_array((one, *pattern), shape=shape), order)


def _planned(g: SparseArray, order: int) -> AssemblyPlan:
    """Return the plan for elements whose local displacements are `g @ free dofs`."""
    size = g.shape[1]
    batches = tuple(_batches(g, order))
    rows, columns = _pair_side(batches, 0), _pair_side(batches, 1)
    turned = _by_column(rows, columns, size)
    rows, columns = rows[turned], columns[turned]
    new = np.ones(len(turned), dtype=bool)
    new[1:] = (rows[1:] != rows[:-1]) | (columns[1:] != columns[:-1])
    number = np.cumsum(new, dtype=turned.dtype)
    number -= 1
    target = np.empty_like(turned)
    target[turned] = number
    rows, columns = rows[new], columns[new]
    sizes = [(len(b.elements), len(b.triangle[0])) for b in batches]
    stops = np.cumsum([0, *(count * width for count, width in sizes)])
    targets = tuple(
        target[start : start + count * width].reshape(count, width)
        for start, (count, width) in zip(stops, sizes, strict=False)
    )
    off = np.flatnonzero(rows != columns).astype(target.dtype)
    source = np.concatenate([np.arange(len(rows), dtype=target.dtype), off])
    rows, columns = np.concatenate([rows, columns[off]]), np.concatenate([columns, rows[off]])
    turn = _by_column(rows, columns, size)
    indptr = np.zeros(size + 1, dtype=target.dtype)
    np.cumsum(np.bincount(columns, minlength=size), out=indptr[1:])
    return AssemblyPlan(order, g.data, batches, targets, source[turn], rows[turn], indptr)


def _pair_side(batches: Sequence[_Batch], side: int) -> IntArray:
    """Return the row or the column of every entry of all upper triangles, batch by batch."""
    parts = [batch.dofs[:, batch.triangle[side]].ravel() for batch in batches]
    return np.concatenate([np.zeros(0, dtype=np.int32), *parts])


def _batches(gather: SparseArray, order: int) -> Iterator[_Batch]:
    """Yield the elements in their order, those of one batch with equally many dofs."""
    size, elements = gather.shape[1], gather.shape[0] // order
    for start in range(0, elements, AT_ONCE):
        stop = min(start + AT_ONCE, elements)
        bounds = gather.indptr[start * order : stop * order + 1]
        row = np.repeat(np.arange((stop - start) * order), np.diff(bounds))
        element, column = row // order, gather.indices[bounds[0] : bounds[-1]]
        keys, place = np.unique(element * np.int64(size) + column, return_inverse=True)
        owner, dof = np.divmod(keys, size)
        counts = np.bincount(owner, minlength=stop - start)
        first = np.cumsum(counts) - counts
        for count in np.unique(counts[counts > 0]):
            own = np.flatnonzero(counts == count)
            number = np.cumsum(counts == count) - 1
            entries = np.flatnonzero(counts[element] == count)
            e = element[entries]
            local = number[e] * order + row[entries] % order
            yield _Batch(
                elements=own + start,
                entries=(entries + bounds[0]).astype(np.int32),
                place=(local * count + place[entries] - first[e]).astype(np.int32),
                dofs=dof[first[own][:, None] + np.arange(count)].astype(np.int32),
            )


def _by_column(rows: IntArray, columns: IntArray, size: int) -> IntArray:
    """Return the order by columns, and in every column by rows."""
    turn = _stable_order(rows, size)
    return np.asarray(turn[_stable_order(columns[turn], size)])


def _stable_order(keys: IntArray, size: int) -> IntArray:
    """Return the stable order of numbers below `size`, in linear time: one is a matrix's row."""
    one, count = np.ones(len(keys), dtype=np.int8), len(keys)
    bounds = np.arange(count + 1, dtype=np.int32 if 2 * count < 2**31 else np.int64)
    rows = sp.csr_array((one, keys, bounds), shape=(count, size))
    return np.asarray(rows.tocsc().indices)


def narrow_indices(matrix: SparseArray) -> SparseArray:
    """Return a sparse matrix by rows, with indices of 32 bits where these are enough."""
    found = sp.csr_array(matrix)
    if max(found.nnz, *found.shape) < 2**31:
        found.indices = found.indices.astype(np.int32, copy=False)
        found.indptr = found.indptr.astype(np.int32, copy=False)
    return found


def prune(matrix: SparseArray) -> SparseArray:
    """Return a symmetric matrix without the entries that cancelled to roundoff, (n, n)."""
    scale = np.sqrt(np.abs(matrix.diagonal()))
    whole = matrix.tocsc()
    whole.sum_duplicates()
    column = np.repeat(np.arange(whole.shape[1]), np.diff(whole.indptr))
    keep = np.abs(whole.data) > 1e-13 * scale[whole.indices] * scale[column]
    bounds = np.concatenate([[0], np.cumsum(keep)])[whole.indptr].astype(whole.indptr.dtype)
    return sp.csc_array((whole.data[keep], whole.indices[keep], bounds), shape=whole.shape)
