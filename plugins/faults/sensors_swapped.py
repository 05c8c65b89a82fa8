"""Two sensors whose cables, or labels, were exchanged."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import combinations
from typing import ClassVar, Literal

from femubench import Measurement, Model
from femubench.effect import Corrected, Suspect
from femubench.plugins.faults.readings import read_sensors, swapped


class SensorsSwapped:
    """Two sensors have each other's readings in all modes."""

    name: ClassVar[str] = "sensors-swapped"
    side: ClassVar[Literal["data"]] = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return every pair of sensors that were read."""
        return [
            Suspect(
                f"sensor:{one}+{two}",
                f"sensors {one} and {two} are swapped",
                partial(self._corrected, (one, two)),
            )
            for one, two in combinations(read_sensors(measurement), 2)
        ]

    def _corrected(
        self,
        labels: tuple[str, str],
        model: Model,
        measurement: Measurement,
        value: float,
    ) -> Corrected:
        return model, swapped(measurement, labels)
