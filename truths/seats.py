"""Seats: the nodes of a solid that a sensor, mass or spring of the drawing sits on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import sparse

from truths.elasticity import Matrices
from truths.structure import Place, Structure

Array = npt.NDArray[np.float64]
SLAB = 0.007  # m; half the thickness of the slab of the section that moves with a seat
FEWEST = 8  # nodes of a seat
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def seat_nodes(structure: Structure, matrices: Matrices, place: Place) -> npt.NDArray[np.int64]:
    """Return the nodes of the slab of a member's section around a place.

    Raises:
        ValueError: where no slab within a tenth of the member holds enough nodes.
    """
    name = place[0] if isinstance(place, tuple) else structure.at_joint(place).name
    member = structure.member(name)
    axes, length = structure.axes(member)
    section = structure.sections[member.section]
    local = axes @ (matrices.straight - structure.point(place)[:, None])
    half = np.array([section.width, section.height]) / 2 + 1e-6
    near = (np.abs(local[1]) < half[0]) & (np.abs(local[2]) < half[1])
    for thickness in SLAB * 1.5 ** np.arange(8):
        nodes = np.flatnonzero(near & (np.abs(local[0]) < thickness))
        if len(nodes) >= FEWEST:
            return nodes
        if thickness > length / 10:
            break
    raise ValueError(f"{structure.name}: {len(nodes)} nodes at {place}; a finer mesh is needed")


def rigid_motion(arm: Array) -> Array:
    """Return the motions (3 n, 6) of points at arms (3, n) when a body shifts and turns."""
    motion = np.zeros((3, arm.shape[1], 6))
    motion[range(3), :, range(3)] = 1.0
    # u = t + theta x arm
    motion[0, :, 4], motion[0, :, 5] = arm[2], -arm[1]
    motion[1, :, 3], motion[1, :, 5] = -arm[2], arm[0]
    motion[2, :, 3], motion[2, :, 4] = arm[1], -arm[0]
    return motion.transpose(1, 0, 2).reshape(-1, 6)


def rigid_fit(structure: Structure, matrices: Matrices, place: Place) -> sparse.csr_array:
    """Return the (6, dofs) map to the rigid motion of a place that fits its seat best.

    It observes and loads: a force f at the place acts on the solid as its transpose times f.
    """
    nodes = seat_nodes(structure, matrices, place)
    centre = structure.warped(structure.point(place)[:, None])
    arm = matrices.nodes[:, nodes] - centre
    fit = np.linalg.pinv(rigid_motion(arm))
    columns = (3 * nodes[:, None] + np.arange(3)).ravel()
    row = np.repeat(np.arange(6), len(columns))
    shape = (6, matrices.mass.shape[0])
    return sparse.csr_array((fit.ravel(), (row, np.tile(columns, 6))), shape=shape)


def observed(
    structure: Structure, matrices: Matrices, sensors: tuple[tuple[Place, str], ...]
) -> sparse.csr_array:
    """Return the (sensors, dofs) map to what sensors along x, y, z read."""
    rows = []
    for place, directions in sensors:
        fit = rigid_fit(structure, matrices, place)
        rows += [fit[[DIRECTIONS.index(d)]] for d in directions]
    return sparse.csr_array(sparse.vstack(rows, format="csr"))
