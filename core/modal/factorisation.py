"""Symmetric sparse matrices, factorised by SuperLU, or by CHOLMOD where it is there and fast."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.modal.superlu_pivots import pivots
from femubench.core.typing import FloatArray, IntArray, SparseArray

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

# From about so many unknowns on, nested dissection earns its own time on structures in space.
_DISSECTED = 50_000
_MISSING = "no scikit-sparse"
_AT_ONCE = 4_000_000  # entries of right sides solved at once
_BLOCK = 32  # columns at once from which more gain nothing


@cache
def _blas() -> ThreadpoolController:
    """Return the BLAS of NumPy and that of CHOLMOD, once both are loaded."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas")


@contextmanager
def _threads_of_numpy() -> Iterator[None]:
    """Give the BLAS of CHOLMOD no more threads than that of NumPy may use within the block."""
    pools = _blas()
    threads = [pool.num_threads for pool in pools.lib_controllers]
    if len({*threads}) < 2:
        yield
        return
    with pools.limit(limits=min(threads)):
        yield


class Cholesky:
    """L L' of positive definite matrices of one pattern, by CHOLMOD.

    Arguments:
        pattern: a symmetric matrix that has an entry wherever any of them has one.
        spatial: whether the structure fills space, so that nested dissection orders it best.

    Source: Chen, Davis, Hager & Rajamanickam (2008), CHOLMOD.
    """

    negative = 0

    def __init__(self, pattern: SparseArray, *, spatial: bool = False) -> None:
        from sksparse.cholmod import analyze

        self.size = pattern.shape[0]
        order = "metis" if spatial and self.size >= _DISSECTED else "amd"
        self._factor: Any = analyze(
            _indexed(pattern), mode="supernodal", ordering_method=order, use_long=False
        )

    @_threads_of_numpy()
    def factorise(self, matrix: SparseArray) -> bool:
        """Put another matrix into the place of the last; False where it is not definite."""
        from sksparse.cholmod import CholmodNotPositiveDefiniteError

        try:
            self._factor.cholesky_inplace(_indexed(matrix))
        except CholmodNotPositiveDefiniteError:
            return False
        return True

    @_threads_of_numpy()
    def solve(self, right: FloatArray) -> FloatArray:
        """Return the inverse times one or several right sides, (n,) or (n, m)."""
        return np.asarray(self._factor(right))

    @_threads_of_numpy()
    def compliance(self, basis: SparseArray) -> FloatArray:
        """Return basis' inverse basis of sparse columns, (p, p)."""
        # A column is felt along its path in the elimination tree alone: the rest is zero.
        permuted = map(self._factor.apply_P, _blocks(basis))
        parts = (self._factor.solve_L(p, use_LDLt_decomposition=False) for p in permuted)
        half = sp.hstack([sp.csc_array(part) for part in parts], format="csc")  # L^-1 basis
        return np.asarray((half.T @ half).toarray())


class LU:
    """L U of any symmetric matrix by SuperLU.

    Arguments:
        matrix: symmetric, sparse, (n, n).
        pivot: share of the largest entry of its column below which a diagonal entry is no pivot.
        order: in which rows are eliminated, (n,); None for minimum degree.

    Raises:
        RuntimeError: when the matrix is singular.

    Source: Li (2005), SuperLU; symmetric mode with minimum degree on the pattern.
    """

    def __init__(
        self, matrix: SparseArray, *, pivot: float = 0.0, order: IntArray | None = None
    ) -> None:
        from scipy.sparse.linalg import splu

        self._order = order
        self._factor = splu(
            sp.csc_matrix(matrix if order is None else sp.csc_array(matrix)[order][:, order]),
            permc_spec="MMD_AT_PLUS_A" if order is None else "NATURAL",
            diag_pivot_thresh=pivot,
            options={"SymmetricMode": True},
        )

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the inverse times one or several right sides, (n,) or (n, m)."""
        if self._order is None:
            return np.asarray(self._factor.solve(np.ascontiguousarray(right)))
        answer = np.empty(right.shape)
        answer[self._order] = self._factor.solve(right[self._order])
        return answer

    @property
    def negative(self) -> int | None:
        """Return the number of negative pivots; None where rows were exchanged for stability."""
        if not np.array_equal(self._factor.perm_r, self._factor.perm_c):
            return None
        return int(np.sum(pivots(self._factor) < 0.0))


class DefiniteLU:
    """L U of positive definite matrices by SuperLU; no pivot of such a matrix is negative.

    Arguments:
        order: as for `LU`.
    """

    def __init__(self, order: IntArray | None = None) -> None:
        self._factor: LU | None = None
        self._order = order

    def factorise(self, matrix: SparseArray) -> bool:
        """Put another matrix into the place of the last; False where it is not definite."""
        self._factor = None
        try:
            factor = LU(matrix, order=self._order)
        except RuntimeError:
            return False
        self._factor = factor if factor.negative == 0 else None
        return self._factor is not None

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the inverse times one or several right sides, (n,) or (n, m)."""
        assert self._factor is not None, "a definite matrix comes first"
        return self._factor.solve(right)

    def compliance(self, basis: SparseArray) -> FloatArray:
        """Return basis' inverse basis of sparse columns, (p, p)."""
        assert self._factor is not None, "a definite matrix comes first"
        return np.hstack([basis.T @ self._factor.solve(part) for part in _blocks(basis)])


# A factorised symmetric matrix, and one that is definite, whose place others can take.
Symmetric: TypeAlias = Cholesky | LU
Definite: TypeAlias = Cholesky | DefiniteLU


def factorise_definite(matrix: SparseArray) -> Definite:
    """Return a factorised matrix; raises ModelError when it is not definite."""
    found = DefiniteLU() if cholmod_obstacle() else Cholesky(matrix)
    if not found.factorise(matrix):
        raise ModelError("a part of the model is not held by its stiffness and has no mass")
    return found


def _blocks(columns: SparseArray) -> Iterator[FloatArray]:
    """Yield some columns at a time, dense."""
    width = min(max(_AT_ONCE // columns.shape[0], 4), _BLOCK)
    for start in range(0, columns.shape[1], width):
        yield columns[:, start : start + width].toarray()


def _indexed(matrix: SparseArray) -> sp.csc_matrix:
    """Return a matrix as CHOLMOD reads it: columns, sorted, with indices of 32 bits."""
    found = sp.csc_matrix(matrix)
    found.sort_indices()
    found.indices = found.indices.astype(np.int32, copy=False)
    found.indptr = found.indptr.astype(np.int32, copy=False)
    return found


@cache
def cholmod_obstacle() -> str | None:
    """Return why CHOLMOD is not used; None where it is."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import sksparse.cholmod  # noqa: F401
    except ImportError:
        return _MISSING
    if slow := _reference_blas(_loaded_libraries()):
        return (
            f"CHOLMOD is linked to the reference BLAS {slow}, six times slower than OpenBLAS "
            "(Debian: apt install libopenblas0)"
        )
    return None


def _loaded_libraries() -> list[str]:
    try:
        lines = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
    return sorted({line.split(maxsplit=5)[5] for line in lines if line.count("/")})


def _reference_blas(libraries: list[str]) -> str | None:
    """Return the BLAS among loaded libraries that nobody made fast."""
    tuned = re.compile("openblas|mkl|blis|atlas|armpl|nvpl")
    for path in libraries:
        if re.match(r"lib(ref)?blas\.", Path(path).name) and not tuned.search(path):
            return path
    return None


def solver_name() -> str:
    """Return what factorises large models here, and why it is not CHOLMOD where it is not."""
    obstacle = cholmod_obstacle()
    return "CHOLMOD" if obstacle is None else f"SuperLU ({obstacle})"


def solver_note() -> tuple[str, ...]:
    """Return what to tell a user who has installed CHOLMOD in vain."""
    obstacle = cholmod_obstacle()
    if obstacle in (None, _MISSING):
        return ()
    return (f"models of more than 500 dofs are solved by SuperLU: {obstacle}",)
