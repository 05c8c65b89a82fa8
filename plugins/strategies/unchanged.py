"""The floor of every comparison: the nominal model as it is."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, Strategy, UpdateResult


class Unchanged(Strategy):
    """Hand back the nominal model."""

    name: ClassVar[str] = "unchanged"
    citation: ClassVar[str] = "no update: the nominal finite element model"
    baseline: ClassVar[bool] = True
    yardstick: ClassVar[str] = "the models that were given"
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes", "no-negative-eigenvalue"})

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model that was given."""
        return UpdateResult(model)
