"""A support that nobody drew: a prop, a stop, a table that the structure came to lie on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import Change, FrameEffect, Parameter, Places, Term
from femubench.fem import FloatArray, Frame, GroundSpring, Member
from femubench.plugins.effects.support_position import (
    POWERS,
    Beam,
    Track,
    beam_of,
    directions_across,
    pair_term,
    pairs_of,
)

_FIRM = 1e5  # of 48 EI / L^3
_SOFTEST = 1e-3  # of that
_PARTS = 4  # of a beam, in each of which one is sought
_MOST = 120


class SupportAdded(FrameEffect):
    """Hold a beam somewhere across its line.

    The stiffness is half normal by decades about a hundred thousand times what the beam resists, so
    that one that is all but rigid costs nothing; a soft one is a spring to ground. A beam is sought
    through quarter by quarter: within one the place is about as likely anywhere.
    """

    name: ClassVar[str] = "support-added"
    summary: ClassVar[str] = "something new supports the structure"
    acquired: ClassVar[bool] = True

    def places(self, model: Model) -> Sequence[str]:
        """Return the middles of the quarters of straight beams, across each direction.

        A structure that hangs free has none.
        """
        if model.structure is None or not model.structure.frame.supports:
            return ()
        frame, seen, found = model.structure.frame, set[str](), list[str]()
        for member in frame.members:
            if member.name in seen:
                continue
            beam = beam_of(frame, member.name)
            seen |= dict(beam.members).keys()
            for k in range(_PARTS):
                at = Places(frame).point(str(beam.place((k + 0.5) / _PARTS * beam.ends[-1])))
                point = at.joint or f"{at.member}@{at.s:.6g}"
                words = directions_across(frame, member.name)
                tails = [""] if frame.plane == "out-of-plane" else [f":{word}" for word in words]
                found += [f"{point}{tail}" for tail in tails]
        return tuple(found[:_MOST])

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return its stiffness and how far it is from the place, along the beam."""
        beam, _, member, _ = _line(model.frame_structure.frame, place)
        length = beam.ends[-1]
        scale = _FIRM * 48.0 * member.material.E * member.section.Iy / length**3
        half = 0.5 / _PARTS * length
        return (
            Parameter(
                *("stiffness", "N/m", scale),
                scaling="exponential",
                one_sided=True,
                least=_SOFTEST * scale,
            ),
            Parameter("offset", "m", 0.8 * half, lower=-half, upper=half),
        )

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with a stiff spring."""
        if not values[0]:
            return frame
        beam, x, _, direction = _line(frame, place)
        at = Places(frame).point(str(beam.place(x + values[1])))
        return replace(frame, springs=(*frame.springs, GroundSpring(at, direction, values[0])))

    def change(self, model: Model, place: str) -> Change:
        """Return the stiffness of a point that moves along the beam, in series with its element."""
        beam, x, _, direction = _line(model.frame_structure.frame, place)
        half = 0.5 / _PARTS * beam.ends[-1]
        track = Track.of(model, beam, (x - half, x + half), direction, x)
        pairs, terms = pairs_of(POWERS), list[Term]()
        for rows in track.rows:
            terms += [pair_term("stiffness", rows, *pair) for pair in pairs]
        first, second = np.array(pairs).T

        def factors(values: FloatArray) -> FloatArray:
            k, powers, give = track.at(x + values[:, 1])
            stiffness = values[:, 0] / (1.0 + values[:, 0] * give)
            found = np.zeros((len(values), len(track.rows), len(pairs)))
            each = stiffness[:, None] * powers[:, first] * powers[:, second]
            found[np.arange(len(values)), k] = each
            return found.reshape(len(values), -1)

        return Change(tuple(terms), factors)


def _line(frame: Frame, place: str) -> tuple[Beam, float, Member, str]:
    """Return the beam at a place, where on it that is in m, the member there, and a direction."""
    at, direction = Places(frame).directed_point(place)
    name = at.member or frame.ends_at(str(at.joint))[0]
    beam = beam_of(frame, name)
    x = beam.position(frame, at)
    assert x is not None
    return beam, x, frame.members[frame.member_index[name]], direction
