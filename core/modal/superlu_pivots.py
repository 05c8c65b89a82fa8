"""The pivots of a SuperLU factorisation, read in place: SciPy hands them out by copying L and U."""

from __future__ import annotations

import ctypes
import sys
from typing import Any

import numpy as np

from femubench.core.typing import FloatArray

_COLUMNS, _SUPERNODAL_COLUMNS, _DOUBLE = 0, 3, 1  # SLU_NC, SLU_SC, SLU_D
_LOWEST = 65536  # no address lies below it


class _Matrix(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int) for name in ("storage", "kind", "shape", "rows", "columns")),
        ("store", ctypes.c_void_p),
    ]


class _Object(ctypes.Structure):
    _fields_ = [
        ("head", ctypes.c_byte * object.__basicsize__),
        ("rows", ctypes.c_ssize_t),
        ("columns", ctypes.c_ssize_t),
        ("lower", _Matrix),
        ("upper", _Matrix),
    ]


class _Supernodes(ctypes.Structure):
    _fields_ = [
        ("entries", ctypes.c_int),
        ("last", ctypes.c_int),
        ("values", ctypes.POINTER(ctypes.c_double)),
        ("starts", ctypes.POINTER(ctypes.c_int)),
        ("_rows", ctypes.c_void_p),
        ("_row_starts", ctypes.c_void_p),
        ("supernode", ctypes.POINTER(ctypes.c_int)),
        ("first", ctypes.POINTER(ctypes.c_int)),
    ]


def pivots(factor: Any) -> FloatArray:  # noqa: ANN401 - SciPy's SuperLU, whose fields are private
    """Return the diagonal of U, (n,); where SciPy lays its object out otherwise, from a copy.

    The diagonal blocks of U lie in the supernodes of L, column by column. Every size that SciPy
    tells by itself has to be found in its object, and every address to be one.

    Arguments:
        factor: from `scipy.sparse.linalg.splu`, real.

    Source: Demmel, Eisenstat, Gilbert, Li & Liu (1999), supernodal storage.
    """
    n, store = factor.shape[0], _supernodes(factor)
    if store is None:
        return np.asarray(factor.U.diagonal())
    supernode = np.ctypeslib.as_array(store.supernode, (n,))
    first = np.ctypeslib.as_array(store.first, (store.last + 1,))
    starts = np.ctypeslib.as_array(store.starts, (n,))
    at = starts + np.arange(n) - first[supernode]
    values = np.ctypeslib.as_array(store.values, (int(starts[-1]) + n,))
    return np.array(values[at])


def _supernodes(factor: Any) -> _Supernodes | None:  # noqa: ANN401 - as above
    """Return where the supernodes of L lie; None where they are not as they are known here."""
    n = factor.shape[0]
    if (
        sys.implementation.name != "cpython"
        or type(factor).__basicsize__ < ctypes.sizeof(_Object)
        or n == 0
    ):
        return None
    inside = _Object.from_address(id(factor))
    lower, upper = inside.lower, inside.upper
    parts = [(part.rows, part.columns, part.kind) for part in (lower, upper)]
    if (inside.rows, inside.columns, *parts) != (n, n, *2 * [(n, n, _DOUBLE)]):
        return None
    if (lower.storage, upper.storage) != (_SUPERNODAL_COLUMNS, _COLUMNS):
        return None
    if not (lower.store and upper.store):
        return None
    store = _Supernodes.from_address(lower.store)
    # Indices of 64 bits would move all that follows, and put numbers where pointers should be.
    entries = store.entries + ctypes.c_int.from_address(upper.store).value
    pointers = (store.values, store.starts, store.supernode, store.first)
    addresses = [ctypes.cast(pointer, ctypes.c_void_p).value or 0 for pointer in pointers]
    if entries != factor.nnz or not 0 <= store.last < n or min(addresses) <= max(n, _LOWEST):
        return None
    return store
