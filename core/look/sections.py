"""Whether the torsion constants can be right: the polar moment is one of circles alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from femubench.core.fem.frame import Frame
from femubench.core.fem.sections import (
    Section,
    bredt,
    rectangular_tube,
    saint_venant_rectangle,
)
from femubench.core.look.modes import Seen, percent
from femubench.core.schema.diagnosis import LookWarning

_SAME = 0.01  # of the polar moment
_FAR = 3.0  # a torsion constant this many times off is no other approximation of it
_SOLID = 8.0  # A^2 / sqrt(Iy Iz): 12 for a rectangle, 4 pi for an ellipse, far less for tubes


def estimated_torsion_constant(section: Section) -> tuple[float, str] | None:
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
        return _of_shape(section, section.width, section.height)
    if a**2 > _SOLID * np.sqrt(iy * iz):
        return a**4 / (4.0 * np.pi**2 * (iy + iz)), "by Saint-Venant's estimate for a solid section"
    b, h, wall = _thin_tube(a, iy, iz)
    form = "square" if abs(iy / iz - 1.0) < _SAME else "rectangular"
    return bredt(b, h, wall), f"by Bredt's formula for a {form} tube with the same area and inertia"


def _of_shape(section: Section, width: float, height: float) -> tuple[float, str] | None:
    if section.shape == "solid-rectangle":
        return saint_venant_rectangle(width, height), "by Saint-Venant's series"
    if section.shape != "rectangular-tube":
        return None
    # The wall follows from the area: w h - (w - 2t)(h - 2t) = A.
    side = width + height
    root = max(side**2 - 4.0 * section.A, 0.0)
    return rectangular_tube(width, height, (side - np.sqrt(root)) / 4.0).J, "by Bredt's formula"


def _thin_tube(a: float, iy: float, iz: float) -> tuple[float, float, float]:
    """Return centre-line width, height and wall of a tube with these A, Iy and Iz, in m."""
    if abs(iy / iz - 1.0) < _SAME:  # exact: I = A (c^2 + t^2) / 6, A = 4 c t
        half = 3.0 * iy / a
        c = float(np.sqrt(half + np.sqrt(max(half**2 - a**2 / 16.0, 0.0))))
        return c, c, a / (4.0 * c)

    def excess(r: float) -> float:
        return float(r**2 * (3.0 + r) / (3.0 * r + 1.0) - iy / iz)

    r = float(brentq(excess, 1e-6, 1e6, xtol=1e-12, rtol=1e-12))  # height over width
    b = float(np.sqrt(12.0 * iy / a * (1.0 + r) / (r**2 * (3.0 + r))))
    return b, r * b, a / (2.0 * b * (1.0 + r))


def is_round(section: Section) -> bool | None:
    """Tell whether a section is a circle; None where its numbers leave it open."""
    if section.shape:
        return section.shape == "round-tube"
    iz = section.Iz if section.Iz > 0.0 else section.Iy
    if abs(section.Iy / iz - 1.0) > _SAME:
        return False
    full = section.A**2 / (4.0 * np.pi * section.Iy)
    if abs(full - 1.0) < _SAME:
        return True
    return False if full > 0.9 else None  # a square has 0.955, a round tube anything below 1


def look_at_sections(seen: Seen) -> list[LookWarning]:
    """Return a warning for every section whose torsion constant cannot be right."""
    frame = seen.model.frame_structure.frame
    if frame.plane == "in-plane":
        return []
    sections = dict.fromkeys(member.section for member in frame.members)
    warnings = (_look(seen, frame, section) for section in sections)
    return [warning for warning in warnings if warning is not None]


def _look(seen: Seen, frame: Frame, section: Section) -> LookWarning | None:
    what = _fault(section)
    estimate = estimated_torsion_constant(section)
    if what is None or estimate is None:
        return None
    own, how = estimate
    members = tuple(
        replace(m, section=replace(section, J=own)) if m.section == section else m
        for m in frame.members
    )
    concerned = [m.name for m in frame.members if m.section == section]
    where = "all" if len(concerned) == len(frame.members) else ", ".join(concerned)
    changes = seen.changes(replace(frame, members=members))
    said = f"{what}; {how} it is {own:.4g} m4."
    listed = () if changes is None else percent(changes)
    return LookWarning(said, where, "torsion-constant", listed)


def _fault(section: Section) -> str | None:
    """Return in words what is wrong with a torsion constant, None where nothing is."""
    polar = section.Iy + section.Iz if section.Iz > 0.0 else section.Jp
    given = f"The torsion constant {section.J:.4g} m4"
    if section.J <= 0.0 or min(section.A, section.Iy, polar) <= 0.0:
        return None
    round_ = is_round(section)
    if section.J / polar > 1.0 + _SAME:
        return f"{given} exceeds the polar moment {polar:.4g} m4, which no section can"
    if round_ is not True and abs(section.J / polar - 1.0) <= _SAME:
        kind = section.shape.replace("-", " ")
        if kind:
            return f"{given} equals the polar moment, but a {kind} is no circle"
        unless = (
            "unless the section is a round tube this is wrong"
            if round_ is None
            else ("but by its numbers the section is no circle")
        )
        return f"{given} equals the polar moment, {unless}"
    estimate = estimated_torsion_constant(section) if section.shape else None
    if estimate is not None and not 1.0 / _FAR < section.J / estimate[0] < _FAR:
        return f"{given} is {section.J / estimate[0]:.2g} times that of its shape"
    return None
