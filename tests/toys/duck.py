"""A strategy and an effect that inherit nothing, written from the roles alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femubench import Measurement, Model, UpdateResult, hookimpl, solve_modes
from femubench.core import roles
from femubench.core.typing import Wording


class Duck:
    """Scale the stiffness by the first frequency."""

    name = "duck"
    citation = "Nobody (2026), equation (1)"

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with all of its stiffness multiplied by one factor."""
        first = solve_modes(model).elastic.eigenvalues[0]
        factor = float(measurement.eigenvalues[0] / first)
        return UpdateResult(replace(model, stiffness=factor * model.stiffness), 1)


@dataclass(frozen=True)
class Size:
    """One number of `Softer`, relative to what was drawn."""

    name: str = "softer"
    unit: str = ""
    scale: float = 0.1
    neutral: float = 0.0
    lower: float = -0.9
    upper: float = 1.0
    scaling: roles.Scaling = "linear"
    one_sided: bool = False
    textbook: float | None = None
    wording: Wording = "change"
    range: tuple[float, float] = (-6.0, 6.0)

    def value(self, x: float) -> float:
        """Return the value at a coordinate."""
        return self.scale * x

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value."""
        return value / self.scale


class Softer:
    """All of the structure is softer than drawn."""

    name = "softer"
    summary = "the structure is softer"

    def places(self, model: Model) -> Sequence[str]:
        """Return the one place."""
        return ["all"]

    def parameters(self, model: Model, place: str) -> Sequence[Size]:
        """Return the one number."""
        return [Size()]

    def extend(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with its stiffness scaled."""
        return replace(model, stiffness=(1.0 + values[0]) * model.stiffness)


STRATEGY: roles.StrategyRole = Duck()
EFFECT: roles.Effect = Softer()


@hookimpl
def femubench_strategies() -> list[type[Duck]]:
    """Offer the class."""
    return [Duck]
