"""A section that twists when it bends: an open or skewed wall, fibres off the axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from femubench import Model
from femubench.effect import (
    Change,
    ElementOperator,
    FrameEffect,
    ModelPlaces,
    Parameter,
    Size,
    Term,
)
from femubench.fem import Coupling, Frame

_BOUND = 0.8


class BendingTorsionCoupling(FrameEffect):
    """Couple bending and twist of a member; in plane there is no twist to couple."""

    name: ClassVar[str] = "bending-torsion-coupling"
    summary: ClassVar[str] = "a member twists when it bends"
    innate: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.30, signed=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the members with a torsional rigidity."""
        if model.structure is None or model.structure.frame.plane == "in-plane":
            return ()
        return [member.name for member in model.structure.frame.members if member.section.J > 0.0]

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return c of the energy 2 c sqrt(EI GJ) k t / 2; beyond 1 a section has no stiffness."""
        return (Parameter("coefficient", "", 0.15, lower=-_BOUND, upper=_BOUND),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the coupling."""
        if not values[0]:
            return frame
        return replace(frame, couplings=(*frame.couplings, Coupling(place, values[0])))

    def change(self, model: Model, place: str) -> Change:
        """Return what a coefficient of 1 adds to the elements of the member."""
        structure = model.frame_structure
        elements = ModelPlaces(model).elements(place)
        blocks = structure.properties.take(elements).coupling_matrices()
        return Change.proportional(Term("stiffness", ElementOperator(structure, elements, blocks)))
