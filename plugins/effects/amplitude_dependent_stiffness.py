"""Joints and clamps that slip when they are shaken harder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from femubench import Model
from femubench.effect import FrameEffect, Parameter
from femubench.fem import Frame


class AmplitudeDependentStiffness(FrameEffect):
    """Soften the structure at a second, higher level of excitation.

    One measurement at one level shows a stiffness and nothing of how it depends on the level: any
    softening is then another `youngs-modulus`. So the effect has no place here; `needs` says what
    a case would have to bring, and the advice of a diagnosis proposes it.

    Attributes:
        needs: ``levels``: measurements at two excitation levels at least.
    """

    name: ClassVar[str] = "amplitude-dependent-stiffness"
    summary: ClassVar[str] = "the stiffness falls with the amplitude"
    needs: ClassVar[str] = "levels"

    def places(self, model: Model) -> Sequence[str]:
        """Return nothing: a single level of excitation cannot show it."""
        return ()

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the relative loss of stiffness between the two levels."""
        return (Parameter("softening", "", 0.02, lower=0.0, upper=0.5, one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame at the higher level: E of every member lowered."""
        soft = 1.0 - values[0]
        members = (
            replace(m, material=replace(m.material, E=soft * m.material.E)) for m in frame.members
        )
        return replace(frame, members=tuple(members))
