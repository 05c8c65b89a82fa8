"""A wrong torsion constant, above all the polar moment taken for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from scipy.optimize import root_scalar

from femubench import Model
from femubench.effect import (
    Change,
    ElementOperator,
    FrameEffect,
    LookWarning,
    ModelPlaces,
    Parameter,
    Seen,
    Size,
    Term,
)
from femubench.fem import Frame, Section

_SAME = 1e-6
_CLOSE = 0.01  # of the polar moment
_FAR = 3.0  # a torsion constant this many times off is no other approximation of it
_SOLID = 8.0  # A^2 / sqrt(Iy Iz): 12 for a rectangle, 4 pi for an ellipse, far less for tubes
_RULES = {"solid-rectangle": "by Saint-Venant's series", "rectangular-tube": "by Bredt's formula"}


class TorsionConstant(FrameEffect):
    """Scale GJ of all members."""

    name: ClassVar[str] = "torsion-constant"
    summary: ClassVar[str] = "the torsion constant is wrong"
    innate: ClassVar[bool] = True
    handbook: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.40, signed=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole frame where its members twist."""
        if model.structure is None or model.structure.frame.plane == "in-plane":
            return ()
        return ("all",) if any(m.section.J for m in model.structure.frame.members) else ()

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the relative change; its textbook value leads to the constant of the shape."""
        textbook = _to_own_constant(model.frame_structure.frame)
        return (Parameter("change of J", "", 0.2, lower=-0.9, textbook=textbook, wording="change"),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with other torsion constants."""
        members = (
            replace(m, section=replace(m.section, J=m.section.J * (1.0 + values[0])))
            for m in frame.members
        )
        return replace(frame, members=tuple(members))

    def look(self, seen: Seen) -> list[LookWarning]:
        """Return a warning for every section whose torsion constant cannot be right."""
        structure = seen.model.structure
        if structure is None or structure.frame.plane == "in-plane":
            return []
        sections = dict.fromkeys(member.section for member in structure.frame.members)
        return [found for section in sections for found in self._look(seen, section)]

    def _look(self, seen: Seen, section: Section) -> Iterator[LookWarning]:
        what, estimate = _fault(section), estimate_torsion_constant(section)
        if what is None or estimate is None:
            return
        own, how = estimate
        frame = seen.model.frame_structure.frame
        wrong = [m.name for m in frame.members if m.section == section]
        members = tuple(
            replace(m, section=replace(section, J=own)) if m.section == section else m
            for m in frame.members
        )
        yield seen.warning(
            self.name,
            f"{what}; {how} it is {own:.4g} m4.",
            seen.changes(replace(frame, members=members)),
            "all" if len(wrong) == len(members) else ", ".join(wrong),
        )

    def change(self, model: Model, place: str) -> Change:
        """Return the torsional stiffness of the elements."""
        structure = model.frame_structure
        rows = ModelPlaces(model).elements(place, arms=True)
        own = structure.properties.take(rows)
        plain = own.scale("coupling", np.zeros(len(own)))
        now = plain.stiffness_matrices()
        twist = plain.scale("GJ", np.full(len(own), 2.0)).stiffness_matrices() - now
        coupled = own.stiffness_matrices() - now
        terms = [Term("stiffness", ElementOperator(structure, rows, b)) for b in (twist, coupled)]
        if not coupled.any():
            return Change.proportional(terms[0])
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

    A section whose numbers are not those of its shape has none.
    """
    if section.width is None or section.height is None or not section.shape:
        return None
    own = section.same_shape(section.width, section.height, section.wall)
    numbers = [section.A, section.Iy, section.Iz]
    alike = np.allclose([own.A, own.Iy, own.Iz], numbers, rtol=_SAME, atol=0)
    return own.J if alike else None


def estimate_torsion_constant(section: Section) -> tuple[float, str] | None:
    """Return the torsion constant in m4 that a section should have, and in words what it rests on.

    Arguments:
        section: with a shape, or with numbers alone: what looks solid is given Saint-Venant's
            estimate, what looks hollow is taken for a thin rectangular tube with the same A, Iy
            and Iz. None where nothing can be said.

    Source: Bredt (1896); Saint-Venant, J = A^4 / (4 pi^2 Ip), exact for ellipses.
    """
    a, iy, iz = section.A, section.Iy, section.Iz if section.Iz > 0.0 else section.Iy
    if min(a, iy) <= 0.0:
        return None
    if section.width is not None and section.height is not None:
        if section.shape not in _RULES:
            return None
        own = section.same_shape(section.width, section.height, section.wall)
        return own.J, _RULES[section.shape]
    if a**2 > _SOLID * np.sqrt(iy * iz):
        return a**4 / (4.0 * np.pi**2 * (iy + iz)), "by Saint-Venant's estimate for a solid section"
    if abs(iy / iz - 1.0) < _CLOSE:
        half = 3.0 * iy / a
        c = float(np.sqrt(half + np.sqrt(max(half**2 - a**2 / 16.0, 0.0))))
        b, h, wall, form = c, c, a / (4.0 * c), "square"
    else:

        def excess(r: float) -> float:
            return float(r**2 * (3.0 + r) / (3.0 * r + 1.0) - iy / iz)

        # height over width
        r = float(root_scalar(excess, bracket=(1e-6, 1e6), xtol=1e-12, rtol=1e-12).root)
        b = float(np.sqrt(12.0 * iy / a * (1.0 + r) / (r**2 * (3.0 + r))))
        h, wall, form = r * b, a / (2.0 * b * (1.0 + r)), "rectangular"
    return Section.bredt(
        b, h, wall
    ), f"by Bredt's formula for a {form} tube with the same area and inertia"


def is_round(section: Section) -> bool | None:
    """Tell whether a section is a circle; None where its numbers leave it open."""
    if section.shape:
        return section.shape == "round-tube"
    iz = section.Iz if section.Iz > 0.0 else section.Iy
    if abs(section.Iy / iz - 1.0) > _CLOSE:
        return False
    full = section.A**2 / (4.0 * np.pi * section.Iy)
    if abs(full - 1.0) < _CLOSE:
        return True
    return False if full > 0.9 else None  # a square has 0.955, a round tube anything below 1


def _fault(section: Section) -> str | None:
    """Return in words what is wrong with a torsion constant, None where nothing is."""
    polar = section.Iy + section.Iz if section.Iz > 0.0 else section.Jp
    given = f"The torsion constant {section.J:.4g} m4"
    if section.J <= 0.0 or min(section.A, section.Iy, polar) <= 0.0:
        return None
    round_ = is_round(section)
    if section.J / polar > 1.0 + _CLOSE:
        return f"{given} exceeds the polar moment {polar:.4g} m4, which no section can"
    if round_ is not True and abs(section.J / polar - 1.0) <= _CLOSE:
        kind = section.shape.replace("-", " ")
        if kind:
            return f"{given} equals the polar moment, but a {kind} is no circle"
        unless = (
            "unless the section is a round tube this is wrong"
            if round_ is None
            else ("but by its numbers the section is no circle")
        )
        return f"{given} equals the polar moment, {unless}"
    estimate = estimate_torsion_constant(section) if section.shape else None
    if estimate is not None and not 1.0 / _FAR < section.J / estimate[0] < _FAR:
        return f"{given} is {section.J / estimate[0]:.2g} times that of its shape"
    return None
