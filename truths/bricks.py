"""Meshes of bricks for members along the axes: a grid of planes, of which solid cells are kept."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from truths.solid import Solid
from truths.structure import Member, Structure

Array = npt.NDArray[np.float64]
CLOSE = 1e-7  # m; planes nearer than this are one
ZONE = 1.2  # of the deepest section: so far around a joint cells keep their size
GROWTH = 4.0  # of the cells elsewhere, where a section bends as a beam does
# Corners of scikit-fem's hexahedron as steps along x, y, z.
CORNERS = np.array(
    [(0, 0, 0), (0, 1, 0), (1, 0, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1), (1, 1, 1)]
)

Box = tuple[str, Array, Array, str]  # part, low and high corner, material or "" for a void


def member_boxes(structure: Structure, member: Member) -> Iterator[Box]:
    """Yield the boxes of a member's section, drawn along its axis.

    Raises:
        ValueError: where a member does not run along an axis.
    """
    axes, length = structure.axes(member)
    if np.abs(np.abs(axes).max(axis=1) - 1).max() > 1e-9:
        raise ValueError(f"member {member.name} of {structure.name} runs askew: no bricks fit it")
    section = structure.sections[member.section]
    start = structure.point(member.ends[0])
    for y0, y1, z0, z1, solid in section.rectangles:
        local = np.array([[-member.extend[0], y0, z0], [length + member.extend[1], y1, z1]])
        corners = start + local @ axes
        yield member.name, corners.min(axis=0), corners.max(axis=0), member.material * solid


def boxes(structure: Structure) -> list[Box]:
    """Return everything that is painted, in order; the later covers the earlier."""
    blocks = [
        (b.first, (b.name, np.array(b.low), np.array(b.high), b.material)) for b in structure.blocks
    ]
    painted = [box for first, box in blocks if first]
    painted += [box for member in structure.members for box in member_boxes(structure, member)]
    return painted + [box for first, box in blocks if not first]


def planes(structure: Structure, painted: list[Box], axis: int, size: float) -> Array:
    """Return the grid's planes across one axis, at most `size` (m) apart near joints."""
    found = [value for _, low, high, _ in painted for value in (low[axis], high[axis])]
    for member in structure.members:
        axes, _ = structure.axes(member)
        if member.weld and abs(axes[0, axis]) > 0.5:
            found += [_weld_plane(structure, member, end, axis) for end in (0, 1)]
    found += [
        float(structure.point(at)[axis])
        for at in structure.seats
        if abs(structure.axes(structure.member(at[0]))[0][0, axis]) > 0.5
    ]
    for clamp in structure.clamps:
        found += [clamp.low[axis], clamp.high[axis]]
    inside = (min(low[axis] for _, low, _, _ in painted), max(b[axis] for _, _, b, _ in painted))
    lines = np.unique([v for v in found if inside[0] - CLOSE <= v <= inside[1] + CLOSE])
    lines = lines[np.append(True, np.diff(lines) > CLOSE)]
    joints = np.unique([point[axis] for point in structure.joints.values()])
    depth = max(max(s.width, s.height) for s in structure.sections.values())
    zones = np.concatenate([joints - ZONE * depth, joints + ZONE * depth])
    if structure.graded:
        lines = _with(lines, zones, size)
    pieces = []
    for a, b in pairwise(lines):
        near = np.abs((a + b) / 2 - joints).min() < ZONE * depth
        wanted = size if near or not structure.graded else GROWTH * size
        pieces.append(np.linspace(a, b, int(np.ceil((b - a) / wanted - 1e-6)) + 1)[:-1])
    return np.append(np.concatenate(pieces), lines[-1])


def _with(lines: Array, more: Array, size: float) -> Array:
    """Return planes with more of them, where those leave no cell thinner than half a size."""
    inside = more[(more > lines[0]) & (more < lines[-1])]
    far = np.array([np.abs(lines - plane).min() > size / 2 for plane in inside], dtype=bool)
    return np.unique(np.concatenate([lines, inside[far]]))


def face_of(structure: Structure, member: Member, end: int) -> float:
    """Return the distance from a member's end joint to the face of the members that cross it, m."""
    joint, (axes, _) = member.ends[end], structure.axes(member)
    depths = [0.0]
    for other in structure.members:
        if other is member or joint not in other.ends:
            continue
        across, _ = structure.axes(other)
        section = structure.sections[other.section]
        if abs(across[0] @ axes[0]) < 0.5:
            sizes = (
                abs(across[1] @ axes[0]) * section.width + abs(across[2] @ axes[0]) * section.height
            )
            depths.append(float(sizes) / 2)
    return max(depths)


def weld_reach(structure: Structure, member: Member, end: int) -> tuple[float, float]:
    """Return where the weld at an end begins and ends, as distances from its joint, m."""
    face = face_of(structure, member, end)
    return face, face + member.weld


def _weld_plane(structure: Structure, member: Member, end: int, axis: int) -> float:
    inwards = structure.axes(member)[0][0] * (1 if end == 0 else -1)
    reach = weld_reach(structure, member, end)[1]
    return float(structure.joints[member.ends[end]][axis] + reach * inwards[axis])


def brick_mesh(structure: Structure, size: float, like: Structure | None = None) -> Solid:
    """Mesh a structure with bricks no longer than `size` (m), in the planes of `like` if given."""
    painted, source = boxes(structure), like or structure
    grid = [planes(source, boxes(source), axis, size) for axis in range(3)]
    middles = [(line[1:] + line[:-1]) / 2 for line in grid]
    names = tuple(dict.fromkeys(name for name, *_ in painted))
    materials = tuple(structure.materials)
    shape = tuple(len(m) for m in middles)
    part = np.full(shape, -1)
    material = np.full(shape, -1)
    for name, low, high, kind in painted:
        window = tuple(
            slice(*np.searchsorted(middles[axis], (low[axis], high[axis]))) for axis in range(3)
        )
        part[window] = names.index(name) if kind else -1
        material[window] = materials.index(kind) if kind else -1
    solid = np.argwhere(part >= 0)
    stride = np.array([(shape[1] + 1) * (shape[2] + 1), shape[2] + 1, 1])
    corners = (solid[None, :, :] + CORNERS[:, None, :]) @ stride
    used, cells = np.unique(corners, return_inverse=True)
    xyz = np.unravel_index(used, tuple(n + 1 for n in shape))
    points = np.array([grid[axis][xyz[axis]] for axis in range(3)])
    chosen = [structure.materials[materials[i]] for i in material[tuple(solid.T)]]
    return Solid(
        points=points,
        cells=cells.reshape(8, -1),
        part=part[tuple(solid.T)],
        parts=names,
        modulus=np.array([m.E for m in chosen]),
        poisson=np.array([m.nu for m in chosen]),
        density=np.array([m.rho for m in chosen]),
    )
