"""A frequency that was read or typed wrongly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from femubench import Measurement, Model
from femubench.effect import Parameter, Suspect

_ERROR = 0.05  # a priori, relative
_LEAST = -0.5


class FrequencyOutlier:
    """One frequency is wrong, by some percent more likely than by more."""

    name: ClassVar[str] = "frequency-outlier"
    side: ClassVar[Literal["data"]] = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return every measured mode."""
        error = Parameter("error of the frequency", "", _ERROR, lower=_LEAST, wording="change")
        return [
            Suspect(
                f"mode:{number}",
                f"the frequency of mode {number} is wrong",
                partial(self._corrected, number),
                error,
            )
            for number in measurement.numbers
        ]

    def _corrected(
        self, number: int, model: Model, measurement: Measurement, value: float
    ) -> tuple[Model, Measurement]:
        wrong = np.array(measurement.numbers) == number
        frequencies = measurement.frequencies / np.where(wrong, 1.0 + value, 1.0)
        return model, replace(measurement, frequencies=frequencies)
