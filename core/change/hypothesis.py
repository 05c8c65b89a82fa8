"""A hypothesis: one effect at one place, ready to be tried on modal data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product

import numpy as np
import scipy.linalg as la

from femubench.core.change.change import Change, parameter_of
from femubench.core.change.tabulated import change_of, place_change
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import (
    enough_modes,
    keep_last,
    loose_motions,
    modes_of,
    zero_tolerance,
)
from femubench.core.roles import Effect, EffectParameter
from femubench.core.typing import FloatArray

_SINGLE = (0.12, 0.5, 1.3, 2.6, 4.6)
_DOUBLE = (0.03, 0.2, 0.7, 1.8)
_OSCILLATOR = (0.4, 1.2, 2.2)
_STIFF = 0.01
_TYPICAL = 0.6
_NOTHING = 1e-12


@dataclass(frozen=True, repr=False)
class Hypothesis:
    """An effect at a place.

    Arguments:
        change: what it does there, and its parameters.
        places: number of places that the effect could sit at.
    """

    effect: Effect
    change: Change
    places: int

    def __repr__(self) -> str:
        return f"{self.effect.name} at {self.place}"

    @property
    def place(self) -> str:
        """Return where it sits."""
        return self.change.places[0]

    @property
    def parameters(self) -> tuple[EffectParameter, ...]:
        """Return what it takes there."""
        return self.change.parameters

    @property
    def name(self) -> str:
        """Return the slug that it is weighed under: its own, or that of what it tells more of."""
        return self.effect.name if self.stated is None else self.stated

    @property
    def stated(self) -> str | None:
        """Return the slug of the effect that it tells more of, None for an effect by itself."""
        return getattr(self.effect, "refines", None)

    @property
    def cause(self) -> tuple[str, str, int]:
        """Return what it is the same by in other explanations: effect, place, number of values."""
        return self.effect.name, self.place, len(self.parameters)

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
        return self.change.bounds

    @cached_property
    def one_sided(self) -> FloatArray:
        """Tell which coordinates cannot be negative, as 0 or 1, (k,)."""
        return np.array([p.one_sided for p in self.parameters], dtype=float)

    @cached_property
    def still(self) -> bool:
        """Tell whether the model is as it is at x = 0; rigid joints still have their arms."""
        return bool(np.all(np.abs(self.factors(np.zeros((1, len(self.parameters))))) < _NOTHING))

    @cached_property
    def grid(self) -> FloatArray:
        """Return the coordinates at which it is tried first, (g, k)."""
        parameters = self.parameters
        if self.change.extra and len(parameters) == 2:
            first = [v for v in _OSCILLATOR if v <= parameters[0].range[1]]
            second = np.linspace(*parameters[1].range, 14)[1:]
            return np.array(list(product(first, second)))
        sizes = _SINGLE if len(parameters) == 1 else _DOUBLE
        return combine_points([_points(parameter, sizes) for parameter in parameters])

    @cached_property
    def grid_factors(self) -> FloatArray:
        """Return the factors of the terms on the grid, (g, n_terms)."""
        return self.factors(self.grid)

    @cached_property
    def typical_factors(self) -> FloatArray:
        """Return the factors of the terms at a typical magnitude, (n_terms,)."""
        low, high = self.bounds
        return np.asarray(self.factors(np.clip(np.full(len(low), _TYPICAL), low, high)[None])[0])

    def values(self, x: FloatArray) -> FloatArray:
        """Return parameter values of coordinates, (g, k) both."""
        return self.change.values(x)

    def factors(self, x: FloatArray) -> FloatArray:
        """Return the factors of the terms, (g, n_terms), of coordinates, (g, k)."""
        return self.change.factors(x)

    def slopes(self, x: FloatArray) -> FloatArray:
        """Return d factors / d x at one point, (k, n_terms); one-sided where a bound is near."""
        return self.change.slopes(x)


def combine_points(points: Sequence[Sequence[float]]) -> FloatArray:
    """Return points of one parameter after the other in all combinations, (g, k).

    From three parameters on, each alone, the others in the middle of theirs: as many as there are.
    """
    if len(points) < 3:
        return np.array(list(product(*points)))
    middle = np.array([own[len(own) // 2] for own in points])
    rows = [[*middle[:i], x, *middle[i + 1 :]] for i, own in enumerate(points) for x in own]
    return np.unique(rows, axis=0)


def _points(parameter: EffectParameter, sizes: Sequence[float]) -> list[float]:
    low, high = parameter.range
    if parameter.scaling == "compliance":
        # Its arm stays rigid however stiff the spring: x = 0 is no model without the effect.
        sizes = (_STIFF, *sizes)
    if parameter.scaling == "factor" and parameter.scale > 1.0:
        # At a step by a factor of three and more modes change places.
        steps = np.arange(2 * len(sizes) - 1)
        sizes = np.interp(steps, steps[::2], sizes).tolist()
    wanted = list(sizes) if parameter.one_sided else [-s for s in reversed(sizes)] + list(sizes)
    inside = [x for x in wanted if low <= x <= high]
    return inside or [0.5 * (low + high)]


def hypotheses_of(
    model: Model, effects: Iterable[Effect], damage: float = 0.0
) -> tuple[Hypothesis, ...]:
    """Return every effect at every place where it may sit in a model.

    Of a structure that is known to hang free, nothing that holds it to ground is a candidate.

    Arguments:
        damage: least prior deviation of ln(factor) of a relative change of a part.
    """
    return tuple(h for h, held in _offered(model, effects, damage) if not held)


def holding_to_ground(
    model: Model, effects: Iterable[Effect], damage: float = 0.0
) -> tuple[Hypothesis, ...]:
    """Return what `hypotheses_of` leaves out, since it would hold a model that hangs free."""
    return tuple(h for h, held in _offered(model, effects, damage) if held)


def by_themselves(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return the effects that tell no more of another one of them: those are tried after it."""
    known = tuple(effects)
    names = {effect.name for effect in known}
    return tuple(e for e in known if getattr(e, "refines", None) not in names)


def finer(hypothesis: Hypothesis, model: Model, effects: Iterable[Effect]) -> list[Hypothesis]:
    """Return what tells more of an effect where it sits.

    It is the effect itself with further words for the place, by its ``finer(model, place)``, or
    another one that ``refines`` it and may sit there. As likely as not there is no more to tell.
    """
    own, place, places = hypothesis.effect, hypothesis.place, 2 * hypothesis.places
    words = getattr(own, "finer", None)
    found = [(own, word) for word in (words(model, place) if callable(words) else ())]
    others = (e for e in effects if getattr(e, "refines", None) == own.name)
    found += [(e, place) for e in others if place in e.places(model)]
    return [hypothesis_at(model, effect, word, places) for effect, word in found]


def _offered(
    model: Model, effects: Iterable[Effect], damage: float
) -> list[tuple[Hypothesis, bool]]:
    """Return every effect at every place, and whether it holds what is known to hang free."""
    found: list[tuple[Hypothesis, bool]] = []
    for effect in effects:
        # One of a name: every look for plugins makes effects anew.
        key, make = ("hypotheses", effect.name, damage), partial(_placed, model, effect, damage)
        found += keep_last(model, key, effect, make)
    return found


def _placed(model: Model, effect: Effect, damage: float) -> list[tuple[Hypothesis, bool]]:
    """Return the hypotheses of an effect, each with whether it holds what hangs free."""
    each = {p: tuple(effect.parameters(model, p)) for p in dict.fromkeys(effect.places(model))}
    if damage:  # what is true of the whole is a matter of the material, or of the weather
        parts = [p for p in each if p != "all"]
        each |= {p: tuple(parameter_of(q).widen(damage) for q in each[p]) for p in parts}
    # A rod has no bending stiffness by which a rotational spring could be measured.
    places = {p: own for p, own in each.items() if all(one.scale > 0.0 for one in own)}
    own = [
        Hypothesis(effect, place_change(effect, model, p, own), len(places))
        for p, own in places.items()
    ]
    held = [model.free and _holds(model, one) for one in own]
    count = held.count(False)
    pairs = zip(own, held, strict=True)
    return [(replace(one, places=count or len(own)), h) for one, h in pairs]


def _holds(model: Model, hypothesis: Hypothesis) -> bool:
    """Tell whether an effect makes it cost energy to move a model as a rigid body."""
    rigid, least = loose_motions(model), zero_tolerance(modes_of(model, enough_modes(model, 1)))
    extra, count = hypothesis.change.extra, rigid.shape[1]
    vectors = np.asarray(la.block_diag(rigid, np.eye(extra))) if extra else rigid
    energy = np.zeros((count + extra, count + extra))
    for term, factor in zip(hypothesis.change.terms, hypothesis.typical_factors, strict=True):
        if term.matrix == "stiffness":
            energy += factor * term.operator.project(vectors)
    # Dofs of its own go along as they like.
    body, across = energy[:count, :count], energy[:count, count:]
    body = body - across @ np.linalg.pinv(energy[count:, count:]) @ across.T
    return bool(np.abs(body).max(initial=0.0) > least)


def hypothesis_at(model: Model, effect: Effect, place: str, places: int) -> Hypothesis:
    """Return an effect at one of so many places."""
    return Hypothesis(effect, change_of(effect, model, place), places)
