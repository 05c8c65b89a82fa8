"""Damage: one element of a member has lost part of its stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    ElementOperator,
    FrameEffect,
    ModelPlaces,
    Parameter,
    Places,
    Size,
    Term,
    once_for,
)
from femubench.fem import Factor, Frame

_LOSS = Parameter("loss", "", 0.3, lower=0.0, upper=0.95, one_sided=True, wording="share")


class LocalStiffnessLoss(FrameEffect):
    """Take a fraction of EA, EI, GJ and GA from exactly one element."""

    name: ClassVar[str] = "local-stiffness-loss"
    summary: ClassVar[str] = "a member is damaged in one place"
    sizes: ClassVar[Sequence[Size]] = (Size(0.10, 0.70),)

    def places(self, model: Model) -> Sequence[str]:
        """Return every element."""
        return () if model.structure is None else Places(model.structure.frame).elements()

    def finer(self, model: Model, place: str) -> Sequence[str]:
        """Return the halves of the element: damage ends where it likes, not at a node."""
        return Places.halves(place)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the fraction that is lost."""
        return (_LOSS,)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the weaker element."""
        loss = (Factor("E", (place,), 1.0 - values[0]),) if values[0] else ()
        return replace(frame, factors=frame.factors + loss)

    def in_half(self, values: Sequence[float]) -> Sequence[float]:
        """Return the loss in half an element that is as flexible as a loss in the whole.

        1 / (1 - whole) = (1 + 1 / (1 - half)) / 2; twice the loss while it is small.
        """
        return (2.0 * values[0] / (1.0 + values[0]),)

    def change(self, model: Model, place: str) -> Change:
        """Return the stiffness of the element with a minus sign."""
        if not Places.halves(place):
            return self.tabulate(model, place)
        structure = model.frame_structure
        rows = ModelPlaces(model).elements(place)
        whole = once_for(
            model, "element stiffness", lambda: structure.properties.stiffness_matrices()
        )
        lost = ElementOperator(structure, rows, whole, share=-np.ones(len(rows)), kind=rows)
        return Change.proportional(Term("stiffness", lost))
