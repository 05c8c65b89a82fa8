"""Quasi-measured modes: measured frequencies with shapes expanded to all dofs of a model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import NotApplicable, StrategyFailure
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import DENSE_LIMIT, Modes
from femubench.core.modal.expansion import (
    expand_by_dynamics,
    expand_by_rotation,
    find_measured_rows,
)
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import partners_of
from femubench.core.typing import FloatArray, IntArray

ITERATIONS = 5  # Ahmadian, Gladwell & Ismail (1997), section 4


@dataclass(frozen=True)
class QuasiModes:
    """Measured modes as a full model sees them.

    Arguments:
        shapes: mass-orthonormal with the model's mass, (n, m).
        eigenvalues: measured, in rad^2/s^2, (m,).
        rigid: free rigid-body modes of the model, mass-orthonormal, (n, r).
        modes: the model's own modes from which the shapes were made.
        partners: which of them belong to the measured ones, (m,).

    Attributes:
        ITERATIONS: how often an update starts again from its own shapes, as the source does.
    """

    ITERATIONS: ClassVar[int] = ITERATIONS

    shapes: FloatArray
    eigenvalues: FloatArray
    rigid: FloatArray
    modes: Modes
    partners: IntArray

    @property
    def frequency_error(self) -> float:
        """Return the largest relative error of the model's own frequencies; 1 for an imaginary."""
        measured = np.sqrt(self.eigenvalues) / (2.0 * np.pi)
        own = self.modes.natural_frequencies[self.partners]
        return float(np.where(own > 0.0, np.abs(own / measured - 1.0), 1.0).max())

    @classmethod
    def of(cls, model: Model, measurement: Measurement) -> QuasiModes:
        """Return the used modes expanded by rotating the model's own shapes.

        Arguments:
            model: the current estimate; its mass is the one the shapes are orthonormal with.
            measurement: the used modes.

        Raises:
            StrategyFailure: when a measured mode has no partner in the model.
            NotApplicable: when there are fewer complete sensors than modes.

        Source: Ahmadian, Gladwell & Ismail (1997), equations (16)-(17).

        Examples:
            >>> quasi = update.QuasiModes.of(model, measurement)
            >>> np.allclose(quasi.shapes.T @ model.mass @ quasi.shapes, np.eye(3))
            True
        """
        rows = find_measured_rows(measurement.shapes)
        modes, partners = pair_modes_of(model, measurement)
        full = modes.shapes[:, partners]
        at_sensors = (model.observe(measurement.sensors) @ full)[rows]
        shapes, _ = expand_by_rotation(measurement.shapes[rows], at_sensors, full)
        return cls(shapes, measurement.eigenvalues, modes.shapes[:, modes.rigid], modes, partners)


def pair_modes_of(model: Model, measurement: Measurement) -> tuple[Modes, IntArray]:
    """Return enough modes of a model and the index of every measured mode's partner.

    Raises:
        StrategyFailure: when a measured mode has no partner in the model.
    """
    modes, partner = partners_of(model, measurement)
    lost = [n for n, p in zip(measurement.numbers, partner, strict=True) if p < 0]
    if lost:
        raise StrategyFailure(f"no mode of the model matches measured mode {lost[0]}")
    return modes, partner


Expansion = Literal["rotation", "force"]
Frequencies = Literal["measured", "nominal"]


@dataclass(frozen=True)
class WantedModes:
    """What the equations shall hold for, at any current estimate.

    Arguments:
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
        quasi = QuasiModes.of(self.nominal if forced else current, self.measurement)
        own = quasi
        if self.frequencies == "nominal" and not forced:
            own = QuasiModes.of(self.nominal, self.measurement)
        if forced:
            quasi = replace(quasi, shapes=self._forced())
        if self.frequencies == "nominal":
            quasi = replace(quasi, eigenvalues=own.modes.eigenvalues[own.partners])
        return quasi

    def _forced(self) -> FloatArray:
        """Return shapes of the smallest force residual, mass-normalised, (n, m)."""
        model, measured = self.nominal, self.measurement
        if model.size > DENSE_LIMIT:
            raise NotApplicable(
                f"expansion by forces is for {DENSE_LIMIT} dofs at most, the model has {model.size}"
            )
        rows = find_measured_rows(measured.shapes)
        sensors = sp.csr_array(model.observe(measured.sensors))[rows]
        shapes = expand_by_dynamics(model, sensors, measured.shapes[rows], measured.eigenvalues)
        return model.mass_normalised(shapes)
