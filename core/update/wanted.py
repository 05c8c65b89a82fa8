"""The modes that an equation error asks for: how shapes are expanded, whose frequencies stand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import NotApplicable
from femubench.core.measurement import Measurement
from femubench.core.modal.eigen import DENSE_LIMIT
from femubench.core.modal.expansion import expand_by_dynamics, measured_rows
from femubench.core.model import Model
from femubench.core.typing import FloatArray
from femubench.core.update.quasi import QuasiModes, quasi_measured_modes

Expansion = Literal["rotation", "force"]
Frequencies = Literal["measured", "nominal"]


@dataclass(frozen=True)
class WantedModes:
    """What the equations shall hold for, at any current estimate.

    Arguments:
        nominal: the model before the update.
        measurement: the used modes.
        expansion: `rotation` of the current estimate's shapes, or `force`, the smallest force
            residual in the nominal model.
        frequencies: the measured ones, or those of the nominal model.

    Source: Ahmadian, Gladwell & Ismail (1997), equations (15)-(17).
    """

    nominal: Model
    measurement: Measurement
    expansion: Expansion = "rotation"
    frequencies: Frequencies = "measured"

    def at(self, current: Model) -> QuasiModes:
        """Return the modes at a current estimate.

        Raises:
            StrategyFailure: when a measured mode has no partner in the model.
            NotApplicable: when there are fewer complete sensors than modes, or the model is too
                large for `force`.
        """
        forced = self.expansion == "force"
        quasi = quasi_measured_modes(self.nominal if forced else current, self.measurement)
        own = quasi
        if self.frequencies == "nominal" and not forced:
            own = quasi_measured_modes(self.nominal, self.measurement)
        if forced:
            quasi = replace(quasi, shapes=self._forced())
        if self.frequencies == "nominal":
            quasi = replace(quasi, eigenvalues=own.modes.eigenvalues[own.partners])
        return quasi

    def _forced(self) -> FloatArray:
        """Return shapes of the smallest force residual, mass-normalised, (n, m)."""
        model, measured = self.nominal, self.measurement
        if model.size > DENSE_LIMIT:
            raise NotApplicable(f"expansion by forces is for at most {DENSE_LIMIT} dofs")
        rows = measured_rows(measured.shapes)
        sensors = sp.csr_array(model.observe(measured.sensors))[rows]
        shapes = expand_by_dynamics(model, sensors, measured.shapes[rows], measured.eigenvalues)
        return np.asarray(shapes / np.sqrt(np.einsum("ij,ij->j", shapes, model.mass_times(shapes))))
