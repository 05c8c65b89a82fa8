"""Standard deviations that are stated too large or too small throughout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from femubench import Measurement, Model
from femubench.effect import Parameter, Suspect

_FEWEST = 4
_QUANTITIES = {"frequencies": "frequency_std", "shapes": "shape_std"}


class SigmaMisstated:
    """The deviations of all frequencies, or of all shapes, are stated wrongly by one factor."""

    name: ClassVar[str] = "sigma-misstated"
    side: ClassVar[Literal["data"]] = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return frequencies and shapes, where there are some and somebody has stated them."""
        if measurement.assumed:
            return []
        factor = Parameter("stated over true", "", 1.5, neutral=1.0, lower=0.2, upper=8.0)
        counts = {
            "frequencies": len(measurement),
            "shapes": int(np.isfinite(measurement.shapes).sum()),
        }
        return [
            Suspect(
                "data",
                f"the deviations of the {quantity} are stated wrongly",
                partial(self._corrected, _QUANTITIES[quantity]),
                replace(factor, name=f"{quantity}, stated over true"),
            )
            for quantity, count in counts.items()
            if count >= _FEWEST
        ]

    def _corrected(
        self, field: str, model: Model, measurement: Measurement, value: float
    ) -> tuple[Model, Measurement]:
        std = getattr(measurement, field) / value
        return model, replace(measurement, **{field: std})
