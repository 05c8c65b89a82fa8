"""A member that was fitted under stress and strains the frame around it."""

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
    Parameter,
    Site,
    Size,
    Term,
    once_for,
)
from femubench.fem import FloatArray, Frame, GeometricStiffness, IntArray, Preload, Structure

_SCALE, _BOUND = 0.15, 0.6  # of the Euler load
_MOST = 60


class AxialPreload(FrameEffect):
    """Put the frame under the self-equilibrated stress that a member's lack of fit leaves.

    The value is the largest normal force anywhere in the frame, with the sign of the force in the
    member, tension positive.
    """

    name: ClassVar[str] = "axial-preload"
    summary: ClassVar[str] = "a member was fitted under stress"
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.40, Site.euler_load, signed=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the members that the rest of the frame resists, the 60 first to buckle at most."""
        if model.structure is None:
            return ()
        frame, members = (
            model.structure.frame,
            GeometricStiffness(model.structure).redundant_members(),
        )
        slender = set(sorted(members, key=lambda name: euler_load(frame, name))[:_MOST])
        return tuple(name for name in members if name in slender)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the force; its scale is a share of the member's Euler load."""
        load = euler_load(model.frame_structure.frame, place)
        bound = _BOUND * load
        return (Parameter("force", "N", _SCALE * load, lower=-bound, upper=bound),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the lack of fit."""
        if not values[0]:
            return frame
        return replace(frame, preloads=(*frame.preloads, Preload(place, values[0])))

    def change(self, model: Model, place: str) -> Change:
        """Return the geometric stiffness of 1 N.

        Raises:
            ModelError: when the frame is not redundant there.
        """
        structure = model.frame_structure
        units, kind, every = once_for(model, "preload units", lambda: _units(structure))
        forces, adjacent = GeometricStiffness(structure).forces(place)
        operator = ElementOperator(structure, every, units, share=forces, kind=kind)
        terms = [Term("stiffness", operator)]
        if adjacent is not None:
            terms.append(Term.of("stiffness", adjacent))
        return Change.proportional(*terms)


def _units(structure: Structure) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the unit matrices by kinds of elements, each one's kind, and all elements."""
    mesh = structure.mesh
    first, kind = structure.properties.alike(mesh.member, *mesh.rigid.T)
    return GeometricStiffness(structure).unit_matrices()[first], kind, np.arange(len(kind))


def euler_load(frame: Frame, name: str) -> float:
    """Return pi^2 E I / L^2 of a member in N, with the smaller second moment that is known."""
    member = frame.members[frame.member_index[name]]
    # A frame in one plane needs Iy alone.
    own = (member.section.Iy, member.section.Iz)
    inertia = min((i for i in own if i > 0.0), default=0.0)  # of a rod
    return float(np.pi**2 * member.material.E * inertia / frame.member_length(name) ** 2)
