"""Joints that turn: rotational springs between a joint and the members that meet there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import Change, FrameEffect, Parameter, Places, Site, Size
from femubench.fem import Frame, Structure
from femubench.plugins.effects.flexible_ends import (
    end_arm,
    end_room,
    end_stiffness,
    flexible_ends_change,
    free_arm_change,
    soften_ends,
)

_SOFTEST = 1e-3  # of the scale
_TORSION, _BENDING = ("rx",), ("ry", "rz")
_ARM, _LONGEST = "arm, multiple of half a depth", 2.0


class JointRotation(FrameEffect):
    """Connect member ends to their joint by rotational springs at the face of the crossing member.

    One stiffness for a joint or an end; bending and torsion apart for a joint type. ``:apart``, a
    place has a stiffness for each local axis, and the length of the arm between axis and face is
    free. Without a fit the springs are rigid, which leaves the arm.
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
        types = (*Places(frame).types(), *Places(frame).branches())
        return (*types, *Places(frame).joints(), *Places(frame).ends())

    def finer(self, model: Model, place: str) -> Sequence[str]:
        """Return the place with directions apart and a free arm, where these are more values."""
        if place.endswith(Places.APART):
            return ()
        structure, free = model.frame_structure, f"{place}{Places.APART}"
        more = len(_parts(structure.frame, free)) > len(_parts(structure.frame, place))
        return (free,) if more or _longest(structure, place) > 1.0 else ()

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the stiffnesses, with the members' own as scale, 4 EI/L and GJ/L, and the arm."""
        structure = model.frame_structure
        own, lateral, torsion = end_stiffness(
            structure.frame, Places(structure.frame).ends_of(place)
        )
        names = ("stiffness", "bending", "bending ry")
        scales = {**dict.fromkeys(names, own), "bending rz": lateral, "torsion": torsion}
        found = [
            Parameter(
                name,
                "N m/rad",
                scales[name],
                neutral=np.inf,
                lower=_SOFTEST * scales[name],
                scaling="compliance",
                one_sided=True,
            )
            for name in _parts(structure.frame, place)
        ]
        if place.endswith(Places.APART) and (longest := _longest(structure, place)) > 1.0:
            # The textbook has half the depth of the crossing member.
            found.append(Parameter(_ARM, "", 0.5, 1.0, 0.0, longest, textbook=1.0))
        return tuple(found)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the springs, in series with those that are there."""
        groups = _parts(frame, place).values()
        arm = values[len(groups)] if len(values) > len(groups) else 1.0
        own = {d: value for names, value in zip(groups, values, strict=False) for d in names}
        return soften_ends(frame, dict.fromkeys(Places(frame).ends_of(place), own), arm)

    def change(self, model: Model, place: str) -> Change:
        """Return the springs condensed into the end elements."""
        structure = model.frame_structure
        ends, groups = Places(structure.frame).ends_of(place), _parts(structure.frame, place)
        parts = tuple(groups.values())
        if place.endswith(Places.APART) and (longest := _longest(structure, place)) > 1.0:
            return free_arm_change(model, ends, parts, longest)
        return flexible_ends_change(model, ends, parts)


def _parts(frame: Frame, place: str) -> dict[str, tuple[str, ...]]:
    """Return the local directions that belong to every stiffness, by its name."""
    active = frame.active
    bending, torsion = (tuple(d for d in group if d in active) for group in (_BENDING, _TORSION))
    if place.endswith(Places.APART):
        names = ("bending",) if len(bending) == 1 else tuple(f"bending {d}" for d in bending)
        apart = {name: (d,) for name, d in zip(names, bending, strict=True)}
        return {**apart, **({"torsion": torsion} if torsion else {})}
    # The word first: to list the places takes a look at every joint.
    branch = place.endswith(":branch") and place in Places(frame).branches()
    if torsion and (len(Places(frame).joints_of(place)) > 1 or branch):
        return {"bending": bending, "torsion": torsion}
    return {"stiffness": (*torsion, *bending)}


def _longest(structure: Structure, place: str) -> float:
    """Return how long the arm may be, as a multiple of half a depth; 0 where there is none."""
    ends = Places(structure.frame).ends_of(place)
    arms = [(end_arm(structure, end), end_room(structure, end)) for end in ends]
    return min((min(_LONGEST, room / arm) for arm, room in arms if arm > 0.0), default=0.0)
