"""Low-rank changes of a model: sums that stay low-rank."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg as la

from femubench.core.model import LowRank

_NEGLIGIBLE = 1e-14


def total_change(parts: Sequence[LowRank | None]) -> LowRank | None:
    """Return the sum of low-rank changes with the smallest rank that represents it.

    Arguments:
        parts: changes of one matrix; None stands for no change.
    """
    changes = [part for part in parts if part is not None]
    if not changes:
        return None
    q, r = la.qr(np.hstack([change.basis for change in changes]), mode="economic")
    core = r @ la.block_diag(*(change.core for change in changes)) @ r.T
    values, turn = la.eigh(0.5 * (core + core.T))
    keep = np.abs(values) > _NEGLIGIBLE * np.abs(values).max(initial=0.0)
    return LowRank(q @ turn[:, keep], np.diag(values[keep]))
