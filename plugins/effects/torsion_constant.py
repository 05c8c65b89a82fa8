"""A wrong torsion constant, above all the polar moment taken for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    EffectParameter,
    ElementOperator,
    FrameEffect,
    Term,
    elements_of,
    proportional,
)
from femubench.fem import (
    Frame,
    Section,
    rectangular_tube,
    round_tube,
    solid_rectangle,
    stiffness_matrices,
)

_SAME = 1e-6


class TorsionConstant(FrameEffect):
    """Scale GJ of all members."""

    name: ClassVar[str] = "torsion-constant"
    summary: ClassVar[str] = "the torsion constant is wrong"

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole frame where its members twist."""
        if model.structure is None or model.structure.frame.plane == "in-plane":
            return ()
        return ("all",) if any(m.section.J for m in model.structure.frame.members) else ()

    def parameters(self, model: Model, place: str) -> Sequence[EffectParameter]:
        """Return the relative change; its textbook value leads to the constant of the shape."""
        textbook = _to_own_constant(model.frame_structure.frame)
        return (EffectParameter("change of J", "", 0.2, lower=-0.9, textbook=textbook),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with other torsion constants."""
        members = (
            replace(m, section=replace(m.section, J=m.section.J * (1.0 + values[0])))
            for m in frame.members
        )
        return replace(frame, members=tuple(members))

    def change(self, model: Model, place: str) -> Change:
        """Return the torsional stiffness of the elements."""
        structure = model.frame_structure
        rows = elements_of(structure, place, arms=True)
        own = structure.properties.take(rows)
        plain = own.scaled("coupling", np.zeros(len(own)))
        now = stiffness_matrices(plain)
        twist = stiffness_matrices(plain.scaled("GJ", np.full(len(own), 2.0))) - now
        coupled = stiffness_matrices(own) - now
        terms = [Term("stiffness", ElementOperator(structure, rows, b)) for b in (twist, coupled)]
        if not coupled.any():
            return proportional(terms[0])
        # The coupling grows with the root of EI GJ.
        return Change(
            tuple(terms),
            lambda values: np.column_stack([values[:, 0], np.sqrt(1.0 + values[:, 0]) - 1.0]),
        )


def _to_own_constant(frame: Frame) -> float | None:
    """Return the relative change to the torsion constants of the shapes, if one leads to all."""
    ratios = []
    for section in {member.section for member in frame.members}:
        own = shape_torsion_constant(section)
        if own is None or section.J <= 0.0:
            return None
        ratios.append(own / section.J - 1.0)
    alike = max(ratios) - min(ratios) < _SAME
    return float(np.mean(ratios)) if alike and abs(ratios[0]) > _SAME else None


def shape_torsion_constant(section: Section) -> float | None:
    """Return J in m4 that belongs to a section's shape, None where it has none that is known.

    The wall follows from the area; a section whose numbers are not those of its shape has none.
    """
    width, height, area = section.width, section.height, section.A
    if width is None or height is None:
        return None
    if section.shape == "rectangular-tube":
        root = (width + height) ** 2 - 4.0 * area
        own = rectangular_tube(width, height, (width + height - np.sqrt(max(root, 0.0))) / 4.0)
    elif section.shape == "round-tube":
        own = round_tube(width, (width - np.sqrt(max(width**2 - 4.0 * area / np.pi, 0.0))) / 2.0)
    elif section.shape == "solid-rectangle":
        own = solid_rectangle(width, height)
    else:
        return None
    alike = np.allclose([own.A, own.Iy, own.Iz], [area, section.Iy, section.Iz], rtol=_SAME, atol=0)
    return own.J if alike else None
