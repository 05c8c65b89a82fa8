"""A picture of a structure: its members and blocks as solids, its sensors as dots."""

from __future__ import annotations

import io
import re
from itertools import pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from truths.structure import Structure

Array = npt.NDArray[np.float64]
PIECES = 6  # of a member along its length, so that a warp shows
BOX = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
)
FACES = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def outline(structure: Structure, name: str) -> list[Array]:
    """Return rings of points (corners, 2) in local y and z that a section is drawn by."""
    section = structure.sections[structure.member(name).section]
    return [
        np.array([(a, c), (b, c), (b, d), (a, d)])
        for a, b, c, d, solid in section.rectangles
        if solid
    ]


def polygons(structure: Structure) -> list[tuple[str, Array]]:
    """Return the polygons of a picture, (corners, 3) in m each, with the material."""
    faces: list[tuple[str, Array]] = []
    for member in structure.members:
        axes, length = structure.axes(member)
        start = structure.point(member.ends[0])
        ends = (-member.extend[0], length + member.extend[1])
        pieces = PIECES if structure.warp else 1
        for ring in outline(structure, member.name):
            rings = [
                structure.warped(
                    (start + np.column_stack([np.full(len(ring), x), ring]) @ axes).T
                ).T
                for x in np.linspace(*ends, pieces + 1)
            ]
            faces += [(member.material, rings[0]), (member.material, rings[-1])]
            for one, two in pairwise(rings):
                for i in range(len(ring)):
                    j = (i + 1) % len(ring)
                    faces.append((member.material, np.array([one[i], one[j], two[j], two[i]])))
    for block in structure.blocks:
        if block.material:
            low, high = np.array(block.low), np.array(block.high)
            corners = structure.warped((low + BOX * (high - low)).T).T
            faces += [(block.material, corners[list(face)]) for face in FACES]
    return faces


def picture(structure: Structure) -> str:
    """Return the picture as SVG."""
    mpl.rcParams["svg.hashsalt"] = "truths"
    figure = Figure(figsize=(8.0, 8.0))
    axes: Any = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", computed_zorder=False)
    faces = polygons(structure)
    tones = dict(
        zip(structure.materials, ("#9db4c8", "#d8b98a", "#b5cfa8", "#c9a7c7"), strict=False)
    )
    solids = Poly3DCollection(
        [points for _, points in faces],
        facecolors=[tones.get(material, "#cccccc") for material, _ in faces],
        edgecolors="#37474f",
        linewidths=0.25,
        clip_on=False,
    )
    axes.add_collection3d(solids)
    dots = [structure.warped(structure.point(at)[:, None])[:, 0] for at, _ in structure.sensors]
    axes.scatter(*np.array(dots).T, color="#c62828", s=9, depthshade=False, zorder=5, clip_on=False)
    corners = np.concatenate([points for _, points in faces])
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = np.maximum(high - low, 0.08 * (high - low).max())
    middle = (high + low) / 2
    for axis, centre, half in zip("xyz", middle, size / 2, strict=True):
        getattr(axes, f"set_{axis}lim")(centre - half, centre + half)
    axes.set_box_aspect(size, zoom=1.0)
    axes.view_init(elev=24, azim=-58)
    axes.set_axis_off()
    stream = io.StringIO()
    figure.savefig(
        stream, format="svg", metadata={"Date": None}, bbox_inches="tight", pad_inches=0.05
    )
    # Two decimals of a point are finer than any screen, and a third of the size.
    return re.sub(r"(\d+\.\d{2})\d+", r"\1", stream.getvalue())
