"""The base of strategies that look for factors all over their bounds by costs alone."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femubench import Measurement, Model, UpdateResult
from femubench.fem import FloatArray
from femubench.update import ModalSpace, ParametricStrategy

Cost = Callable[[FloatArray], float]
Found = tuple[FloatArray, float, list[dict[str, float]]]

_START = 3  # solutions: the shapes, the nominal model, one more


@dataclass(frozen=True)
class GlobalSearch(ParametricStrategy):
    """Base class of searches for the least misfit of frequencies and MAC: override `search`.

    Unknowns are the logarithms of the factors, the cost the sum of squares of relative frequency
    errors and weighted 1 - MAC. Nothing but costs is used, no derivative. Modes are those of a
    reduced basis of the nominal model.

    Arguments:
        changes, max_solves: as of `ParametricStrategy`.
        evaluations: costs at most, an eigenvalue solution each; a generation is finished.
        largest: bound of a factor; the least is its inverse.
        shape_weight: of a MAC of 0 against a frequency that is 100 % off; 0 for frequencies alone.
        basis: shapes in the reduced basis.
    """

    evaluations: int = 1000
    largest: float = 3.0
    shape_weight: float = 0.1
    basis: int = 40

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the best factors that were met.

        Raises:
            NotApplicable: when the model has no such parameters.
            StrategyFailure: when no mode of the model looks like any measured mode.
        """
        parts = self.parameterise(model)
        weight, most = self.shape_weight, self.max_solves and max(self.max_solves, _START)
        space = ModalSpace.of(
            parts, measurement, shape_weight=weight, size=self.basis, max_solves=most
        )

        def cost(x: FloatArray) -> float:
            return space.fit(x, slopes=False).cost if space.solves.left else np.inf

        x, least, history = self.search(cost, *space.bounds(float(np.log(self.largest))), rng)
        return self.result(parts, x, history, cost=least)

    @abstractmethod
    def search(
        self, cost: Cost, low: FloatArray, high: FloatArray, rng: np.random.Generator
    ) -> Found:
        """Return the best coordinates, (p,), their cost, and an entry of history a generation."""
