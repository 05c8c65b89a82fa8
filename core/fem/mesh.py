"""Meshing of a frame: nodes, elements, and where the attachments split a member."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from femubench.core.errors import ModelError
from femubench.core.fem.frame import (
    Frame,
    GroundSpring,
    JointSpring,
    Member,
    Oscillator,
    Place,
    Plane,
    PointMass,
    RigidEnd,
    split_half,
)
from femubench.core.typing import BoolArray, FloatArray, IntArray

ON_MEMBER = 1e-6  # m, how far from the axis a sensor may lie
SAME_STATION = 1e-9
# An attachment nearer than this share of an element to a node splits nothing: the piece would be so
# stiff that its rounding errors outweigh what the finer mesh gains (both 1e-7 of a frequency here).
SHORTEST_PIECE = 2e-3


@dataclass(frozen=True)
class Connection:
    """A joint spring as it is meshed: `node` hangs on `base` behind a rigid arm (global, m)."""

    spring: JointSpring
    base: int
    node: int
    arm: FloatArray
    axes: FloatArray


@dataclass(frozen=True)
class Mesh:
    """Nodes and elements of a frame.

    Arguments:
        xyz: node positions in m, (n_nodes, 3); joints come first, in the frame's order.
        ends: node numbers, (n_elements, 2).
        axes: rows are the local x, y, z axes in global components, (n_elements, 3, 3).
        member: index of the member of every element, (n_elements,).
        number: element k of its member, from 1; pieces of a split element share it.
        stations: where an element starts and ends on its member, 0..1, (n_elements, 2).
        rigid: rigid lengths in the stiffness matrix in m, (n_elements, 2).
        rigid_mass: rigid lengths in the mass matrix in m, (n_elements, 2).
        arm_factor: nan for an ordinary element, else the massless arm's rigidity factor.
        oscillators: the node of every oscillator's mass; they come last and belong to no element.
    """

    xyz: FloatArray
    ends: IntArray
    axes: FloatArray
    member: IntArray
    number: IntArray
    stations: FloatArray
    rigid: FloatArray
    rigid_mass: FloatArray
    arm_factor: FloatArray
    connections: tuple[Connection, ...]
    oscillators: IntArray

    def __getstate__(self) -> dict[str, Any]:
        # A tree is made again where it is wanted.
        return {name: value for name, value in vars(self).items() if name != "tree"}

    @cached_property
    def tree(self) -> cKDTree:
        """Return where the nodes lie, to look points up."""
        return cKDTree(self.xyz)

    def node_keys(self, joints: int) -> list[tuple[int, int, bool]]:
        """Return a name of every node that stays the same when other elements are split.

        Member (-1 for a joint, -2 for an oscillator), joint or station in 1e-9 or number, and
        whether it is the tip of an arm.

        Arguments:
            joints: number of joints, which are the first nodes.
        """
        keys = [(-1, node, False) for node in range(len(self.xyz))]
        rows = zip(self.member, np.isfinite(self.arm_factor), self.ends, self.stations, strict=True)
        for member, arm, ends, stations in rows:
            for node, s in zip(ends, stations, strict=True):
                if node >= joints:
                    keys[node] = (int(member), round(float(s) / SAME_STATION), bool(arm))
        for number, node in enumerate(self.oscillators):
            keys[node] = (-2, number, False)
        return keys


def member_axes(frame: Frame, member: Member) -> tuple[FloatArray, float]:
    """Return the local axes (rows) and the length of a member.

    Raises:
        ModelError: when the member has no length, leaves the plane, or `up` lies along it.

    Examples:
        >>> round(fem.member_axes(frame, frame.members[0])[1], 4)
        0.2794
    """
    ends = np.array([[frame.joint(name).xyz for name in member.ends]], dtype=float)
    axes, lengths = _axes(frame.plane, [member], ends)
    return axes[0], float(lengths[0])


def _axes(
    plane: Plane, members: Sequence[Member], ends: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the local axes (rows) and the lengths of members whose ends lie there, (n, 2, 3)."""

    def refuse(wrong: BoolArray, what: str) -> None:
        if wrong.any():
            member = members[int(wrong.argmax())]
            raise ModelError(f"member {member.name!r}{what}", member)

    along = ends[:, 1] - ends[:, 0]
    length = _norm(along)
    refuse(length < ON_MEMBER, " has length zero")
    normal = {"out-of-plane": 2, "in-plane": 1}.get(plane)
    x = along / np.maximum(length, ON_MEMBER)[:, None]
    if normal is not None:
        refuse(np.abs(along[:, normal]) > ON_MEMBER, " leaves the plane of the frame")
        third = np.broadcast_to(np.eye(3)[normal], x.shape)
        turned = _cross(third, x) if plane == "out-of-plane" else _cross(x, third)
        rows = (x, turned, third) if plane == "out-of-plane" else (x, third, turned)
        return np.stack(rows, axis=1), length
    vertical = np.hypot(x[:, 0], x[:, 1]) < 1e-9
    up = np.where(vertical[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    for i, member in enumerate(members):
        if member.up is not None:
            up[i] = member.up
    y = _cross(up, x)
    size = _norm(y)
    refuse(size < 1e-9, ": `up` lies along the member")
    y /= size[:, None]
    return np.stack([x, y, _cross(x, y)], axis=1), length


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the cross products of rows, (n, 3), in a fifth of the time that NumPy's take."""
    first, last = [1, 2, 0], [2, 0, 1]
    found: FloatArray = one[:, first] * other[:, last] - one[:, last] * other[:, first]
    return found


def _norm(vectors: FloatArray) -> FloatArray:
    return np.sqrt((vectors[:, None] @ vectors[:, :, None]).ravel())


@dataclass(frozen=True)
class _Piece:
    """The mesh of one member at which something is attached; its own nodes count from -1 down.

    Arguments:
        xyz: of its own nodes in m, (k, 3).
        rows: two nodes, number, two stations and arm factor of every element, (r, 6).
        arms: how many massless arms stand before the elements.
    """

    xyz: FloatArray
    rows: FloatArray
    connections: tuple[Connection, ...]
    arms: int


class _Attached:
    """The members at which joint springs, masses, springs or supports are, meshed one by one."""

    def __init__(self, frame: Frame, axes: FloatArray, length: FloatArray) -> None:
        self.frame, self.axes, self.length = frame, axes, length
        self.springs = {(s.member, s.joint): s for s in frame.joint_springs}
        self.rigid_ends = {(r.member, r.joint): r for r in frame.rigid_ends}
        self.held = _places([item.at for item in frame.supports])
        attached: tuple[PointMass | GroundSpring | Oscillator, ...]
        attached = (*frame.masses, *frame.springs, *frame.oscillators)
        self.splits = _places([*(item.at for item in attached), *_middles(frame)])
        self.xyz: list[FloatArray] = []
        self.rows: list[tuple[int, int, int, float, float, float]] = []
        self.connections: list[Connection] = []

    @property
    def members(self) -> list[int]:
        """Return the numbers of these members, ascending."""
        names = {*(member for member, _ in self.springs), *self.held, *self.splits}
        return sorted(self.frame.member_index[name] for name in names & {*self.frame.member_index})

    def node(self, xyz: FloatArray) -> int:
        self.xyz.append(xyz)
        return -len(self.xyz)

    def connect(self, m: int, end: int) -> tuple[int, float]:
        """Return the node at which the member starts and the length of the arm before it."""
        member, axes = self.frame.members[m], self.axes[m]
        base = int(self.frame.member_ends[m, end])
        spring = self.springs.get((member.name, member.ends[end]))
        if spring is None:
            return base, 0.0
        arm = axes[0] * spring.arm * (1.0 if end == 0 else -1.0)
        face = self.frame.corners[base] + arm
        if spring.arm_factor is not None and spring.arm > 0.0:
            tip = self.node(face)
            number = 1 if end == 0 else member.elements
            station = spring.arm / float(self.length[m])
            ends = (base, tip) if end == 0 else (tip, base)
            stations = (0.0, station) if end == 0 else (1.0 - station, 1.0)
            self.rows.append((*ends, number, *stations, spring.arm_factor))
            base, arm = tip, np.zeros(3)
        node = self.node(face)
        self.connections.append(Connection(spring, base, node, arm, axes))
        return node, spring.arm

    def piece(self, m: int) -> _Piece:
        """Return the mesh of a member."""
        self.xyz, self.rows, self.connections = [], [], []
        member, length = self.frame.members[m], float(self.length[m])
        first, arm_1 = self.connect(m, 0)
        last, arm_2 = self.connect(m, 1)
        arms = len(self.rows)
        low, high = arm_1 / length, 1.0 - arm_2 / length
        regular = np.linspace(0.0, 1.0, member.elements + 1)[1:-1]
        if high <= low or (len(regular) and (regular[0] <= low or regular[-1] >= high)):
            joint = member.ends[0 if low >= 1.0 - high else 1]  # where the longer arm is
            raise ModelError(
                f"member {member.name!r}: the arm of a joint spring reaches past its end element",
                self.springs[member.name, joint],
            )
        grid = _stations([low, *regular, high], self.held.get(member.name, []), ON_MEMBER / length)
        # Where the end elements are rigid, nothing is split.
        ends = [self.rigid_ends.get((member.name, joint)) for joint in member.ends]
        stiff = [max(e.stiffness_length, e.mass_length) / length if e else 0.0 for e in ends]
        splits = [s for s in self.splits.get(member.name, []) if stiff[0] < s < 1.0 - stiff[1]]
        inner = _stations(grid, splits, SHORTEST_PIECE / member.elements)[1:-1]
        start = self.frame.corners[self.frame.member_ends[m, 0]]
        nodes = [first, *(self.node(start + self.axes[m, 0] * length * s) for s in inner), last]
        for (a, b), (s0, s1) in zip(pairwise(nodes), pairwise([low, *inner, high]), strict=True):
            number = min(int((s0 + s1) / 2 * member.elements) + 1, member.elements)
            self.rows.append((a, b, number, s0, s1, np.nan))
        rows, xyz = np.array(self.rows), np.array(self.xyz).reshape(-1, 3)
        return _Piece(xyz, rows, tuple(self.connections), arms)


def build_mesh(frame: Frame) -> Mesh:
    """Return the mesh of a frame; an attachment between nodes splits the element there.

    Raises:
        ModelError: for a member without length, an arm longer than its element, or a joint spring
            or rigid end at no member end.
    """
    wanted: tuple[JointSpring | RigidEnd, ...] = (*frame.joint_springs, *frame.rigid_ends)
    for spec in wanted:
        at = frame.member_index.get(spec.member)
        if at is None or spec.joint not in frame.members[at].ends:
            raise ModelError(f"there is no member end {spec.member}@{spec.joint}", spec)
    corners, joints = frame.corners.reshape(-1, 3), frame.member_ends
    axes, length = _axes(frame.plane, frame.members, corners[joints])
    attached = _Attached(frame, axes, length)
    pieces = {m: attached.piece(m) for m in attached.members}
    elements = np.array([member.elements for member in frame.members], dtype=np.int64)
    rows, nodes = elements.copy(), elements - 1
    for m, piece in pieces.items():
        rows[m], nodes[m] = len(piece.rows), len(piece.xyz)
    row, node = np.cumsum(rows) - rows, len(corners) + np.cumsum(nodes) - nodes
    # The nodes inside members, where elements are equal.
    within = np.repeat(np.arange(len(nodes)), nodes)
    nth = np.arange(len(within)) - (np.cumsum(nodes) - nodes)[within] + 1
    s = nth * (1.0 / elements)[within]
    along = axes[:, 0] * length[:, None]
    inner = np.asarray(corners[joints[:, 0]][within] + along[within] * s[:, None])
    hung = [place_xyz(frame, item.at) for item in frame.oscillators]
    xyz = np.concatenate([corners, inner, np.reshape(hung, (-1, 3))])
    member = np.repeat(np.arange(len(rows)), rows)
    # The elements of a member are equal.
    k, count = np.arange(len(member)) - row[member], elements[member]
    last = k >= count - 1
    first = np.where(k == 0, joints[member, 0], node[member] + k - 1)
    second = np.where(last, joints[member, 1], node[member] + k)
    step = (1.0 / elements)[member]
    stations = np.stack([k * step, np.where(last, 1.0, (k + 1) * step)], axis=1)
    number = np.minimum((stations.sum(axis=1) / 2 * count).astype(np.int64) + 1, count)
    ends = np.stack([first, second], axis=1)
    arm_factor, connections = np.full(len(member), np.nan), list[Connection]()
    for m, piece in pieces.items():
        own, table = slice(row[m], row[m] + rows[m]), piece.rows
        ends[own] = _renumbered(table[:, :2].astype(np.int64), node[m])
        number[own], stations[own], arm_factor[own] = table[:, 2], table[:, 3:5], table[:, 5]
        xyz[node[m] : node[m] + nodes[m]] = piece.xyz
        for c in piece.connections:
            base, hanging = (int(v) for v in _renumbered(np.array([c.base, c.node]), node[m]))
            connections.append(replace(c, base=base, node=hanging))
    rigid = np.zeros((2, len(member), 2))
    for spec in frame.rigid_ends:
        m = frame.member_index[spec.member]
        end = frame.members[m].ends.index(spec.joint)
        place = row[m] + (rows[m] - 1 if end else pieces[m].arms if m in pieces else 0)
        rigid[:, place, end] = spec.stiffness_length, spec.mass_length
    return Mesh(
        xyz=xyz,
        ends=ends,
        axes=axes[member],
        member=member,
        number=number,
        stations=stations,
        rigid=rigid[0],
        rigid_mass=rigid[1],
        arm_factor=arm_factor,
        connections=tuple(connections),
        oscillators=np.arange(len(xyz) - len(hung), len(xyz)),
    )


def _renumbered(nodes: IntArray, first: int) -> IntArray:
    """Return the numbers in the whole mesh of joints and of a piece's own nodes."""
    return np.where(nodes < 0, first + ~nodes, nodes)


def place_xyz(frame: Frame, place: Place) -> FloatArray:
    """Return where a place lies in m, (3,).

    Raises:
        ModelError: when there is no such joint or member.
    """
    if place.joint is not None:
        if place.joint not in frame.joint_index:
            raise ModelError(f"there is no joint {place.joint!r}")
        return np.asarray(frame.corners[frame.joint_index[place.joint]])
    if place.member is None or place.member not in frame.member_index or place.s is None:
        raise ModelError(f"there is no member {place.member!r}")
    first, second = frame.corners[frame.member_ends[frame.member_index[place.member]]]
    return np.asarray((1.0 - place.s) * first + place.s * second)


def _places(places: Sequence[Place]) -> dict[str, list[float]]:
    """Return the stations of places between joints by member."""
    stations: dict[str, list[float]] = {}
    for place in places:
        if place.member is not None and place.s is not None:
            stations.setdefault(place.member, []).append(place.s)
    return stations


def _middles(frame: Frame) -> list[Place]:
    """Return the middles of elements of which one half has a factor of its own."""
    found = []
    for element, half in (split_half(place) for factor in frame.factors for place in factor.at):
        member, _, number = element.rpartition("/")
        if half and member in frame.member_index and number.isdecimal():
            elements = frame.members[frame.member_index[member]].elements
            found.append(Place(member=member, s=(int(number) - 0.5) / elements))
    return found


def _stations(grid: Sequence[float] | FloatArray, new: list[float], apart: float) -> FloatArray:
    """Return the grid with those new stations inside it that keep a distance to all others."""
    stations = list(grid)
    for s in new:
        inside = stations[0] < s < stations[-1]
        if inside and min(abs(s - other) for other in stations) > apart:
            bisect.insort(stations, s)
    return np.array(stations)


def locate(frame: Frame, xyz: FloatArray) -> Place:
    """Return the joint or the station of a member at a point.

    Raises:
        ModelError: when the point lies further than 1e-6 m from every member.
    """
    place, _, gap = _foot(frame, xyz)
    if gap > ON_MEMBER:
        where = ", ".join(f"{v:g}" for v in xyz)
        raise ModelError(f"point ({where}) lies {gap:.3g} m off the structure")
    return place


def nearest_place(frame: Frame, xyz: FloatArray) -> tuple[str, FloatArray]:
    """Return the joint or the station of a member nearest to a point, and where it is in m.

    Arguments:
        xyz: the point in m, (3,).
    """
    place, foot, _ = _foot(frame, xyz)
    return place.joint or f"{place.member}@{place.s:.4g}", foot


def _foot(frame: Frame, xyz: FloatArray) -> tuple[Place, FloatArray, float]:
    """Return the place nearest to a point, where it is and how far away in m."""
    corners, ends = frame.corners, frame.member_ends
    near = frame.corner_tree.query_ball_point(xyz, ON_MEMBER, return_sorted=True)
    if near:
        distance = np.linalg.norm(corners[near] - xyz, axis=1)
        nearest = near[int(distance.argmin())]
        return Place(joint=frame.joints[nearest].name), corners[nearest], float(distance.min())
    start, along = corners[ends[:, 0]], corners[ends[:, 1]] - corners[ends[:, 0]]
    s = np.einsum("ij,ij->i", xyz - start, along) / np.einsum("ij,ij->i", along, along)
    foot = start + np.clip(s, 0.0, 1.0)[:, None] * along
    gap = np.linalg.norm(xyz - foot, axis=1)
    best = int(gap.argmin())
    station = float(np.clip(s[best], 0.0, 1.0))
    if station in (0.0, 1.0) and gap[best] > ON_MEMBER:
        joint = int(ends[best, int(station)])
        return Place(joint=frame.joints[joint].name), corners[joint], float(gap[best])
    return Place(member=frame.members[best].name, s=station), foot[best], float(gap[best])
