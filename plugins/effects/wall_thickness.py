"""A wall that is thicker or thinner than drawn: tolerance, corrosion, another stock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    ChebyshevPoints,
    ElementOperator,
    FrameEffect,
    ModelPlaces,
    Parameter,
    Places,
    Size,
    Term,
    once_for,
)
from femubench.fem import BeamProperties, FloatArray, Frame, IntArray, Member, Section, Structure

_SCALE, _MOST, _NODES = 0.1, 0.9, 9
_MATRICES: tuple[Literal["stiffness", "mass"], ...] = ("stiffness", "mass")
# What grows with which constant of the section.
_GROWS = {
    "EA": "A",
    "EIy": "Iy",
    "EIz": "Iz",
    "GJ": "J",
    "rhoA": "A",
    "rhoJp": "Jp",
    "rhoIy": "Iy",
    "rhoIz": "Iz",
}


class WallThickness(FrameEffect):
    """Make the wall of tubes thicker or thinner, the outside as it is.

    Area, second moments, torsion and polar constants and shear coefficients change together, each
    as that of the shape; constants that were given with the shape change by the same factor.
    """

    name: ClassVar[str] = "wall-thickness"
    summary: ClassVar[str] = "a wall has another thickness"
    sizes: ClassVar[Sequence[Size]] = (Size(0.03, 0.25, signed=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return all members, families and single members, as far as they are tubes."""
        if model.structure is None:
            return ()
        frame = model.structure.frame
        members = tuple(frame.member_index)
        everything = ("all",) if len(members) > 1 else ()
        words = (*everything, *Places(frame).sets(), *members)
        tubes = {member.name for member in frame.members if _wall(member.section)}
        return tuple(word for word in words if tubes.issuperset(Places(frame).members(word)))

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the relative change of the wall."""
        bound = _bound(model.frame_structure.frame, place)
        return (
            Parameter(
                "change of the wall", "", _SCALE, lower=-bound, upper=bound, wording="change"
            ),
        )

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with other sections."""
        named = Places(frame).members(place) if values[0] else ()
        members = (
            replace(m, section=_with_wall(m.section, 1.0 + values[0])) if m.name in named else m
            for m in frame.members
        )
        return replace(frame, members=tuple(members))

    def change(self, model: Model, place: str) -> Change:
        """Return the matrices of the elements, interpolated between Chebyshev points."""
        structure = model.frame_structure
        frame, names = structure.frame, Places(structure.frame).members(place)
        bound = _bound(frame, place)
        nodes = ChebyshevPoints(-bound, bound, _NODES)
        rows = ModelPlaces(model).elements(place, arms=True)
        walls = partial(_walls, structure, bound)
        # Members of one section are as thick as each other; what mixes them has its own nodes.
        alone = all(_bound(frame, name) == bound for name in names)
        matrices, kind = once_for(model, ("walls", bound), walls) if alone else walls(names)
        terms = [
            Term(matrix, ElementOperator(structure, rows, blocks, kind=kind[rows]))
            for pair in matrices
            for matrix, blocks in zip(_MATRICES, pair, strict=True)
        ]

        def coefficients(values: FloatArray) -> FloatArray:
            return np.repeat(nodes.shares(values[:, 0]), 2, axis=1)

        return Change(tuple(terms), coefficients)


def _walls(
    structure: Structure, bound: float, names: Sequence[str] = ()
) -> tuple[FloatArray, IntArray]:
    """Return what other walls change in stiffness and mass, by kinds of elements.

    Arguments:
        bound: the largest relative change.
        names: of members; those with just this bound where there are none.

    Returns:
        matrices (n_nodes, 2, c, 12, 12) and the kind of each element, (n_elements,).
    """
    frame = structure.frame
    names = names or [m.name for m in frame.members if _own_bound(m.section) == bound]
    index = {frame.member_index[name]: i for i, name in enumerate(names)}
    rows = np.flatnonzero(np.isin(structure.mesh.member, list(index)))
    members = [frame.members[m] for m in index]
    first, own_kind = structure.properties.take(rows).alike(structure.mesh.member[rows])
    own = structure.properties.take(rows[first])
    which = np.array([index[int(m)] for m in structure.mesh.member[rows[first]]])
    still = np.array([own.stiffness_matrices(), own.mass_matrices()])
    found = []
    for node in ChebyshevPoints(-bound, bound, _NODES).points:
        other = _scaled(own, members, which, 1.0 + float(node))
        found.append(np.array([other.stiffness_matrices(), other.mass_matrices()]) - still)
    kind = np.zeros(len(structure.mesh.member), dtype=np.int64)
    kind[rows] = own_kind
    return np.array(found), kind


def _wall(section: Section) -> float | None:
    """Return the thickness of a tube's wall in m by its shape and area, None for what is none."""
    width, height = section.width, section.height
    tube = section.shape in ("rectangular-tube", "round-tube") and section.A > 0.0
    if width is None or height is None or not tube:
        return None
    wall = section.wall
    return wall if wall < (1.0 - 1e-9) * min(width, height) / 2.0 else None


def _with_wall(section: Section, factor: float) -> Section:
    """Return a tube with so many times the wall."""
    wall = _wall(section) or 0.0
    sizes = section.width or 0.0, section.height or 0.0
    old, new = section.same_shape(*sizes, wall), section.same_shape(*sizes, factor * wall)
    constants = {
        name: getattr(section, name) * getattr(new, name) / getattr(old, name)
        for name in ("A", "Iy", "Iz", "J", "Jp")
    }
    # A coefficient of the user's own stays.
    given, usual = section.kappa, old.kappa
    of_shape = given is not None and usual is not None and np.allclose(given(0.3), usual(0.3))
    return replace(section, **constants, kappa=new.kappa if of_shape else given)


def _scaled(
    own: BeamProperties, members: Sequence[Member], which: IntArray, factor: float
) -> BeamProperties:
    """Return the elements of some members with so many times the wall."""
    new = [_with_wall(member.section, factor) for member in members]
    pairs = [(member.section, section) for member, section in zip(members, new, strict=True)]
    for name, constant in _GROWS.items():
        ratios = [_ratio(getattr(a, constant), getattr(b, constant)) for a, b in pairs]
        own = own.scale(name, np.array(ratios)[which])
    for axis, name in enumerate(("flex_y", "flex_z")):
        kappas = [
            (a.kappa(m.material.nu)[axis] if a.kappa else 1.0)
            / (b.kappa(m.material.nu)[axis] if b.kappa else 1.0)
            for m, (a, b) in zip(members, pairs, strict=True)
        ]
        ratios = [_ratio(b.A, a.A) for a, b in pairs]
        own = own.scale(name, (np.array(kappas) * ratios)[which])
    return own


def _ratio(old: float, new: float) -> float:
    return new / old if old else 1.0


def _bound(frame: Frame, place: str) -> float:
    """Return the largest relative change for which there is still a wall and still a hole."""
    names = Places(frame).members(place)
    return min(_own_bound(frame.members[frame.member_index[name]].section) for name in names)


def _own_bound(section: Section) -> float:
    """Return the same of one section; that of no tube does not matter."""
    room = 0.5 * min(section.width or 0.0, section.height or 0.0) / (_wall(section) or np.inf) - 1.0
    return float(min(_MOST, 0.99 * room))
