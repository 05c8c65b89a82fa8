"""Stretches of a solid of bricks: every interval of its axes gets longer or shorter by a factor.

Bricks stay bricks, so that mass and stiffness of the stretched solid are sums of fixed matrices
times products of powers of the factors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from truths.bricks import CLOSE, boxes, member_boxes
from truths.structure import Member, Structure

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

SECTION, LENGTH = "section", "length"
LENGTHS = 3  # factors of spans, which take them in turns
SAME, MODULUS, DENSITY = "drawn", "modulus", "density"
RANGES = {  # of the factors
    SECTION: (0.85, 1.2),
    LENGTH: (0.8, 1.25),
    SAME: (1.0, 1.0),
    MODULUS: (0.5, 2.0),
    DENSITY: (0.6, 1.6),
}


@dataclass(frozen=True)
class Stretch:
    """Hold which interval of which axis has which factor.

    Arguments:
        knots: planes across each axis between intervals, m.
        classes: index of the factor of each interval.
        names: of the factors; the letters before ``-`` say what they stretch.
    """

    knots: tuple[Array, Array, Array]
    classes: tuple[Integers, Integers, Integers]
    names: tuple[str, ...]

    @property
    def ranges(self) -> Array:
        """Return between which values each factor is drawn, (factors, 2)."""
        return np.array([RANGES[name.partition("-")[0]] for name in self.names])

    def interval(self, axis: int, values: Array) -> Integers:
        """Return in which interval of an axis coordinates (m) lie."""
        inner = self.knots[axis][1:-1]
        return np.asarray(np.searchsorted(inner, values), dtype=np.int64)

    def parts(self, axis: int, values: Array) -> Array:
        """Return how much of a coordinate (n,) has each factor: (factors, n), m."""
        knots, kinds = self.knots[axis], self.classes[axis]
        steps = np.zeros((len(self.names), len(knots)))
        for i, kind in enumerate(kinds):
            steps[kind, i + 1] = knots[i + 1] - knots[i]
        before = np.cumsum(steps, axis=1)
        which = self.interval(axis, values)
        found = before[:, which]
        found[kinds[which], range(len(values))] += values - knots[which]
        return np.asarray(found)

    def map(self, factors: Array) -> Callable[[Array], Array]:
        """Return the map of points (3, n) of the drawing to where a stretch by factors has them."""

        def moved(points: Array) -> Array:
            rows = [factors @ self.parts(a, points[a]) + self.knots[a][0] for a in range(3)]
            return np.array(rows)

        return moved


def stretch_of(structure: Structure) -> Stretch:
    """Return the stretch of a structure under which its sections stay what they are.

    Raises:
        ValueError: where there is none.
    """
    if structure.mesher != "bricks" or structure.warp is not None:
        raise ValueError(f"{structure.name}: only straight solids of bricks are stretched")
    axes, spans = [], 0
    for axis in range(3):
        axes.append(_axis(structure, axis, spans))
        spans += len({kind for kind in axes[-1][1] if kind.startswith(LENGTH)})
    names = {kind for _, kinds in axes for kind in kinds}
    ordered = sorted(names, key=lambda name: (name != SECTION, name))
    x, y, z = (np.array([ordered.index(kind) for kind in kinds]) for _, kinds in axes)
    found = Stretch((axes[0][0], axes[1][0], axes[2][0]), (x, y, z), tuple(ordered))
    if not all(_kept(structure, found)):
        raise ValueError(f"{structure.name}: a section would not stay what it is")
    return found


def _axis(structure: Structure, axis: int, spans: int) -> tuple[Array, list[str]]:
    """Return the knots of an axis, and the name of the factor of each interval between them.

    Arguments:
        spans: number of those on the axes before.
    """
    across = [m for m in structure.solid_members if abs(structure.axes(m)[0][0, axis]) < 0.5]
    extents = [list(member_boxes(structure, member)) for member in across]
    zones = [(min(b[1][axis] for b in e), max(b[2][axis] for b in e)) for e in extents]
    planes = [v for _, low, high, _ in boxes(structure) for v in (low[axis], high[axis])]
    low, high = min(planes), max(planes)
    joints = [p[axis] for p in structure.joints.values()]
    cuts = [v for v in joints if min(abs(v - p) for p in planes) < CLOSE]
    cuts = [v for v in cuts if not any(a < v < b for a, b in zones)]
    marks = [low, high, *cuts, *(v for zone in zones for v in zone)]
    knots = np.unique(np.clip(marks, low, high))
    knots = knots[np.append(True, np.diff(knots) > CLOSE)]
    # Across a plane in which all joints lie, both sides grow alike and stay mirror images.
    flat = float(np.ptp(joints)) < CLOSE
    kinds = []
    for middle in (knots[1:] + knots[:-1]) / 2:
        if any(a < middle < b for a, b in zones):
            kinds.append(SECTION)
        else:
            kinds.append(f"{LENGTH}-{spans % LENGTHS + 1}")
            spans += not flat
    return knots, kinds


def sizes(structure: Structure, stretch: Stretch, member: Member) -> Array:
    """Return which factors the edges of a member's rectangles go with.

    Returns:
        (rectangles, 4, factors): distances in m of low and high y and of low and high z from the
        member's line, as sums over factors.
    """
    axes, _ = structure.axes(member)
    point = structure.point(member.ends[0])
    found = []
    for y0, y1, z0, z1, _ in structure.sections[member.section].rectangles:
        edges = []
        for row, value in ((1, y0), (1, y1), (2, z0), (2, z1)):
            axis = int(np.abs(axes[row]).argmax())
            sign = float(np.sign(axes[row, axis]))
            there = stretch.parts(axis, np.array([point[axis] + sign * value, point[axis]]))
            edges.append(sign * (there[:, 0] - there[:, 1]))
        found.append(edges)
    return np.array(found)


def _kept(structure: Structure, stretch: Stretch) -> Iterator[bool]:
    """Yield whether each member's section stays symmetric, of one wall, and that of its name."""
    first: dict[str, Array] = {}
    for member in structure.solid_members:
        own = sizes(structure, stretch, member)
        other = first.setdefault(member.section, own)
        yield bool(np.abs(own - other).max() < CLOSE)
        if "shape" in structure.sections[member.section].drawn:
            yield bool(np.abs(own[:, 0::2] + own[:, 1::2]).max() < CLOSE)
            if len(own) > 1:
                gaps = own[1] - own[0]
                yield bool(np.abs(np.abs(gaps) - np.abs(gaps[0])).max() < CLOSE)
        else:
            nominal = np.array([r[:4] for r in structure.sections[member.section].rectangles])
            section = own[..., stretch.names.index(SECTION)]
            yield bool(np.abs(section - nominal).max() < CLOSE)
