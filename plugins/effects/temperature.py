"""A test at another temperature than that of the material constants, everywhere or by degrees."""

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
    Reading,
    Size,
    Term,
    once_for,
)
from femubench.fem import Factor, FloatArray, Frame, Member

_AXES = ("x", "y", "z")
_FLAT = 1e-6  # of the largest extent
_DIGITS = 12  # of a factor: elements as warm as each other are one entry
_STEEL = 150e9  # Pa: stiffer is taken for steel, softer for aluminium
_STEEL_SLOPE, _ALUMINIUM_SLOPE = -2.4e-4, -3.6e-4  # of E in 1/K, around room temperature


class Temperature(FrameEffect):
    """Scale Young's modulus of every material by its temperature coefficient.

    Unless the temperature is read, no measurement tells this from another modulus; with several
    materials the ratio of their coefficients does, if barely. ``all:x``, the temperature changes
    evenly along a global axis, as close to a wall, in the sun or from a warm machine.
    """

    name: ClassVar[str] = "temperature"
    summary: ClassVar[str] = "the structure was warmer or colder"
    reading: ClassVar[Reading | None] = Reading("difference", "read the temperature", std=1.0)
    sizes: ClassVar[Sequence[Size]] = (Size(10.0, 40.0, signed=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole frame, and each axis along which it extends."""
        if model.structure is None:
            return ()
        extent = np.ptp(model.structure.frame.corners, axis=0)
        wide = extent > _FLAT * extent.max()
        along = (f"all:{d}" for d, is_wide in zip(_AXES, wide, strict=True) if is_wide)
        return ("all", *along)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the temperature above the one of the constants, and how much it changes."""
        names = ("difference", "from end to end")[: 1 if place == "all" else 2]
        return [Parameter(n, "K", 10.0, lower=-100.0, upper=100.0) for n in names]

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with E of every material, or element, at its temperature."""
        if place == "all":
            warmer = (_warmer(member, values[0]) for member in frame.members)
            return replace(frame, members=tuple(warmer))
        factors: dict[float, list[str]] = {}
        for member, shares in zip(frame.members, _shares(frame, place), strict=True):
            for k, share in enumerate(shares, 1):
                difference = values[0] + values[1] * share
                factor = round(1.0 + slope_of(member.material.E) * difference, _DIGITS)
                factors.setdefault(factor, []).append(f"{member.name}/{k}")
        more = (Factor("E", tuple(at), factor) for factor, at in factors.items() if factor != 1.0)
        return replace(frame, factors=(*frame.factors, *more))

    def change(self, model: Model, place: str) -> Change:
        """Return what 1 K does to the elements: all they have of stiffness goes with E."""
        structure = model.frame_structure
        frame, mesh = structure.frame, structure.mesh
        # A factor of an element leaves the arms of joint springs alone.
        rows = ModelPlaces(model).elements("all", arms=place == "all")
        slopes = np.array([slope_of(member.material.E) for member in frame.members])
        whole = once_for(
            model, "element stiffness", lambda: structure.properties.stiffness_matrices()
        )
        own = slopes[mesh.member[rows]]
        even = Term("stiffness", ElementOperator(structure, rows, whole, share=own, kind=rows))
        if place == "all":
            return Change.proportional(even)
        known = _shares(frame, place)
        pairs = zip(mesh.member[rows], mesh.number[rows], strict=True)
        shares = np.array([known[int(m)][int(k) - 1] for m, k in pairs])
        along = ElementOperator(structure, rows, whole, share=own * shares, kind=rows)
        return Change((even, Term("stiffness", along)), lambda values: values)


def slope_of(modulus: float) -> float:
    """Return the relative change of E with temperature in 1/K, by the kind of metal."""
    return _STEEL_SLOPE if modulus > _STEEL else _ALUMINIUM_SLOPE


def _shares(frame: Frame, place: str) -> list[FloatArray]:
    """Return where the elements of every member are along an axis, from -0.5 to 0.5 of all."""
    along = frame.corners[:, _AXES.index(place.rpartition(":")[2])]
    middle, extent = 0.5 * (along.max() + along.min()), np.ptp(along)
    found = []
    for member, (first, last) in zip(frame.members, along[frame.member_ends], strict=True):
        station = (np.arange(member.elements) + 0.5) / member.elements
        found.append((first + station * (last - first) - middle) / extent)
    return found


def _warmer(member: Member, difference: float) -> Member:
    modulus = member.material.E * (1.0 + slope_of(member.material.E) * difference)
    return replace(member, material=replace(member.material, E=modulus))
