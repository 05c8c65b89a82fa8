"""What a plain look compares: the modes of the model and their measured partners."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame
from femubench.core.fem.model import Model
from femubench.core.fit.mesh_error import mesh_bias
from femubench.core.inference.settings import settings
from femubench.core.modal.eigen import Modes
from femubench.core.modal.frequency_changes import elastic_modes, frequency_changes
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import Pairing, pair_measured
from femubench.core.schema.diagnosis import LookWarning
from femubench.core.typing import FloatArray

Changes = tuple[tuple[int, float], ...]


@dataclass(frozen=True)
class Seen:
    """A model and its measurement."""

    model: Model
    measurement: Measurement

    @cached_property
    def modes(self) -> Modes:
        """Return the elastic modes, those of zero frequency left out, a margin included."""
        # Half as many spare ones again, so that a pair may cross the end of the list.
        spare = settings.spare_modes + settings.spare_modes // 2
        return elastic_modes(self.model, 2 * len(self.measurement) + spare)

    @cached_property
    def readings(self) -> FloatArray:
        """Return the modes at the sensors, (n_sensors, p)."""
        return np.asarray(self.model.observe(self.measurement.sensors) @ self.modes.shapes)

    @cached_property
    def pairing(self) -> Pairing:
        """Return the partners of the measured modes."""
        return pair_measured(self.measurement, self.modes, self.readings)

    @cached_property
    def count(self) -> int:
        """Return how many elastic modes lie in the range of the measured ones."""
        highest = int(self.pairing.index.max(initial=-1)) + 1
        wanted = highest if highest > 0 else len(self.measurement)
        return min(wanted, len(self.modes))

    @cached_property
    def bias(self) -> FloatArray:
        """Return the relative correction of the model's frequencies for its mesh, (p,)."""
        bias = np.zeros(len(self.modes))
        found = mesh_bias(self.model, int(self.pairing.index.max(initial=-1)) + 1, self.modes)
        if found is not None:
            bias[: len(found)] = found
        return bias

    @property
    def shifts(self) -> FloatArray:
        """Return f_measured / f_model - 1 of every pair, nan without a partner, (m,)."""
        index = self.pairing.index
        frequency = self.modes.natural_frequencies * (1.0 + self.bias)
        ratio = self.measurement.frequencies / frequency[index] - 1.0
        return np.where(index >= 0, ratio, np.nan)

    @property
    def eigenvalues(self) -> FloatArray:
        """Return measured eigenvalues as this mesh would show them in rad^2/s^2, (m,)."""
        index = self.pairing.index
        bias = np.where(index >= 0, self.bias[index], 0.0)
        return np.asarray(self.measurement.eigenvalues / np.square(1.0 + bias))

    @cached_property
    def deviations(self) -> FloatArray:
        """Return the relative deviation of the measured partner, infinite without one, (p,)."""
        result = np.full(len(self.modes), np.inf)
        std = self.measurement.frequency_std / self.measurement.frequencies
        known = (self.pairing.index >= 0) & np.isfinite(std) & (std > 0.0)
        result[self.pairing.index[known]] = std[known]
        return result

    def changes(self, frame: Frame) -> FloatArray | None:
        """Return the relative changes of the first `count` frequencies in another frame, (count,).

        None where the frame cannot be built or solved, or has other dofs.
        """
        structure = self.model.frame_structure
        try:
            other = Model.of(structure.rebuilt(frame))
            if other.size != self.model.size:
                return None
            return frequency_changes(self.model, self.modes, other, self.count)
        except ModelError:
            return None

    def notable(self, effect: str, what: str, changes: FloatArray | None) -> list[LookWarning]:
        """Return a warning about the whole structure where some mode changes notably; else none.

        Arguments:
            effect: slug of what the model lacks.
            what: begin of the sentence, which goes on with the largest change.
            changes: relative changes of the frequencies with the effect; None where not known.
        """
        least, deviations = settings.notable_physics, settings.notable_deviations
        if changes is None or not self.exceeds(changes, least, deviations):
            return []
        worst = int(np.abs(changes).argmax())
        said = f"{what}: it changes mode {worst + 1} by {100.0 * changes[worst]:+.2g} %."
        return [self.warning(effect, said, changes)]

    def warning(
        self, effect: str, what: str, changes: FloatArray | None, where: str = "all"
    ) -> LookWarning:
        """Return a warning.

        Arguments:
            effect: slug of what the model lacks.
            what: one sentence.
            changes: relative changes of the frequencies with the effect; None where not known.
            where: members, by comma, or ``all``.
        """
        return LookWarning(what, where, effect, () if changes is None else percent(changes))

    def exceeds(self, changes: FloatArray, least: float, deviations: float) -> bool:
        """Tell whether any mode changes by more than a share, or than so many deviations."""
        limit = np.minimum(least, deviations * self.deviations[: len(changes)])
        return bool((np.abs(changes) > limit).any())


def percent(changes: FloatArray) -> Changes:
    """Return relative changes as (elastic mode number from 1, percent)."""
    return tuple((k + 1, 100.0 * float(change)) for k, change in enumerate(changes))
