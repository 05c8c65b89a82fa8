"""A member whose mass lies off its axis: a rail, a cable tray, a thicker wall on one side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    ElementOperator,
    FrameEffect,
    ModelPlaces,
    Parameter,
    Site,
    Size,
    Term,
    once_for,
)
from femubench.fem import Eccentricity, FloatArray, Frame, IntArray, Section, Structure

_SCALE, _BOUND = 0.15, 1.0  # of the size of the section


class MassEccentricity(FrameEffect):
    """Shift the line of the mass centres of a member: along local z in plane, else along y.

    It couples bending with torsion out of plane, and with axial motion in plane.
    """

    name: ClassVar[str] = "mass-eccentricity"
    summary: ClassVar[str] = "a member's mass lies off its axis"
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.25, Site.width, signed=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the members."""
        return () if model.structure is None else tuple(model.structure.frame.member_index)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the offset, whose scale is a share of the section's size that way."""
        frame = model.frame_structure.frame
        size = section_size(frame.members[frame.member_index[place]].section, axis_of(frame))
        bound = _BOUND * size
        return (Parameter(axis_of(frame), "m", _SCALE * size, lower=-bound, upper=bound),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the offset."""
        if not values[0]:
            return frame
        offset = Eccentricity(place, **{axis_of(frame): values[0]})
        return replace(frame, eccentricities=(*frame.eccentricities, offset))

    def change(self, model: Model, place: str) -> Change:
        """Return what is linear and what is quadratic in the offset, on top of a known one."""
        structure = model.frame_structure
        axis = axis_of(structure.frame)
        elements = ModelPlaces(model).elements(place)
        parts, kind = once_for(model, "eccentric mass", lambda: _parts(structure, axis))
        own, other = structure.properties.ecc_y[elements], structure.properties.ecc_z[elements]
        own, other = (own, other) if axis == "y" else (other, own)
        share = np.column_stack([np.ones(len(own)), 2.0 * own, other])
        known = kind[elements]
        linear = ElementOperator(structure, elements, parts, share=share, kind=known)
        square = ElementOperator(structure, elements, parts[:, 1], kind=known)
        terms = Term("mass", linear), Term("mass", square)
        return Change(terms, lambda values: np.column_stack([values[:, 0], values[:, 0] ** 2]))


def _parts(structure: Structure, axis: Literal["y", "z"]) -> tuple[FloatArray, IntArray]:
    """Return what is linear, quadratic and mixed by kinds of elements, and each one's kind."""
    first, kind = structure.properties.alike()
    found = structure.properties.take(first).eccentric_mass_parts()
    return np.stack([found[name] for name in (axis, 2 * axis, "yz")], axis=1), kind


def axis_of(frame: Frame) -> Literal["y", "z"]:
    """Return the local axis along which an offset can be seen."""
    return "z" if frame.plane == "in-plane" else "y"


def section_size(section: Section, axis: Literal["y", "z"]) -> float:
    """Return the size of a section along an axis in m; of numbers, that of an equal rectangle."""
    size = section.width if axis == "y" else section.height
    inertia = section.Iz if axis == "y" else section.Iy
    return float(np.sqrt(12.0 * inertia / section.A)) if size is None else size
