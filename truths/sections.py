"""Cross-sections: the rectangles that a solid is made of, the numbers that a handbook gives.

Local y runs along the width, local z along the height; the centroid lies at the origin.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Drawn = dict[str, str | float]
Rectangle = tuple[float, float, float, float, bool]  # y0, y1, z0, z1 in m; solid or void


@dataclass(frozen=True)
class Section:
    """Describe a cross-section.

    Arguments:
        width, height: outer sizes along local y and z, m.
        rectangles: painted one after the other, later ones over earlier ones.
        drawn: keys of the section in `case.toml`, as a catalogue gives them.
    """

    width: float
    height: float
    rectangles: tuple[Rectangle, ...]
    drawn: Mapping[str, str | float] = field(default_factory=dict)


def _box(width: float, height: float, solid: bool = True) -> Rectangle:
    return (-width / 2, width / 2, -height / 2, height / 2, solid)


def rectangular_tube(width: float, height: float, wall: float) -> Section:
    """Return a rectangular hollow section with sharp corners."""
    inner = _box(width - 2 * wall, height - 2 * wall, False)
    drawn: Drawn = {"shape": "rectangular-tube", "width": width, "height": height, "wall": wall}
    return Section(width, height, (_box(width, height), inner), drawn)


def bar(width: float, height: float) -> Section:
    """Return a solid rectangle."""
    drawn: Drawn = {"shape": "solid-rectangle", "width": width, "height": height}
    return Section(width, height, (_box(width, height),), drawn)


def thin_walled(parts: tuple[tuple[float, float, float, float], ...], web: float) -> Section:
    """Return an open section of rectangles that do not overlap, shifted to its centroid.

    Arguments:
        parts: (y0, y1, z0, z1) of each, m.
        web: area that carries shear along z, m2.

    Source: St Venant's J as the sum of b t^3 / 3 (Timoshenko & Goodier 1970, section 108).
    """
    areas = [(b - a) * (d - c) for a, b, c, d in parts]
    area = sum(areas)
    y = sum(A * (p[0] + p[1]) / 2 for A, p in zip(areas, parts, strict=True)) / area
    z = sum(A * (p[2] + p[3]) / 2 for A, p in zip(areas, parts, strict=True)) / area
    moved = [(a - y, b - y, c - z, d - z) for a, b, c, d in parts]
    Iy = sum((b - a) * (d**3 - c**3) / 3 for a, b, c, d in moved)
    Iz = sum((d - c) * (b**3 - a**3) / 3 for a, b, c, d in moved)
    J = sum(max(b - a, d - c) * min(b - a, d - c) ** 3 / 3 for a, b, c, d in moved)
    y_lines, z_lines = zip(*(((a, b), (c, d)) for a, b, c, d in moved), strict=True)
    width = 2 * max(abs(v) for pair in y_lines for v in pair)
    height = 2 * max(abs(v) for pair in z_lines for v in pair)
    drawn: Drawn = {"A": area, "Iy": Iy, "Iz": Iz, "J": J, "Jp": Iy + Iz, "kappa": web / area}
    return Section(width, height, tuple((*p, True) for p in moved), drawn)


def i_beam(width: float, height: float, web: float, flange: float) -> Section:
    """Return an I with flanges across local z."""
    inner = height / 2 - flange
    parts = (
        (-width / 2, width / 2, -height / 2, -inner),
        (-web / 2, web / 2, -inner, inner),
        (-width / 2, width / 2, inner, height / 2),
    )
    return thin_walled(parts, web * height)


def channel(width: float, height: float, web: float, flange: float) -> Section:
    """Return a U that opens towards positive local y."""
    parts = (
        (0.0, web, 0.0, height),
        (web, width, 0.0, flange),
        (web, width, height - flange, height),
    )
    return thin_walled(parts, web * height)


def angle(width: float, height: float, wall: float) -> Section:
    """Return an L with its corner at low y and low z."""
    return thin_walled(((0.0, wall, 0.0, height), (wall, width, 0.0, wall)), wall * height)


def tee(width: float, height: float, web: float, flange: float) -> Section:
    """Return a T with its flange at high z."""
    parts = (
        (-web / 2, web / 2, 0.0, height - flange),
        (-width / 2, width / 2, height - flange, height),
    )
    return thin_walled(parts, web * height)


def round_bar(diameter: float, wall: float = 0.0) -> Section:
    """Return a square in strips that `rounded` turns into a circle; a tube where it has a wall.

    Four strips a quarter give the circle its facets, alike in every mesh, and its area.
    """
    inner = 1 - 2 * wall / diameter if wall else 1.0
    count = 2 if wall else 4
    lines = [inner * (2 * i / count - 1) for i in range(count + 1)]
    lines = [-1.0, *lines, 1.0] if wall else lines
    area = sum(2 * np.sin(np.pi / 4 * (b - a)) for a, b in pairwise(lines)) / np.pi
    half = diameter / 2 / np.sqrt(area)
    # The voids give the grid its planes across z; the strips along y fill them.
    strips = [(-half, half, a * half, b * half, False) for a, b in pairwise(lines)]
    strips += [(a * half, b * half, -half, half, True) for a, b in pairwise(lines)]
    void = [_box(2 * inner * half, 2 * inner * half, False)] if wall else []
    drawn: Drawn = {"shape": "solid-circle", "diameter": diameter}
    if wall:
        drawn = {"shape": "round-tube", "diameter": diameter, "wall": wall}
    return Section(2 * half, 2 * half, (*strips, *void), drawn)


def rounded(y: Array, z: Array) -> tuple[Array, Array]:
    """Return where points of concentric squares lie when these become circles."""
    reach = np.maximum(np.abs(y), np.abs(z))
    turn = np.pi / 4 * np.minimum(np.abs(y), np.abs(z)) / np.where(reach > 0, reach, 1.0)
    far, near = reach * np.cos(turn), reach * np.sin(turn)
    wide = np.abs(y) >= np.abs(z)
    return np.sign(y) * np.where(wide, far, near), np.sign(z) * np.where(wide, near, far)
