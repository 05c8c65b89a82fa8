"""A mass off the axis of its member: a clamp, an instrument on a bracket, a motor on top."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations_with_replacement
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
_REACH = 0.02  # of the size of the structure: an arm on matrices, which know no sections
_FELT = 1e-9
_ALIKE = 0.999  # cosine of the angle between axes


class MassOffset(FrameEffect):
    """Put a point mass on an arm across a member: along local z, out of plane along local y.

    On a node of matrices that has rotations the arm points anywhere. It is rigid and massless. It
    tells more of what `added-mass` finds at that point.
    """

    name: ClassVar[str] = "mass-offset"
    summary: ClassVar[str] = "a mass sits off the axis of its member"
    refines: ClassVar[str | None] = "added-mass"
    sizes: ClassVar[Sequence[Size]] = (
        Size(0.005, 0.08, Site.mass),
        Size(0.5, 2.0, Site.width, signed=True),
    )

    def places(self, model: Model) -> Sequence[str]:
        """Return the points of members and of straight beams, or nodes, at which an arm is felt."""
        points, structure = ModelPlaces(model).points(), model.structure
        # Asked for with every likely added mass, and the same for all of them.
        return once_for(
            model,
            "points with an arm",
            lambda: [
                at
                for at in points
                if (structure is None or _is_straight(structure.frame, at)) and _arms(model, at)
            ],
        )

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the mass and its arms, whose scale is the section's size that way."""
        mass = Parameter(
            "mass", "kg", _SHARE * model.total_mass, scaling="exponential", one_sided=True
        )
        if model.structure is None:
            points = np.array(list(ModelPlaces(model).nodes.values()))
            size = _REACH * float(np.linalg.norm(np.ptp(points, axis=0)))
        else:
            frame = model.structure.frame
            axis: Literal["y", "z"] = "y" if frame.plane == "out-of-plane" else "z"
            size = section_size(_members_at(frame, place)[0].section, axis)
        given = "m", _SPREAD * size, 0.0, -_BOUND * size, _BOUND * size
        return mass, *(Parameter(name, *given) for name in _arms(model, place))

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the mass on its arm."""
        if not values[0]:
            return frame
        x, y, z = (float(v) for v in values[1] * _across(frame, place))
        mass = PointMass(Places(frame).point(place), values[0], (x, y, z))
        return replace(frame, masses=(*frame.masses, mass))

    def change(self, model: Model, place: str) -> Change:
        """Return what 1 kg does at the point, what is linear and what is quadratic in the arms."""
        at = ModelPlaces(model).point(place)
        rows = [
            ModelPlaces(model).translations(at, _directions(model)),
            *_arms(model, place).values(),
        ]
        eye = np.eye(rows[0].shape[0])
        pairs = list(combinations_with_replacement(range(len(rows)), 2))
        terms = []
        for i, k in pairs:
            core = np.kron(np.array([[0.0, 1.0], [1.0, 0.0]]), eye)
            both = sp.csr_array(sp.vstack([rows[i], rows[k]]))
            operator = RowOperator(rows[i], eye) if i == k else RowOperator(both, core)
            terms.append(Term("mass", operator, weight=0.0 if k else None))

        def factors(values: FloatArray) -> FloatArray:
            mass, arms = values[:, 0], np.column_stack([np.ones(len(values)), values[:, 1:]])
            return np.column_stack([mass * arms[:, i] * arms[:, k] for i, k in pairs])

        return Change(tuple(terms), factors)


def _directions(model: Model) -> list[str]:
    return [d for d in (model.structure.frame.active if model.structure else "xyz") if d in "xyz"]


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


def _arms(model: Model, place: str) -> dict[str, SparseArray]:
    """Return how much more than its point the end of an arm of 1 m moves, sparse (p, n).

    By the names of offsets, without those that nothing turns.
    """
    at, structure = ModelPlaces(model).point(place), model.structure
    kept = ["xyz".index(direction) for direction in _directions(model)]
    turns, found = ModelPlaces(model).motion(at)[3:], {}
    arms = dict(zip(("offset x", "offset y", "offset z"), np.eye(3), strict=True))
    for name, arm in (
        arms.items() if structure is None else [("offset", _across(structure.frame, place))]
    ):
        rows = sp.csr_array(sp.csr_array(np.cross(np.eye(3), arm).T[kept]) @ turns)
        if abs(rows).max() > _FELT:
            found[name] = rows
    return found
