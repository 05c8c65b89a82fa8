"""The textbook model: the drawn one with what handbooks give, and nothing measured."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

from femubench.core.errors import NotApplicable
from femubench.core.fem.model import Model
from femubench.core.roles import Effect


def textbook_values(effect: Effect, model: Model) -> dict[str, tuple[float, ...]]:
    """Return by place the values that an effect gives without any fit.

    Arguments:
        effect: any; one that has to be fitted, or says `handbook = False`, gives none.
        model: as drawn.

    Examples:
        >>> effect.textbook_values(torsion, model)
        {'all': (-0.2579...,)}
    """
    found: dict[str, tuple[float, ...]] = {}
    if not getattr(effect, "handbook", True):
        return found
    for place in effect.places(model):
        values = [item.textbook for item in effect.parameters(model, place)]
        if values and all(value is not None for value in values):
            found[place] = tuple(float(value) for value in values if value is not None)
    return found


def textbook_model(model: Model, effects: Iterable[Effect]) -> Model:
    """Return a model with all textbook values in it, such as Bredt's torsion constant and shear.

    The mesh and the supports stay as drawn.

    Arguments:
        model: as drawn, a frame.
        effects: whose textbook values count, in this order.

    Raises:
        NotApplicable: when the model came as matrices, which no handbook knows.

    Examples:
        >>> repaired = effect.textbook_model(model, [torsion])
        >>> repaired.size == model.size
        True
    """
    if model.structure is None:
        raise NotApplicable("the model came as matrices; expected a frame")
    for effect in effects:
        for place, values in textbook_values(effect, model).items():
            model = cast(Model, effect.extend(model, place, values))
    return model
