"""Rotary inertia of the cross sections, which Euler and Bernoulli left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

from femubench import Model
from femubench.effect import FrameEffect, LookWarning, Parameter, Seen, Size
from femubench.fem import Frame


class RotaryInertia(FrameEffect):
    """Let a multiple of rho I take part; 1 is the textbook's (Rayleigh 1877, art. 162)."""

    name: ClassVar[str] = "rotary-inertia"
    summary: ClassVar[str] = "the cross sections have rotary inertia"
    innate: ClassVar[bool] = True
    handbook: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.5, 3.0),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole frame."""
        return () if model.structure is None else ("all",)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the multiple of rho I."""
        now = model.frame_structure.frame.rotary_share
        lacks = now == 0.0
        textbook = 1.0 if lacks else None
        name = "multiple of rho I"
        return (Parameter(name, "", 1.0, now, 0.0, one_sided=lacks, textbook=textbook),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with that share of rotary inertia."""
        share = float(values[0])
        if share == frame.rotary_share:
            return frame
        return replace(frame, rotary_inertia=share if share not in (0.0, 1.0) else share == 1.0)

    def look(self, seen: Seen) -> list[LookWarning]:
        """Return whether a model without rotary inertia should have it."""
        structure = seen.model.structure
        if structure is None or structure.frame.rotary_share != 0.0:
            return []
        changes = seen.changes(self.frame(structure.frame, "all", (1.0,)))
        return seen.notable(self.name, "The rotary inertia of the cross sections matters", changes)
