"""A sensor with a wrong sensitivity."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import ClassVar, Literal

from femubench import Measurement, Model
from femubench.effect import Corrected, Parameter, Suspect
from femubench.plugins.faults.readings import multiplied, read_sensors

_GAIN = Parameter("gain", "", 1.0, neutral=1.0, lower=0.2, upper=5.0)


class SensorGain:
    """One sensor reads too much or too little, by the same factor in all modes."""

    name: ClassVar[str] = "sensor-gain"
    side: ClassVar[Literal["data"]] = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return every sensor that was read."""
        return [
            Suspect(
                f"sensor:{label}",
                f"sensor {label} reads with a wrong gain",
                partial(self._corrected, label),
                _GAIN,
            )
            for label in read_sensors(measurement)
        ]

    def _corrected(
        self, label: str, model: Model, measurement: Measurement, value: float
    ) -> Corrected:
        return model, multiplied(measurement, label, 1.0 / value)
