"""Two modes of which each has the other's frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import ClassVar, Literal

import numpy as np

from femubench import Measurement, Model
from femubench.effect import Suspect


class ModesSwapped:
    """Two modes with shapes have each other's frequency, deviation and damping."""

    name: ClassVar[str] = "modes-swapped"
    side: ClassVar[Literal["data"]] = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return every pair of modes of which one has a shape at least."""
        shaped = np.asarray(np.isfinite(measurement.shapes).any(axis=0))
        order = np.argsort(measurement.frequencies, kind="stable")
        return [
            Suspect(
                f"mode:{one}+{two}",
                f"modes {one} and {two} have each other's frequencies",
                partial(self._corrected, (one, two)),
            )
            for i, j in combinations(order, 2)
            if shaped[i] or shaped[j]
            for one, two in [sorted((measurement.numbers[i], measurement.numbers[j]))]
        ]

    def _corrected(
        self, numbers: tuple[int, int], model: Model, measurement: Measurement, value: float
    ) -> tuple[Model, Measurement]:
        order = np.arange(len(measurement))
        i, j = (measurement.numbers.index(number) for number in numbers)
        order[[i, j]] = j, i
        correlation = measurement.frequency_correlation
        return model, replace(
            measurement,
            frequencies=measurement.frequencies[order],
            frequency_std=measurement.frequency_std[order],
            damping=measurement.damping[order],
            frequency_correlation=None if correlation is None else correlation[order][:, order],
        )
