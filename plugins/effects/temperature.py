"""A test at another temperature than the one that the material constants belong to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    EffectParameter,
    ElementOperator,
    FrameEffect,
    Reading,
    Size,
    Term,
    proportional,
)
from femubench.fem import Frame, Member, stiffness_matrices

_STEEL = 150e9  # Pa: stiffer is taken for steel, softer for aluminium
_STEEL_SLOPE, _ALUMINIUM_SLOPE = -2.4e-4, -3.6e-4  # of E in 1/K, around room temperature


class Temperature(FrameEffect):
    """Scale Young's modulus of every material by its temperature coefficient.

    Unless the temperature is read, no measurement tells this from another modulus; with several
    materials the ratio of their coefficients does, if barely.
    """

    name: ClassVar[str] = "temperature"
    summary: ClassVar[str] = "the structure was warmer or colder"
    reading: ClassVar[Reading | None] = Reading("difference", "read the temperature", std=1.0)
    sizes: ClassVar[Sequence[Size]] = (Size(10.0, 40.0, signed=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole frame."""
        return () if model.structure is None else ("all",)

    def parameters(self, model: Model, place: str) -> Sequence[EffectParameter]:
        """Return the temperature above the one of the constants."""
        return (EffectParameter("difference", "K", 10.0, lower=-100.0, upper=100.0),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with E of every material at that temperature."""
        return replace(frame, members=tuple(_warmer(member, values[0]) for member in frame.members))

    def change(self, model: Model, place: str) -> Change:
        """Return what 1 K does to the elements: all they have of stiffness goes with E."""
        structure = model.frame_structure
        slopes = np.array([slope_of(member.material.E) for member in structure.frame.members])
        blocks = stiffness_matrices(structure.properties)
        blocks = blocks * slopes[structure.mesh.member][:, None, None]
        operator = ElementOperator(structure, np.arange(len(blocks)), blocks)
        return proportional(Term("stiffness", operator))


def slope_of(modulus: float) -> float:
    """Return the relative change of E with temperature in 1/K, by the kind of metal."""
    return _STEEL_SLOPE if modulus > _STEEL else _ALUMINIUM_SLOPE


def _warmer(member: Member, difference: float) -> Member:
    modulus = member.material.E * (1.0 + slope_of(member.material.E) * difference)
    return replace(member, material=replace(member.material, E=modulus))
