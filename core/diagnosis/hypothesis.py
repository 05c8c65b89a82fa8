"""A hypothesis: one effect at one place, ready to be tried on modal data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from femubench.core.diagnosis.change import Change
from femubench.core.diagnosis.effect import EffectParameter
from femubench.core.diagnosis.tabulate import tabulated_change
from femubench.core.model import Model
from femubench.core.plugin.roles import Effect
from femubench.core.typing import FloatArray

_SLOPE_STEP = 1e-5


@dataclass(frozen=True)
class Hypothesis:
    """An effect at a place.

    Arguments:
        effect: the effect itself.
        place: where it sits.
        parameters: what it takes there.
        change: what it does to the matrices.
        places: number of places that the effect could sit at.
    """

    effect: Effect
    place: str
    parameters: tuple[EffectParameter, ...]
    change: Change
    places: int

    @property
    def name(self) -> str:
        """Return the slug of the effect."""
        return self.effect.name

    @property
    def textbook(self) -> FloatArray | None:
        """Return the coordinates of the textbook values, None where one has none."""
        values = [p.textbook for p in self.parameters]
        if any(value is None for value in values):
            return None
        pairs = zip(self.parameters, values, strict=True)
        return np.array([p.coordinate(v) for p, v in pairs if v is not None])

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and the highest coordinates, (k,) each."""
        low, high = np.array([p.range for p in self.parameters]).T
        return low, high

    @property
    def one_sided(self) -> FloatArray:
        """Tell which coordinates cannot be negative, as 0 or 1, (k,)."""
        return np.array([p.one_sided for p in self.parameters], dtype=float)

    def values(self, x: FloatArray) -> FloatArray:
        """Return parameter values of coordinates, (g, k) both."""
        columns = [p.value(x[:, i]) for i, p in enumerate(self.parameters)]
        return np.column_stack(columns)

    def factors(self, x: FloatArray) -> FloatArray:
        """Return the factors of the terms, (g, n_terms), of coordinates, (g, k)."""
        return np.asarray(self.change.coefficients(self.values(x)))

    def slopes(self, x: FloatArray) -> FloatArray:
        """Return d factors / d x at one point, (k, n_terms); one-sided where a bound is near."""
        low, high = self.bounds
        step = _SLOPE_STEP * np.eye(len(x))
        up, down = np.minimum(x + step, high), np.maximum(x - step, low)
        width = (up - down).diagonal()
        return np.asarray((self.factors(up) - self.factors(down)) / width[:, None])


def hypotheses_of(model: Model, effects: Iterable[Effect]) -> tuple[Hypothesis, ...]:
    """Return every effect at every place where it may sit in a model."""
    found = []
    for effect in effects:
        places = tuple(dict.fromkeys(effect.places(model)))
        for place in places:
            parameters: Sequence[EffectParameter] = tuple(effect.parameters(model, place))
            change = getattr(effect, "change", None)
            made = (
                change(model, place)
                if callable(change)
                else tabulated_change(effect, model, place, parameters)
            )
            found.append(Hypothesis(effect, place, tuple(parameters), made, len(places)))
    return tuple(found)
