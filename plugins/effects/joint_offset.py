"""Joints of finite size: member ends that are rigid over a length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    ChebyshevPoints,
    ElementOperator,
    FrameEffect,
    Parameter,
    Places,
    Site,
    Size,
    Term,
    once_for,
)
from femubench.fem import FloatArray, Frame, IntArray, RigidEnd, Structure
from femubench.update import Joints

_SHARE = 0.02  # of the member, where sections are numbers
_DIGITS = 9
_SAMPLES = 9


class JointOffset(FrameEffect):
    """Make member ends rigid over a length a, the member's mass kept.

    Source: Horton et al. (1999), equation (5), with a0 = 0 in the mass matrix.
    """

    name: ClassVar[str] = "joint-offset"
    summary: ClassVar[str] = "the joints are rigid over a length"
    innate: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.3, 1.5, Site.half_height),)

    def places(self, model: Model) -> Sequence[str]:
        """Return joint types of several joints, joints, and ends where three members meet."""
        if model.structure is None:
            return ()
        frame = model.structure.frame
        return (*Places(frame).types(), *Places(frame).joints(), *Places(frame).ends())

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the length; the scale is half the depth of the crossing members."""
        structure = model.frame_structure
        ends = Places(structure.frame).ends_of(place)
        scale = float(np.mean([_scale(model, end) for end in ends]))
        upper = _longest(structure, ends)
        return (Parameter("length", "m", scale, lower=0.0, upper=upper, one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with rigid ends, lengths added to those that are there."""
        if values[0] == 0.0:
            return frame
        rigid = {f"{r.member}@{r.joint}": r for r in frame.rigid_ends}
        for end in Places(frame).ends_of(place):
            member, _, joint = end.rpartition("@")
            there = rigid.get(end, RigidEnd(joint, member, 0.0))
            rigid[end] = replace(there, stiffness_length=there.stiffness_length + values[0])
        return replace(frame, rigid_ends=tuple(rigid.values()))

    def change(self, model: Model, place: str) -> Change:
        """Return the stiffness of the end elements by powers of their flexible length."""
        structure = model.frame_structure
        ends = Places(structure.frame).ends_of(place)
        found: dict[int, list[float]] = {}
        for end in ends:
            element, side = structure.element_ends[end]
            found.setdefault(element, [0.0, 0.0])[side] = 1.0
        rows, sides = np.array(list(found), dtype=np.int64), np.array(list(found.values()))
        own = structure.properties.take(rows)
        bending = own.length - own.rigid_1 - own.rigid_2
        shear = 12.0 * own.EIy * own.flex_z, 12.0 * own.EIz * own.flex_y
        keys = np.column_stack([bending, sides.sum(axis=1), *shear])
        keys = np.array([[float(f"{v:.{_DIGITS}e}") for v in key] for key in keys])
        groups, group = np.unique(keys, axis=0, return_inverse=True)
        longest = _longest(structure, ends)
        terms: list[Term] = []
        for i in range(len(groups)):
            used = np.flatnonzero(group.ravel() == i)
            fitted = _kept_blocks(model, rows[used], sides[used], groups[i], longest)
            operators = (ElementOperator(structure, rows[used], blocks) for blocks in fitted)
            terms += [Term("stiffness", operator) for operator in operators]

        def coefficients(values: FloatArray) -> FloatArray:
            return np.hstack(
                [_basis(key, values[:, 0]) - _basis(key, np.zeros(1)) for key in groups]
            )

        return Change(tuple(terms), coefficients)


def _scale(model: Model, end: str) -> float:
    structure = model.frame_structure
    depth = once_for(model, ("half depth", end), partial(Joints(structure).half_depth, end))
    return depth if depth > 0.0 else _SHARE * structure.frame.member_length(end.rpartition("@")[0])


def _longest(structure: Structure, ends: Sequence[str]) -> float:
    """Return how much longer the rigid lengths at all of some ends can become in m."""
    p = structure.properties
    room = []
    for end in ends:
        element, side = structure.element_ends[end]
        there = float((p.rigid_1, p.rigid_2)[side][element])
        room.append(Joints(structure).available_length(end) - max(0.0, there))
    return max(min(room), 1e-9)


def _basis(key: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the functions of a that the stiffness of an element is made of, (g, 3 to 7).

    With l the flexible length and phi l^2 = b: 1/l and 1/(l^3 + b l) times 1, l, l^2 for each of
    the two planes, every one scaled to 1 at a = 0.
    """
    flexible, count = key[:2]
    left = 1.0 - count * lengths / flexible
    columns = [1.0 / left]
    for b in np.unique(key[2:] / flexible**2):
        # Without shear the last function is 1/l again.
        powers = range(3 if b else 2)
        columns += [(1.0 + b) * left**power / (left**3 + b * left) for power in powers]
    return np.stack(columns, axis=1)


def _kept_blocks(
    model: Model, rows: IntArray, sides: FloatArray, key: FloatArray, longest: float
) -> list[FloatArray]:
    """Return `_blocks` of elements, which are the same whatever else takes part."""
    known: dict[tuple[int, float, float], FloatArray] = once_for(model, "offset blocks", dict)
    names = [
        (int(row), float(one), float(two)) for row, (one, two) in zip(rows, sides, strict=True)
    ]
    fresh = [i for i, name in enumerate(names) if name not in known]
    if fresh:
        p = model.frame_structure.properties.take(rows[fresh])
        # The functions are all but dependent where the shear of both planes is alike: the
        # smallest solution is the stable one.
        nodes = ChebyshevPoints(0.0, longest, _SAMPLES).points
        many = p.take(np.tile(np.arange(len(p)), len(nodes)))
        more = (nodes[:, None, None] * sides[fresh]).reshape(-1, 2)
        rigid = {"rigid_1": many.rigid_1 + more[:, 0], "rigid_2": many.rigid_2 + more[:, 1]}
        values = replace(many, **rigid).stiffness_matrices().reshape(len(nodes), -1)
        basis = _basis(key, nodes)
        weight = basis.max(axis=1)[:, None]
        fitted = np.linalg.lstsq(basis / weight, values / weight, rcond=1e-13)[0]
        made = np.stack(list(fitted.reshape(-1, len(p), 12, 12)), axis=1)
        known.update((names[i], blocks) for i, blocks in zip(fresh, made, strict=True))
    return list(np.stack([known[name] for name in names], axis=1))
