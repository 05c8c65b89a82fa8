"""The least that meets measured frequencies: a model's own modes with other eigenvalues."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femubench.core.measurement import Measurement
from femubench.core.model import LowRank, Model
from femubench.core.update.lowrank import total_change
from femubench.core.update.promise import check_used_modes
from femubench.core.update.quasi import partners_of


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
