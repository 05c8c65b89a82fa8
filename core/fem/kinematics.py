"""From free dofs to the six displacements of every node: planes, supports, rigid arms, joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.assembly import narrow_indices
from femubench.core.fem.beam import BeamProperties, shape_functions
from femubench.core.fem.frame import ACTIVE, Frame, GroundSpring, Oscillator, Place
from femubench.core.fem.links import Linkage, linkage, rigid_arm
from femubench.core.fem.mesh import ON_MEMBER, SAME_STATION, Connection, Mesh, member_axes
from femubench.core.fem.sensors import DIRECTIONS, unit_motions
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

_NO_ARM = 1e-9  # m


@dataclass(frozen=True)
class Kinematics:
    """What moves with what.

    Arguments:
        transform: node displacements = transform @ free dofs, (6 n_nodes, n).
        node: node of every free dof, (n,).
        direction: its direction, (n,).
        axes: its unit motion in (x, y, z, rx, ry, rz), (n, 6); None where all of them move in their
            directions.
        active: which of x, y, z, rx, ry, rz may move at all, (6,).
        unused: displacements of joints at which no member ends and of which no link makes use,
            (k,).
        bodies: joints that follow in all their motions, and what leads them, (l, 2).
    """

    transform: SparseArray
    node: IntArray
    direction: tuple[str, ...]
    axes: FloatArray | None
    active: BoolArray
    unused: IntArray
    bodies: IntArray

    def motions(self, dofs: slice = slice(None)) -> FloatArray:
        """Return the unit motions of free dofs in (x, y, z, rx, ry, rz), (n, 6)."""
        return unit_motions(self.direction[dofs]) if self.axes is None else self.axes[dofs]


def rigid_motions(xyz: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the six motions of a rigid body seen by dofs, (n, 6), rotations about the origin.

    Arguments:
        xyz: positions of the dofs in m, (n, 3).
        axes: their unit motions in (x, y, z, rx, ry, rz), (n, 6).
    """
    return np.hstack([axes[:, :3], np.cross(xyz, axes[:, :3]) + axes[:, 3:]])


def node_at(frame: Frame, mesh: Mesh, place: Place, tolerance: float = SAME_STATION) -> int | None:
    """Return the mesh node at a joint or a station, None between nodes.

    Arguments:
        tolerance: how far from the node's station the place may be.
    """
    if place.joint is not None:
        return _joint_index(frame, place.joint)
    element, s = _element_at(frame, mesh, place)
    ends = frame.members[mesh.member[element]].ends
    for station, joint in zip((0.0, 1.0), ends, strict=True):
        if abs(station - s) < tolerance:
            return _joint_index(frame, joint)
    for end in (0, 1):
        if abs(mesh.stations[element, end] - s) < tolerance:
            return int(mesh.ends[element, end])
    return None


def _joint_index(frame: Frame, name: str) -> int:
    if name not in frame.joint_index:
        raise ModelError(f"there is no joint {name!r}")
    return frame.joint_index[name]


def _element_at(frame: Frame, mesh: Mesh, place: Place) -> tuple[int, float]:
    if place.member is None or place.member not in frame.member_index or place.s is None:
        raise ModelError(f"there is no member {place.member!r}")
    if not -SAME_STATION <= place.s <= 1.0 + SAME_STATION:
        raise ModelError(f"station {place.s:g} of member {place.member!r} is not within 0..1")
    member = frame.member_index[place.member]
    rows = np.arange(*np.searchsorted(mesh.member, [member, member + 1]))  # in order of members
    low, high = mesh.stations[rows, 0], mesh.stations[rows, 1]
    gap = np.maximum(low - place.s, place.s - high)
    return int(rows[gap.argmin()]), place.s


def point_rows(frame: Frame, mesh: Mesh, properties: BeamProperties, place: Place) -> SparseArray:
    """Return displacement and rotation of a point from node displacements, (6, 6 n_nodes).

    Between nodes the element's shape functions interpolate; on a rigid arm it moves as a body.
    """
    block, columns = point_block(frame, mesh, properties, place)
    bounds = len(columns) * np.arange(7)
    shape = (6, 6 * len(mesh.xyz))
    return sp.csr_array((block.ravel(), np.tile(columns, 6), bounds), shape=shape)


def point_block(
    frame: Frame, mesh: Mesh, properties: BeamProperties, place: Place
) -> tuple[FloatArray, IntArray]:
    """Return what moves a point, (6, k), and which node displacements those are, (k,)."""
    node = node_at(frame, mesh, place)
    if node is not None:
        return np.eye(6), 6 * node + np.arange(6)
    element, s = _element_at(frame, mesh, place)
    s0, s1 = mesh.stations[element]
    if s < s0 or s > s1:
        end = 0 if s < s0 else 1
        base = next(c.base for c in mesh.connections if c.node == mesh.ends[element, end])
        ends = [frame.joint(name).xyz for name in frame.members[mesh.member[element]].ends]
        point = np.array(ends[0]) * (1 - s) + np.array(ends[1]) * s
        return rigid_arm(point - mesh.xyz[base]), 6 * base + np.arange(6)
    axes = mesh.axes[element]
    local = shape_functions(properties, element, float((s - s0) / (s1 - s0)))
    turned = (axes.T @ local.reshape(2, 3, 4, 3).transpose(0, 2, 1, 3)) @ axes
    block = turned.transpose(0, 2, 1, 3).reshape(6, 12)
    return block, (6 * mesh.ends[element][:, None] + np.arange(6)).ravel()


def spring_rows(mesh: Mesh, connection: Connection) -> SparseArray:
    """Return the relative local displacements of a joint spring, (n_directions, 6 n_nodes)."""
    six = np.kron(np.eye(2), connection.axes)
    index = [DIRECTIONS.index(name) for name in connection.spring.stiffness]
    block = np.hstack([six, -six @ rigid_arm(connection.arm)])[index]
    columns = np.concatenate(
        [6 * connection.node + np.arange(6), 6 * connection.base + np.arange(6)]
    )
    rows = np.repeat(np.arange(len(index)), 12)
    shape = (len(index), 6 * len(mesh.xyz))
    return sp.csr_array((block.ravel(), (rows, np.tile(columns, len(index)))), shape=shape)


def build_kinematics(
    frame: Frame, mesh: Mesh, directions: Sequence[str] | None = None
) -> Kinematics:
    """Return which node displacements are free and how the others follow from them.

    Arguments:
        directions: what may move; those of the frame's plane by default.
    """
    active = np.isin(DIRECTIONS, ACTIVE[frame.plane] if directions is None else directions)
    free = np.tile(active, (len(mesh.xyz), 1))
    free[mesh.oscillators] = False
    for oscillator, item in zip(mesh.oscillators, frame.oscillators, strict=False):
        free[oscillator, DIRECTIONS.index(item.direction.lstrip("+-"))] = True
    hanging = {connection.node: connection for connection in mesh.connections}
    held = np.zeros(free.shape, dtype=bool)
    for support in frame.supports:
        # The mesh is split at a support.
        number = frame.member_index.get(support.at.member or "")
        if number is None:
            node = node_at(frame, mesh, support.at)
        else:
            member = frame.members[number]
            node = node_at(frame, mesh, support.at, ON_MEMBER / member_axes(frame, member)[1])
        if node is None or node in hanging:
            what = f"the support at {support.at} lies on the arm of a joint spring"
            raise ModelError(what, support)
        held[node, [DIRECTIONS.index(name) for name in support.fixed]] = True
    free &= ~held
    tie, unused = _tie(frame, free, held, active) if frame.links else (None, np.zeros(0, int))
    own: list[tuple[int, FloatArray, tuple[str, ...]]] = []  # node, (6, k) basis, labels
    for node in hanging:
        free[node] = False
        own.append((node, *_own_motion(hanging[node], active)))
    return _assemble_transform(mesh, free, own, hanging, active, tie, unused)


def _tie(
    frame: Frame, free: BoolArray, held: BoolArray, active: BoolArray
) -> tuple[Linkage, IntArray]:
    """Return the rigid links of a frame, and what is unused; what follows is free no more."""
    names, count = list(frame.joint_index), len(frame.joints)
    tie = linkage(frame.links, names, frame.corners, active)
    both = np.argwhere(held[:count] & tie.led)
    if len(both):
        name = names[both[0, 0]]
        support = next(s for s in frame.supports if s.at.joint == name)
        raise ModelError(f"a support holds joint {name!r}, which follows another", support)
    joints = free[:count]
    joints[tie.led] = False
    linked = {name for link in frame.links for name in (link.leads, *link.follows)}
    bare = [i for i, name in enumerate(names) if name in linked and not frame.ends_at(name)]
    used = np.asarray((np.abs(tie.spread) > _NO_ARM).sum(axis=0)).reshape(-1, 6) > 1
    idle = np.zeros(joints.shape, dtype=bool)
    idle[bare] = joints[bare] & ~used[bare]
    joints[idle] = False
    hung: tuple[GroundSpring | Oscillator, ...] = (*frame.springs, *frame.oscillators)
    for item in hung:
        column = DIRECTIONS.index(item.direction.lstrip("+-"))
        if item.at.joint is not None and idle[frame.joint_index[item.at.joint], column]:
            what = f"no member ends at joint {item.at.joint!r} and no link moves it along"
            raise ModelError(f"{what} {DIRECTIONS[column]}", item)
    return tie, np.flatnonzero(idle)


def _own_motion(connection: Connection, active: BoolArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the motions that a hanging node has of its own, as columns, with their labels.

    A block (translation, rotation) that is wholly free keeps the global axes; a partly free one
    moves along the member's axes.
    """
    columns, labels = [], []
    for block in (range(3), range(3, 6)):
        names = [DIRECTIONS[i] for i in block if active[i]]
        sprung = [name for name in names if name in connection.spring.stiffness]
        whole = len(sprung) == len(names)
        for name in sprung:
            i = DIRECTIONS.index(name)
            column = np.zeros(6)
            if whole:
                column[i] = 1.0
            else:
                column[list(block)] = connection.axes[i % 3]
            columns.append(column)
            labels.append(name)
    return np.array(columns).reshape(-1, 6).T, tuple(labels)


def _assemble_transform(
    mesh: Mesh,
    free: BoolArray,
    own: list[tuple[int, FloatArray, tuple[str, ...]]],
    hanging: dict[int, Connection],
    active: BoolArray,
    tie: Linkage | None,
    unused: IntArray,
) -> Kinematics:
    size = 6 * len(mesh.xyz)
    flat = np.flatnonzero(free.ravel())
    apart = [(n, DIRECTIONS.index(label)) for n, _, labels in own for label in labels]
    further = np.array(apart, dtype=np.int64).reshape(-1, 2)
    node, direction = (
        np.concatenate(pair).astype(np.int64)
        for pair in zip(divmod(flat, 6), further.T, strict=True)
    )
    count = len(node)
    rows, cols, data = [flat], [np.arange(len(flat))], [np.ones(len(flat))]
    position = len(flat)
    for n, basis, _ in own:
        i, j = np.nonzero(basis)
        rows.append(6 * n + i)
        cols.append(position + j)
        data.append(basis[i, j])
        position += basis.shape[1]
    triplet = (np.concatenate(data), (np.concatenate(rows), np.concatenate(cols)))
    transform = sp.csr_array(triplet, shape=(size, count))
    if tie is not None:  # joints are the first nodes
        joints = 6 * len(tie.led)
        transform = sp.csr_array(sp.vstack([tie.spread @ transform[:joints], transform[joints:]]))
    # A hanging node may hang on the tip of an arm that is itself free, never on a hanging node.
    for n, basis, _ in own:
        shared = np.eye(6) - basis @ basis.T
        shared[~active] = 0.0
        base = hanging[n].base
        follow = shared @ rigid_arm(hanging[n].arm)
        pick = sp.csr_array(
            (follow.ravel(), (np.repeat(6 * n + np.arange(6), 6), np.tile(np.arange(6), 6))),
            shape=(size, 6),
        )
        transform = transform + pick @ transform[6 * base : 6 * base + 6]
    transform.eliminate_zeros()
    axes = None
    if len(further):
        axes = np.vstack([np.eye(6)[flat % 6], *(basis.T for _, basis, _ in own)])
        order = np.lexsort((direction, node))
        node, direction, axes = node[order], direction[order], axes[order]
        transform = transform[:, order].tocsr()
    return Kinematics(
        transform=narrow_indices(transform),
        node=node,
        direction=tuple(map(DIRECTIONS.__getitem__, direction.tolist())),
        axes=axes,
        active=active,
        unused=unused,
        bodies=np.zeros((0, 2), dtype=np.int64) if tie is None else tie.bodies,
    )
