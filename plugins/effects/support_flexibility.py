"""A support that gives: a clamp that turns or slides, a foot that is softer than its springs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import Change, FrameEffect, Parameter, Places, Site, Size
from femubench.fem import FloatArray, Frame, Member
from femubench.plugins.effects.flexible_supports import flexible_supports_change, soften_supports

_SOFTEST = 1e-3  # of the scale
_TRANSLATIONS, _ROTATIONS = ("x", "y", "z"), ("rx", "ry", "rz")


def _unit(number: int, site: Site) -> float:
    """Return what a stiffness is measured by, that of what is held."""
    return [_scale(site.frame, held) for held in _parts(site.frame, site.place).values()][number]


class SupportFlexibility(FrameEffect):
    """Put springs in series with what holds the structure to ground.

    A whole support has one stiffness of all its translations and one of all its rotations; a
    direction has one of its own.
    """

    name: ClassVar[str] = "support-flexibility"
    summary: ClassVar[str] = "a support gives"
    softens: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = tuple(
        Size(0.3, 30.0, partial(_unit, number), log=True) for number in (0, 1)
    )

    def places(self, model: Model) -> Sequence[str]:
        """Return the supports and springs to ground, all of them, each, and each direction."""
        if model.structure is None:
            return ()
        frame = model.structure.frame
        return tuple(place for place in Places(frame).supports() if _parts(frame, place))

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the stiffnesses; the scale is that of what is held, or of the springs there."""
        frame = model.frame_structure.frame
        return tuple(
            Parameter(
                name,
                unit,
                scale,
                neutral=np.inf,
                lower=_SOFTEST * scale,
                scaling="compliance",
                one_sided=True,
            )
            for (name, unit), held in _parts(frame, place).items()
            for scale in [_scale(frame, held)]
        )

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with springs instead of rigid supports, and softer springs."""
        parts = zip(_parts(frame, place).values(), values, strict=True)
        return soften_supports(frame, {one: value for held, value in parts for one in held})

    def change(self, model: Model, place: str) -> Change:
        """Return the motion of the support, condensed."""
        parts = _parts(model.frame_structure.frame, place)
        return flexible_supports_change(model, [tuple(held) for held in parts.values()])


_Held = Mapping[tuple[str, str], float]


def _parts(frame: Frame, place: str) -> dict[tuple[str, str], _Held]:
    """Return name and unit of every parameter with what it belongs to, and how stiff that is.

    What is held though nothing pulls at it, as the rotations of a truss, is left out.
    """
    held = {
        (word, direction): stiffness
        for word, own in Places(frame).supports_of(place).items()
        for direction, stiffness in own.items()
        if np.isfinite(stiffness) or _resistance(frame, word, direction) > 0.0
    }
    kinds = (("translation", "N/m", _TRANSLATIONS), ("rotation", "N m/rad", _ROTATIONS))
    parts = {
        (name, unit): {one: k for one, k in held.items() if one[1] in directions}
        for name, unit, directions in kinds
    }
    return {key: own for key, own in parts.items() if own}


def _scale(frame: Frame, held: _Held) -> float:
    """Return the geometric mean of the stiffnesses that springs would be in series with."""
    own = [
        stiffness if np.isfinite(stiffness) else _resistance(frame, *one)
        for one, stiffness in held.items()
    ]
    return float(np.exp(np.mean(np.log(own))))


def _resistance(frame: Frame, word: str, direction: str) -> float:
    """Return the mean stiffness of whole members against a motion of a support."""
    kind, axis = divmod((*_TRANSLATIONS, *_ROTATIONS).index(direction), 3)
    members = Places(frame).members_at(f"support:{word}")
    turns = [np.asarray(Places(frame).axes(m)[:, axis] ** 2) for m in members]
    return float(np.mean([_own(frame, m)[kind] @ t for m, t in zip(members, turns, strict=True)]))


def _own(frame: Frame, member: Member) -> FloatArray:
    """Return EA/L and 12 EI/L^3 above GJ/L and 4 EI/L along a member's axes, (2, 3)."""
    s, m, length = member.section, member.material, frame.member_length(member.name)
    lateral = s.Iz or s.Iy
    twist = m.G * s.J / length or 4.0 * m.E * s.Iy / length
    return np.array(
        [
            [m.E * s.A / length, *(12.0 * m.E * i / length**3 for i in (lateral, s.Iy))],
            [twist, *(4.0 * m.E * i / length for i in (s.Iy, lateral))],
        ]
    )
