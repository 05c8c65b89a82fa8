"""Joints that all give, more or less: no weld, bolt or glue is as stiff as a rigid corner."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import Change, FrameEffect, Parameter, Places, Size
from femubench.fem import FloatArray, Frame, Structure
from femubench.plugins.effects.flexible_ends import end_stiffness, flexible_ends_change, soften_ends
from femubench.update import JointGroup, Joints

_SOFTEST = 1e-3  # of the scale
_TORSION, _BENDING = ("rx",), ("ry", "rz")
# Joints of other types, made in the same shop, are twice or half as stiff: one deviation.
_SPREAD, _WIDEST = float(np.log(2.0)), 2.0
_MOST = 6


class JointFlexibility(FrameEffect):
    """Let all joints turn on springs, as stiff as a multiple of the members that end there.

    One multiple for all; ``:apart``, every joint type has a factor of its own as well, and the
    factors scatter around 1. Members that pass through a joint are continuous there.
    """

    name: ClassVar[str] = "joint-flexibility"
    summary: ClassVar[str] = "all joints give"
    softens: ClassVar[bool] = True
    # EN 1993-1-8, 5.2.2: semi-rigid up to 25 EI/L, and no frame stands on hinges alone.
    sizes: ClassVar[Sequence[Size]] = (Size(1.0, 30.0, log=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole frame, where there are joints of several types."""
        return () if model.structure is None or not _groups(model.structure) else ("all",)

    def finer(self, model: Model, place: str) -> Sequence[str]:
        """Return the place with a factor for every type."""
        return () if place.endswith(Places.APART) else (f"{place}{Places.APART}",)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the multiple of 4 EI/L and GJ/L, and the factors of the types as their ln."""
        stiffness = Parameter(
            "stiffness, multiple of the members' own",
            "",
            1.0,
            neutral=np.inf,
            lower=_SOFTEST,
            scaling="compliance",
            one_sided=True,
        )
        groups = _groups(model.frame_structure) if place.endswith(Places.APART) else ()
        factors = (
            Parameter(f"ln of {group.name} over all", "", _SPREAD, 0.0, -_WIDEST, _WIDEST)
            for group in groups
        )
        return (stiffness, *factors)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the springs, in series with those that are there."""
        springs: dict[str, dict[str, float]] = {}
        groups = _groups(Structure.build(frame))
        multiples = _multiples(np.array([values]), len(groups))
        for group, (multiple,) in zip(groups, multiples, strict=True):
            own = zip(_parts(frame), _scales(frame, group), strict=True)
            along = {d: float(multiple * scale) for part, scale in own for d in part}
            springs |= dict.fromkeys(group.ends, along)
        return soften_ends(frame, springs)

    def change(self, model: Model, place: str) -> Change:
        """Return the springs condensed into the end elements."""
        structure = model.frame_structure
        frame, groups = structure.frame, _groups(structure)
        changes = [flexible_ends_change(model, group.ends, _parts(frame)) for group in groups]
        scales = [np.array(_scales(frame, group)) for group in groups]

        def coefficients(values: FloatArray) -> FloatArray:
            own = zip(changes, _multiples(values, len(groups)), scales, strict=True)
            return np.hstack([c.coefficients(np.outer(k, scale)) for c, k, scale in own])

        return Change(tuple(term for change in changes for term in change.terms), coefficients)


def _groups(structure: Structure) -> tuple[JointGroup, ...]:
    """Return the ends that turn, by joint type; nothing where it would be something else.

    Of joints of one type `joint-rotation` is there. Springs at both ends of an element cannot be
    condensed one by one: its ends must be of one type.
    """
    groups = tuple(group for group in Joints(structure).groups() if group.role != "through")
    owner: dict[int, str] = {}
    for group in groups:
        for end in group.ends:
            if owner.setdefault(structure.element_ends[end][0], group.name) != group.name:
                return ()
    return groups if 1 < len(groups) <= _MOST else ()


def _multiples(values: FloatArray, count: int) -> FloatArray:
    """Return the multiple of every group, (n_groups, g), of values, (g, 1) or (g, 1 + n_groups)."""
    factors = values[:, 1:] if values.shape[1] > 1 else np.zeros((len(values), count))
    return np.asarray((values[:, :1] * np.exp(factors)).T)


def _parts(frame: Frame) -> tuple[tuple[str, ...], ...]:
    """Return the local directions of bending, and of torsion where the plane has it."""
    active = frame.active
    parts = (tuple(d for d in group if d in active) for group in (_BENDING, _TORSION))
    return tuple(part for part in parts if part)


def _scales(frame: Frame, group: JointGroup) -> tuple[float, ...]:
    """Return the stiffness of the members that end at a group in N m/rad, one a part."""
    bending, _, torsion = end_stiffness(frame, group.ends)
    return (bending, torsion)[: len(_parts(frame))]
