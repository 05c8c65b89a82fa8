"""A mass at one point that the model does not know of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from femubench import Model
from femubench.effect import Change, FrameEffect, ModelPlaces, Parameter, Places, Site, Size
from femubench.fem import Frame, PointMass

# Of the structure's mass: as much as there is to a joint, within these bounds. A fifth
# of a structure at one of a few points is beyond belief, a twentieth at one of a thousand.
_MOST, _LEAST = 0.03, 0.005


class AddedMass(FrameEffect):
    """Put a point mass on a joint, on a member or on a node of a model that came as matrices."""

    name: ClassVar[str] = "added-mass"
    summary: ClassVar[str] = "a point carries a mass"
    sizes: ClassVar[Sequence[Size]] = (Size(0.005, 0.08, Site.mass),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the points, or nodes, that can move."""
        places = ModelPlaces(model)
        return [at for at in places.points() if places.free(places.point(at))]

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the mass."""
        structure = model.structure
        points = ModelPlaces(model).points() if structure is None else structure.frame.joints
        scale = model.total_mass * min(max(1.0 / max(len(points), 1), _LEAST), _MOST)
        return (Parameter("mass", "kg", scale, one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the mass."""
        if not values[0]:
            return frame
        mass = PointMass(Places(frame).point(place), values[0])
        return replace(frame, masses=(*frame.masses, mass))

    def change(self, model: Model, place: str) -> Change:
        """Return the mass matrix of 1 kg at the point."""
        return Change.proportional(ModelPlaces(model).mass_term([ModelPlaces(model).point(place)]))
