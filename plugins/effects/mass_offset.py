"""A mass off the axis of its member: a clamp, an instrument on a bracket, a motor on top."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
import scipy.sparse as sp

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
    once_for,
)
from femubench.fem import FloatArray, Frame, Member, PointMass, SparseArray
from femubench.plugins.effects.mass_eccentricity import section_size

_SHARE = 0.005  # of the structure's mass
_SPREAD, _BOUND = 1.0, 5.0  # of the size of the section
_FELT = 1e-9
_ALIKE = 0.999  # cosine of the angle between axes


class MassOffset(FrameEffect):
    """Put a point mass on an arm across a member: along local z, out of plane along local y.

    The arm is rigid and massless. It tells more of what `added-mass` finds at that point.
    """

    name: ClassVar[str] = "mass-offset"
    summary: ClassVar[str] = "a mass sits off the axis of its member"
    refines: ClassVar[str | None] = "added-mass"
    sizes: ClassVar[Sequence[Size]] = (
        Size(0.005, 0.08, Site.mass),
        Size(0.5, 2.0, Site.width, signed=True),
    )

    def places(self, model: Model) -> Sequence[str]:
        """Return the points of members and of straight beams at which an arm can be felt."""
        if model.structure is None:
            return ()
        frame = model.structure.frame
        along = [at for at in ModelPlaces(model).points() if _is_straight(frame, at)]
        # Asked for with every likely added mass, and the same for all of them.
        return once_for(
            model,
            "points with an arm",
            lambda: [at for at in along if abs(_arm_rows(model, at)).max() > _FELT],
        )

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the mass, and the arm, whose scale is the section's size that way."""
        frame = model.frame_structure.frame
        axis: Literal["y", "z"] = "y" if frame.plane == "out-of-plane" else "z"
        size = section_size(_members_at(frame, place)[0].section, axis)
        mass = Parameter(
            "mass", "kg", _SHARE * model.total_mass, scaling="exponential", one_sided=True
        )
        return mass, Parameter(
            "offset", "m", _SPREAD * size, lower=-_BOUND * size, upper=_BOUND * size
        )

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the mass on its arm."""
        if not values[0]:
            return frame
        x, y, z = (float(v) for v in values[1] * _across(frame, place))
        mass = PointMass(Places(frame).point(place), values[0], (x, y, z))
        return replace(frame, masses=(*frame.masses, mass))

    def change(self, model: Model, place: str) -> Change:
        """Return what 1 kg does at the point, what is linear and what is quadratic in the arm."""
        at = ModelPlaces(model).point(place)
        own = ModelPlaces(model).translations(at, _directions(model))
        turned = _arm_rows(model, place)
        rows = sp.csr_array(sp.vstack([own, turned]))
        p = own.shape[0]
        both = np.zeros((2 * p, 2 * p))
        both[:p, p:] = both[p:, :p] = np.eye(p)
        terms = (
            Term("mass", RowOperator(own, np.eye(p))),
            Term("mass", RowOperator(rows, both), weight=0.0),
            Term("mass", RowOperator(turned, np.eye(p)), weight=0.0),
        )

        def factors(values: FloatArray) -> FloatArray:
            mass, offset = values.T
            return np.column_stack([mass, mass * offset, mass * offset**2])

        return Change(terms, factors)


def _directions(model: Model) -> list[str]:
    return [d for d in model.frame_structure.frame.active if d in "xyz"]


def _members_at(frame: Frame, place: str) -> list[Member]:
    at = Places(frame).point(place)
    names = [at.member] if at.member else frame.ends_at(str(at.joint))
    return [frame.members[frame.member_index[str(name)]] for name in names]


def _is_straight(frame: Frame, place: str) -> bool:
    """Tell whether what goes through a point has the same axes on both sides, as in a deck."""
    axes = [Places(frame).axes(member) for member in _members_at(frame, place)]
    return 0 < len(axes) <= 2 and all((np.diag(axes[0] @ one.T) > _ALIKE).all() for one in axes)


def _across(frame: Frame, place: str) -> FloatArray:
    """Return the direction of an arm, global, (3,); an arm up is not felt out of plane."""
    axes = Places(frame).axes(_members_at(frame, place)[0])
    return np.asarray(axes[1] if frame.plane == "out-of-plane" else axes[2])


def _arm_rows(model: Model, place: str) -> SparseArray:
    """Return how much more than its point the end of an arm of 1 m moves, sparse (p, n)."""
    at = ModelPlaces(model).point(place)
    x, y, z = _across(model.frame_structure.frame, place)
    lever = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    kept = ["xyz".index(direction) for direction in _directions(model)]
    return sp.csr_array(sp.csr_array(lever[kept]) @ ModelPlaces(model).motion(at)[3:])
