"""Masses and springs put on a meshed frame, whose elements are split where they sit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp

from femubench.core.fem.beam import BeamProperties
from femubench.core.fem.frame import GroundSpring, Oscillator, PointMass
from femubench.core.fem.kinematics import Kinematics, node_at
from femubench.core.fem.mesh import SHORTEST_PIECE
from femubench.core.fem.meshed_frame import MeshedFrame
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.typing import AnyArray, FloatArray, IntArray, SparseArray

_Meshed = TypeVar("_Meshed", bound=MeshedFrame)
# What follows from mesh and kinematics alone, so that it stays where no element is split.
_OF_THE_MESH = (
    *("gather", "plan", "spring_rows", "labels", "spring_labels", "label_index"),
    *("place_index", "member_labels", "spring_index", "element_ends", "joint_ends", "active_local"),
)


@dataclass(frozen=True)
class MatrixChange:
    """What attachments add to the matrices, on the dofs of the model and new ones behind them.

    Arguments:
        mass, stiffness: sparse, (n + k, n + k), with entries at few dofs.
        ground: what of the stiffness is springs to ground, (n + k, n + k).
    """

    mass: SparseArray
    stiffness: SparseArray
    ground: SparseArray


def attach(
    structure: _Meshed, masses: Sequence[PointMass], springs: Sequence[GroundSpring]
) -> tuple[_Meshed, MatrixChange] | None:
    """Return a structure with further attachments, and what they add to its matrices.

    The nodes of split elements, and their dofs, come behind all others.

    Arguments:
        structure: with its present parameters, which stay.

    Returns None where the frame has to be meshed anew: under a preload or its weight no change is
    local, and an attachment that was there between two nodes moves with the pieces of its element.

    Raises:
        ModelError: when an attachment lies off the structure.
    """
    frame = structure.frame.with_attachments(tuple(masses), tuple(springs))
    if frame.preloads or frame.gravity or _unused(structure, springs):
        return None
    stations: dict[int, list[float]] = {}
    for at in (*(item.at for item in masses), *(item.at for item in springs)):
        m = frame.member_index.get(at.member or "")
        if m is not None and at.s is not None:
            stations.setdefault(m, []).append(at.s)
    new, whole = replace(structure, frame=frame), len(structure.mesh.ends)
    origin = np.arange(whole)
    for m, s in ((m, s) for m, found in stations.items() for s in found):
        rows = np.flatnonzero((new.mesh.member == m) & np.isnan(new.mesh.arm_factor))
        low, high = new.mesh.stations[rows, 0], new.mesh.stations[rows, 1]
        grid = np.append(low, high[-1])
        first = np.linalg.norm(np.diff(new.mesh.xyz[new.mesh.ends[rows[0]]], axis=0))
        metre = first / (high[0] - low[0])
        stiff = np.maximum(new.mesh.rigid[rows], new.mesh.rigid_mass[rows]) / metre
        inside = max(grid[0], stiff[0, 0]) < s < min(grid[-1], 1.0 - stiff[-1, 1])
        # Nothing is split too near to a node.
        if inside and np.abs(grid - s).min() > SHORTEST_PIECE / frame.members[m].elements:
            element = int(rows[np.searchsorted(grid, s) - 1])
            # Something else may hang on the member between two of its nodes.
            old, member = structure.frame, frame.members[m].name
            attached: tuple[PointMass | GroundSpring | Oscillator, ...]
            attached = (*old.masses, *old.springs, *old.oscillators)
            on = (item.at for item in attached if item.at.member == member)
            if any(node_at(old, structure.mesh, place) is None for place in on):
                return None
            new = _with_split(new, element, s)
            origin = _doubled(origin, element)
    if len(origin) == whole:
        kept = {name: value for name, value in vars(structure).items() if name in _OF_THE_MESH}
        new.__dict__.update(kept)
    mass, ground = new.assemble_attachments(masses, springs)
    more_mass, stiffness = _of_pieces(structure, new, origin)
    return new, MatrixChange(mass + more_mass, ground + stiffness, ground)


def _unused(structure: MeshedFrame, springs: Sequence[GroundSpring]) -> bool:
    """Tell whether a spring hangs on a joint at which nothing else moves."""
    joints, idle = structure.frame.joint_index, set(structure.kinematics.unused.tolist())
    return bool(idle) and any(
        6 * joints[item.at.joint or ""] + DIRECTIONS.index(item.direction.lstrip("+-")) in idle
        for item in springs
        if item.at.joint in joints
    )


def _doubled(array: AnyArray, row: int) -> AnyArray:
    return np.insert(array, row, array[row], axis=0)


def _with_split(structure: _Meshed, element: int, s: float) -> _Meshed:
    """Return the structure with one element in two at a station of its member."""
    mesh, p, e = structure.mesh, structure.properties, element
    low, high = mesh.stations[e]
    share, node = (s - low) / (high - low), len(mesh.xyz)
    first, last = mesh.xyz[mesh.ends[e]]
    twice: dict[str, Any] = {
        name: _doubled(getattr(mesh, name), e)
        for name in ("ends", "axes", "member", "number", "stations", "arm_factor")
    }
    twice["ends"][e, 1] = twice["ends"][e + 1, 0] = node
    twice["stations"][e, 1] = twice["stations"][e + 1, 0] = s
    for name in ("rigid", "rigid_mass"):
        twice[name] = _doubled(getattr(mesh, name), e)
        twice[name][e, 1] = twice[name][e + 1, 0] = 0.0
    xyz = np.vstack([mesh.xyz, (1.0 - share) * first + share * last])
    pieces = {f.name: _doubled(getattr(p, f.name), e) for f in fields(BeamProperties)}
    pieces["length"][e : e + 2] *= [share, 1.0 - share]
    for name, row in (("1", e + 1), ("2", e)):
        pieces[f"rigid_{name}"][row] = pieces[f"rigid_mass_{name}"][row] = 0.0
    return replace(
        structure,
        mesh=replace(mesh, xyz=xyz, **twice),
        kinematics=_with_node(structure.kinematics, node),
        properties=BeamProperties(**pieces),
    )


def _with_node(kinematics: Kinematics, node: int) -> Kinematics:
    """Return the kinematics with one more node, which moves freely."""
    old, free = kinematics.transform, np.flatnonzero(kinematics.active)
    count = old.shape[1]
    starts = old.nnz + np.concatenate([[0], np.cumsum(kinematics.active)])
    transform = sp.csr_array(
        (
            np.append(old.data, np.ones(len(free))),
            np.append(old.indices, count + np.arange(len(free))),
            np.append(old.indptr, starts[1:]),
        ),
        shape=(old.shape[0] + 6, count + len(free)),
    )
    axes = kinematics.axes
    return replace(
        kinematics,
        transform=transform,
        node=np.append(kinematics.node, np.full(len(free), node)),
        direction=(*kinematics.direction, *(DIRECTIONS[i] for i in free)),
        axes=None if axes is None else np.vstack([axes, np.eye(6)[free]]),
    )


def _of_pieces(
    old: MeshedFrame, new: MeshedFrame, origin: IntArray
) -> tuple[SparseArray, SparseArray]:
    """Return mass and stiffness of the pieces of split elements less those of the whole ones.

    Arguments:
        origin: the old element of every new one, (n_elements,).
    """
    size = new.kinematics.transform.shape[1]
    pieces = np.flatnonzero(np.bincount(origin)[origin] > 1)
    mass, stiffness = sp.csc_array((size, size)), sp.csc_array((size, size))
    for frame, rows, sign in ((new, pieces, 1.0), (old, np.unique(origin[pieces]), -1.0)):
        if len(rows) == 0:
            continue
        nodes = frame.mesh.ends[rows]
        lines = (6 * nodes[:, :, None] + np.arange(6)).ravel()
        turn = sp.block_diag([sp.block_diag([axes] * 4) for axes in frame.mesh.axes[rows]])
        local = sp.csr_array(turn) @ frame.kinematics.transform[lines]
        local.resize((local.shape[0], size))
        batch = frame.properties.take(rows)
        for k, matrices in ((0, batch.mass_matrices()), (1, batch.stiffness_matrices())):
            part = local.T @ sp.block_diag(list(sign * matrices), format="csr") @ local
            mass, stiffness = (mass + part, stiffness) if k == 0 else (mass, stiffness + part)
    return sp.csc_array(mass), sp.csc_array(stiffness)


def grow_matrix(matrix: SparseArray, size: int) -> SparseArray:
    """Return a matrix with empty rows and columns behind its own, sparse (size, size)."""
    larger = matrix.copy()
    larger.resize((size, size))
    return larger


def few_dofs(matrices: Sequence[SparseArray]) -> tuple[IntArray, list[FloatArray]]:
    """Return the dofs at which sparse matrices have entries, (t,), and the blocks there, (t, t)."""
    entries = [sp.coo_array(matrix) for matrix in matrices]
    dofs = np.unique(np.concatenate([e.row for e in entries] + [e.col for e in entries]))
    blocks = []
    for e in entries:
        block = np.zeros((len(dofs), len(dofs)))
        np.add.at(block, (np.searchsorted(dofs, e.row), np.searchsorted(dofs, e.col)), e.data)
        blocks.append(block)
    return dofs, blocks
