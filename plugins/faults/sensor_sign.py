"""A sensor that was mounted the other way round, or whose cable is."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import ClassVar, Literal

from femubench import Measurement, Model
from femubench.effect import Corrected, Suspect
from femubench.plugins.faults.readings import multiplied, read_sensors


class SensorSign:
    """One sensor reads with the wrong sign in all modes."""

    name: ClassVar[str] = "sensor-sign"
    side: ClassVar[Literal["data"]] = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return every sensor that was read."""
        return [
            Suspect(
                f"sensor:{label}",
                f"sensor {label} reads with the wrong sign",
                partial(self._corrected, label),
            )
            for label in read_sensors(measurement)
        ]

    def _corrected(
        self, label: str, model: Model, measurement: Measurement, value: float
    ) -> Corrected:
        return model, multiplied(measurement, label, -1.0)
