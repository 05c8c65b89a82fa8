"""The pivots of a SuperLU factorisation, read in place: SciPy hands them out by copying L and U."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from femubench.core.typing import FloatArray

_SUPERNODAL_COLUMNS, _DOUBLE = 3, 1  # SLU_SC, SLU_D


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

    The diagonal blocks of U lie in the supernodes of L, column by column.

    Arguments:
        factor: from `scipy.sparse.linalg.splu`, real.

    Source: Demmel, Eisenstat, Gilbert, Li & Liu (1999), supernodal storage.
    """
    n = factor.shape[0]
    if type(factor).__basicsize__ < ctypes.sizeof(_Object):
        return np.asarray(factor.U.diagonal())
    inside = _Object.from_address(id(factor))
    lower = inside.lower
    found = (inside.rows, inside.columns, lower.rows, lower.columns, lower.storage, lower.kind)
    if found != (n, n, n, n, _SUPERNODAL_COLUMNS, _DOUBLE) or not lower.store:
        return np.asarray(factor.U.diagonal())
    store = _Supernodes.from_address(lower.store)
    if not 0 <= store.last < n or not n <= store.entries:
        return np.asarray(factor.U.diagonal())
    supernode = np.ctypeslib.as_array(store.supernode, (n,))
    first = np.ctypeslib.as_array(store.first, (store.last + 1,))
    starts = np.ctypeslib.as_array(store.starts, (n,))
    at = starts + np.arange(n) - first[supernode]
    values = np.ctypeslib.as_array(store.values, (int(starts[-1]) + n,))
    return np.array(values[at])
