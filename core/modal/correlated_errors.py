"""Errors of frequencies that go together: their correlation from repeats, and how it is undone."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femubench.core.typing import FloatArray

_LEAST = 1e-6  # eigenvalue of a correlation matrix: below it errors are one, to a test's accuracy


def root_of(correlation: FloatArray) -> FloatArray:
    """Return the symmetric square root of a correlation matrix, (m, m).

    Of all roots the symmetric one leaves every error nearest to itself (Kessy, Lewin & Strimmer
    2018), so that an undone error is still that of a mode.

    Arguments:
        correlation: positive semidefinite, (m, m).
    """
    values, turn = la.eigh(correlation)
    return np.asarray((turn * np.sqrt(np.maximum(values, _LEAST))) @ turn.T)


def undone(correlation: FloatArray, rows: FloatArray) -> FloatArray:
    """Return errors in standard deviations as independent ones.

    Arguments:
        correlation: of the errors, (m, m).
        rows: along the first axis, (m, ...).
    """
    return np.asarray(np.linalg.solve(root_of(correlation), rows))


def shrunk_correlation(repeats: FloatArray) -> tuple[FloatArray, float]:
    """Return the correlation of columns, and the share by which it was shrunk towards none.

    The share is the one with the least mean square error, estimated from the scatter of the
    products themselves; the fewer repeats, the larger.

    Arguments:
        repeats: a row a repeat, (n, m), n >= 3.

    Source: Schaefer & Strimmer (2005), Stat. Appl. Genet. Mol. Biol. 4, 32, target D.
    """
    n = len(repeats)
    off = repeats - repeats.mean(axis=0)
    size = off.std(axis=0, ddof=1)
    off = off / np.where(size > 0.0, size, 1.0)
    products = off[:, :, None] * off[:, None, :]
    raw = products.sum(axis=0) / (n - 1.0)
    spread = np.square(products - products.mean(axis=0)).sum(axis=0) * n / (n - 1.0) ** 3
    apart = ~np.eye(len(raw), dtype=bool)
    total = float(np.square(raw[apart]).sum())
    share = min(float(spread[apart].sum()) / total, 1.0) if total > 0.0 else 0.0
    share = max(share, _LEAST)  # rounded frequencies may go together without any scatter
    found = np.where(apart, (1.0 - share) * raw, 1.0)
    return np.asarray(found), share
