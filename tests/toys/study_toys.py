"""A strategy with options that tells what it was given, in a module that workers can import."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, StrategyFailure, UpdateResult

BROKEN = 9.0  # the factor at which it fails


@dataclass(frozen=True)
class Spy:
    """Multiply the stiffness by a factor, whatever was measured.

    Arguments:
        factor: on the stiffness.
        loud: nothing depends on it.
    """

    factor: float = 1.0
    loud: bool = False
    name: ClassVar[str] = "spy"
    citation: ClassVar[str] = "Nobody (2026), equation (1)"

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model, and in the diagnostics what the data were."""
        if self.factor == BROKEN:
            raise StrategyFailure("the factor is 9")
        seen = {
            "sensors": float(len(measurement.sensors)),
            "rows": float(len(measurement.shapes)),
            "frequency": float(measurement.frequencies[0]),
            "frequency_std": float(measurement.frequency_std[0]),
            "shape_std": float(np.nanmax(measurement.shape_std[:, 0])),
        }
        changed = replace(model, stiffness=self.factor * model.stiffness)
        return UpdateResult(changed, 1, (), (), seen)
