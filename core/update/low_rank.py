"""Low-rank changes of a model, and the least one that meets measured frequencies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as la

from femubench.core.fem.model import LowRank, Model
from femubench.core.modal.eigen import DENSE_LIMIT, Modes, keep_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import partners_of
from femubench.core.update.promise import check_used_modes

_OUTSIDE = 1e-10  # of a change, what rounding leaves outside the space it acts in


def with_stiffness_step(model: Model, modes: Modes, step: LowRank) -> Model:
    """Return the model with one more low-rank change of its stiffness.

    A large model whose change moves nothing but the given modes is not solved again: it keeps the
    modes that follow from these.

    Arguments:
        model: before the change.
        modes: its lowest ones, none missed.
        step: of the stiffness.

    Examples:
        >>> softer = fem.LowRank(model.mass @ modes.shapes[:, 3:4], np.array([[-1e5]]))
        >>> changed = update.with_stiffness_step(model, modes, softer)
        >>> gap = femubench.solve_modes(changed).eigenvalues[3] - modes.eigenvalues[3]
        >>> round(float(gap))
        -100000
    """
    changed = replace(model, stiffness_change=LowRank.total([model.stiffness_change, step]))
    if model.size > DENSE_LIMIT:
        after = _modes_after(model, modes, step)
        if after is not None:
            keep_modes(changed, after)
    return changed


def _modes_after(model: Model, modes: Modes, step: LowRank) -> Modes | None:
    """Return the modes after a change in their space; None where it moves others, or one past."""
    gain = modes.shapes.T @ step.basis
    rest = step.basis - model.mass_times(modes.shapes @ gain)
    if np.any(la.norm(rest, axis=0) > _OUTSIDE * la.norm(step.basis, axis=0)):
        return None
    inner = gain @ step.core @ gain.T
    values, turn = la.eigh(np.diag(modes.eigenvalues) + 0.5 * (inner + inner.T))
    if values[-1] > (1.0 + _OUTSIDE) * modes.eigenvalues[-1]:
        return None
    rigid = np.square(turn[modes.rigid]).sum(axis=0) > 0.5
    still = rigid & (np.abs(values) <= _OUTSIDE * np.abs(values[-1]))
    return Modes(np.where(still, 0.0, values), modes.shapes @ turn, np.asarray(rigid))


def with_measured_frequencies(model: Model, measurement: Measurement) -> Model:
    """Return the model with the measured frequencies on the modes that pair with measured ones.

    K + M Phi (Lambda_m - Lambda) Phi' M with the model's own Phi and Lambda: every shape, every
    other frequency, the rigid-body modes and the mass stay. A measured mode without a partner
    changes nothing.

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
    met = with_stiffness_step(model, modes, change)
    check_used_modes(met, shapes, wanted)
    return met
