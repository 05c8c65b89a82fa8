"""A mass that every joint of a type carries: weld metal, gussets, bolts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from femubench import Model
from femubench.effect import Change, FrameEffect, ModelPlaces, Parameter, Places, Site, Size
from femubench.fem import Frame, Place, PointMass

_SHARE = 0.02  # of the structure's mass, over all joints


class JointMass(FrameEffect):
    """Put the same point mass at every joint of a type; at a single joint it is `added-mass`."""

    name: ClassVar[str] = "joint-mass"
    summary: ClassVar[str] = "the joints carry mass"
    sizes: ClassVar[Sequence[Size]] = (Size(0.005, 0.02, Site.mass),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the joint types that two joints at least are of."""
        return () if model.structure is None else Places(model.structure.frame).types()

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the mass at each joint."""
        scale = _SHARE * model.total_mass / len(model.frame_structure.frame.joints)
        return (Parameter("mass", "kg", scale, scaling="exponential", one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the masses."""
        if not values[0]:
            return frame
        masses = tuple(PointMass(at, values[0]) for at in _points(frame, place))
        return replace(frame, masses=frame.masses + masses)

    def change(self, model: Model, place: str) -> Change:
        """Return the mass matrix of 1 kg at each joint."""
        return Change.proportional(
            ModelPlaces(model).mass_term(_points(model.frame_structure.frame, place))
        )


def _points(frame: Frame, place: str) -> tuple[Place, ...]:
    return tuple(Place(joint=name) for name in Places(frame).joints_of(place))
