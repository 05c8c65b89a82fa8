"""Low-rank changes of a model, and the least one that meets measured frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg as la

from femubench.core.fem.model import LowRank, Model
from femubench.core.modal.measurement import Measurement
from femubench.core.update.promise import check_used_modes
from femubench.core.update.quasi import partners_of

_NEGLIGIBLE = 1e-14


def total_change(parts: Sequence[LowRank | None]) -> LowRank | None:
    """Return the sum of low-rank changes with the smallest rank that represents it.

    Arguments:
        parts: changes of one matrix; None stands for no change.

    Examples:
        >>> change = fem.LowRank(np.eye(4, 2), np.eye(2))
        >>> np.allclose(update.total_change([change, None, change]).toarray(), 2 * change.toarray())
        True
    """
    changes = [part for part in parts if part is not None]
    if not changes:
        return None
    q, r = la.qr(np.hstack([change.basis for change in changes]), mode="economic")
    core = r @ la.block_diag(*(change.core for change in changes)) @ r.T
    values, turn = la.eigh(0.5 * (core + core.T))
    keep = np.abs(values) > _NEGLIGIBLE * np.abs(values).max(initial=0.0)
    return LowRank(q @ turn[:, keep], np.diag(values[keep]))


def with_measured_frequencies(model: Model, measurement: Measurement) -> Model:
    """Return the model with the measured frequencies on the modes that pair with measured ones.

    K + M Phi (Lambda_m - Lambda) Phi' M with the model's own Phi and Lambda: every shape, every
    other frequency, the rigid-body modes and the mass stay. A measured mode without a partner
    changes nothing.

    Arguments:
        model: any model.
        measurement: the used modes.

    Raises:
        SelfCheckFailed: when the frequencies are not met to 1e-8.

    Source: Baruch & Bar-Itzhack (1978), where the measured shapes are those of the model.

    Examples:
        >>> met = femubench.solve_modes(update.with_measured_frequencies(model, measurement))
        >>> np.allclose(met.elastic.natural_frequencies[:3], measurement.frequencies)
        True
    """
    modes, partner = partners_of(model, measurement)
    found = partner >= 0
    if not found.any():
        return model
    shapes, wanted = modes.shapes[:, partner[found]], measurement.eigenvalues[found]
    core = np.diag(wanted - modes.eigenvalues[partner[found]])
    change = LowRank(model.mass_times(shapes), core)
    met = replace(model, stiffness_change=total_change([model.stiffness_change, change]))
    check_used_modes(met, shapes, wanted)
    return met
