"""A spring to ground: a suspension, a cable, a table that the structure touches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    FrameEffect,
    ModelPlaces,
    Parameter,
    Places,
    RowOperator,
    Site,
    Size,
    Term,
    elastic_band,
)
from femubench.fem import Frame, GroundSpring

_SHARE = 0.01  # of the squared lowest elastic frequency


class GroundingSpring(FrameEffect):
    """Hold a point in one global direction; out of plane there is but one, which goes unsaid.

    A spring turns a rigid-body mode elastic and stiffens the others.
    """

    name: ClassVar[str] = "grounding-spring"
    summary: ClassVar[str] = "a spring holds the structure to ground"
    sizes: ClassVar[Sequence[Size]] = (Size(0.002, 0.2, Site.modal_stiffness, log=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the points, or nodes, in each direction that they can move in."""
        return ModelPlaces(model).directed(ModelPlaces(model).points())

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the stiffness; at its scale the lowest frequency rises by about a percent."""
        scale = _SHARE * model.total_mass * (2.0 * np.pi * float(elastic_band(model)[0])) ** 2
        return (Parameter("stiffness", "N/m", scale, scaling="exponential", one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the spring."""
        if not values[0]:
            return frame
        at, direction = Places(frame).directed_point(place)
        return replace(frame, springs=(*frame.springs, GroundSpring(at, direction, values[0])))

    def change(self, model: Model, place: str) -> Change:
        """Return the stiffness matrix of 1 N/m."""
        at, direction = ModelPlaces(model).directed_point(place)
        row = ModelPlaces(model).translations(at, [direction])
        return Change.proportional(Term("stiffness", RowOperator(row, np.eye(1))))
