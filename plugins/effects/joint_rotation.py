"""Joints that turn: rotational springs between a joint and the members that meet there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    EffectParameter,
    FrameEffect,
    Site,
    Size,
    branch_places,
    end_arm,
    end_places,
    ends_of,
    flexible_ends_change,
    joints_of,
    joints_with_members,
    member_length,
    type_places,
)
from femubench.fem import ACTIVE, Frame, JointSpring, Structure

_SOFTEST = 1e-3  # of the scale
_TORSION, _BENDING = ("rx",), ("ry", "rz")


class JointRotation(FrameEffect):
    """Connect member ends to their joint by rotational springs at the face of the crossing member.

    One stiffness for a joint or an end; bending and torsion apart for a joint type. Without a fit
    the springs are rigid, which leaves the arm between axis and face.
    """

    name: ClassVar[str] = "joint-rotation"
    summary: ClassVar[str] = "the joints rotate"
    softens: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (
        Size(0.3, 30.0, Site.bending_stiffness, log=True),
        Size(0.3, 30.0, Site.torsional_stiffness, log=True),
    )

    def places(self, model: Model) -> Sequence[str]:
        """Return joint types, what branches off there, joints, and ends where three meet."""
        if model.structure is None:
            return ()
        frame = model.structure.frame
        types = (*type_places(frame), *branch_places(frame))
        return (*types, *joints_with_members(frame), *end_places(frame))

    def parameters(self, model: Model, place: str) -> Sequence[EffectParameter]:
        """Return the stiffnesses; the scale is the members' own, 4 EI/L and GJ/L."""
        frame = model.frame_structure.frame
        bending, torsion = _scales(frame, ends_of(frame, place))
        scales = {"bending": bending, "torsion": torsion}
        if len(_parts(frame, place)) == 1:
            scales = {"stiffness": bending}
        return tuple(
            EffectParameter(
                name,
                "N m/rad",
                scale,
                neutral=np.inf,
                lower=_SOFTEST * scale,
                scaling="compliance",
                one_sided=True,
            )
            for name, scale in scales.items()
        )

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the springs, in series with those that are there."""
        structure = Structure.build(frame)
        springs = {f"{s.member}@{s.joint}": s for s in frame.joint_springs}
        own = {
            direction: value
            for directions, value in zip(_parts(frame, place), values, strict=True)
            for direction in directions
        }
        for end in ends_of(frame, place):
            member, _, joint = end.rpartition("@")
            fresh = JointSpring(joint, member, {}, end_arm(structure, end))
            spring = springs.get(end, fresh)
            springs[end] = replace(spring, stiffness=_in_series(spring.stiffness, own))
        return replace(frame, joint_springs=tuple(springs.values()))

    def change(self, model: Model, place: str) -> Change:
        """Return the springs condensed into the end elements."""
        frame = model.frame_structure.frame
        return flexible_ends_change(model, ends_of(frame, place), _parts(frame, place))


def _parts(frame: Frame, place: str) -> tuple[tuple[str, ...], ...]:
    """Return the local directions that belong to every parameter."""
    active = ACTIVE[frame.plane]
    bending, torsion = (tuple(d for d in group if d in active) for group in (_BENDING, _TORSION))
    # The word first: to list the places takes a look at every joint.
    branch = place.endswith(":branch") and place in branch_places(frame)
    apart = torsion and (len(joints_of(frame, place)) > 1 or branch)
    return (bending, torsion) if apart else ((*torsion, *bending),)


def _scales(frame: Frame, ends: Sequence[str]) -> tuple[float, float]:
    """Return 4 EI/L and GJ/L of the members, averaged over ends, in N m/rad."""
    bending, torsion = [], []
    for end in ends:
        member = frame.members[frame.member_index[end.rpartition("@")[0]]]
        s, m, length = member.section, member.material, member_length(frame, member.name)
        bending.append(4.0 * m.E * s.Iy / length)
        torsion.append(m.G * s.J / length)
    own = float(np.mean(bending))
    return own, float(np.mean(torsion)) or own


def _in_series(there: Mapping[str, float], new: Mapping[str, float]) -> dict[str, float]:
    """Return stiffnesses in series by direction; what is rigid is left out."""
    joined = dict(there)
    for direction, value in new.items():
        if np.isfinite(value):
            other = joined.get(direction)
            joined[direction] = value if other is None else value * other / (value + other)
    return joined
