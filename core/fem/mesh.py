"""Meshing of a frame: nodes, elements, and where the attachments split a member."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.frame import (
    Frame,
    GroundSpring,
    JointSpring,
    Member,
    Oscillator,
    Place,
    PointMass,
    RigidEnd,
)
from femubench.core.typing import FloatArray, IntArray

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
        connections: the joint springs.
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
    start, stop = (np.array(frame.joint(name).xyz) for name in member.ends)
    length = float(np.linalg.norm(stop - start))
    if length < ON_MEMBER:
        raise ModelError(f"member {member.name!r} has length zero", member)
    normal = {"out-of-plane": 2, "in-plane": 1}.get(frame.plane)
    if normal is not None and abs(stop[normal] - start[normal]) > ON_MEMBER:
        raise ModelError(f"member {member.name!r} leaves the plane of the frame", member)
    x = (stop - start) / length
    if frame.plane == "out-of-plane":
        return np.array([x, np.cross([0.0, 0.0, 1.0], x), [0.0, 0.0, 1.0]]), length
    if frame.plane == "in-plane":
        return np.array([x, [0.0, 1.0, 0.0], np.cross(x, [0.0, 1.0, 0.0])]), length
    vertical = bool(np.hypot(x[0], x[1]) < 1e-9)
    default = (1.0, 0.0, 0.0) if vertical else (0.0, 0.0, 1.0)
    y = np.cross(np.array(member.up if member.up is not None else default), x)
    if np.linalg.norm(y) < 1e-9:
        raise ModelError(f"member {member.name!r}: `up` lies along the member", member)
    y /= np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)]), length


class _Builder:
    """Collects nodes and elements member by member."""

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self.joint_index = {joint.name: i for i, joint in enumerate(frame.joints)}
        self.xyz: list[FloatArray] = [np.array(joint.xyz, dtype=float) for joint in frame.joints]
        self.rows: list[tuple[int, int, int, int, float, float, float]] = []
        self.rigid: dict[tuple[int, int], RigidEnd] = {}
        self.axes: list[FloatArray] = []
        self.connections: list[Connection] = []
        self.springs = {(s.member, s.joint): s for s in frame.joint_springs}
        self.rigid_ends = {(r.member, r.joint): r for r in frame.rigid_ends}
        self.held = _places([item.at for item in frame.supports])
        attached: tuple[PointMass | GroundSpring | Oscillator, ...]
        attached = (*frame.masses, *frame.springs, *frame.oscillators)
        self.splits = _places([item.at for item in attached])

    def node(self, xyz: FloatArray) -> int:
        self.xyz.append(xyz)
        return len(self.xyz) - 1

    def connect(self, m: int, end: int, axes: FloatArray, length: float) -> tuple[int, float]:
        """Return the node at which the member starts and the length of the arm before it."""
        member = self.frame.members[m]
        base = self.joint_index[member.ends[end]]
        spring = self.springs.get((member.name, member.ends[end]))
        if spring is None:
            return base, 0.0
        arm = axes[0] * spring.arm * (1.0 if end == 0 else -1.0)
        face = self.xyz[base] + arm
        if spring.arm_factor is not None and spring.arm > 0.0:
            tip = self.node(face)
            number = 1 if end == 0 else member.elements
            station = spring.arm / length
            ends = (base, tip) if end == 0 else (tip, base)
            stations = (0.0, station) if end == 0 else (1.0 - station, 1.0)
            self.rows.append((*ends, m, number, *stations, spring.arm_factor))
            base, arm = tip, np.zeros(3)
        node = self.node(face)
        self.connections.append(Connection(spring, base, node, arm, axes))
        return node, spring.arm

    def rigid_length(self, member: Member, end: int) -> float:
        """Return how far from an end nothing can be split, since the element is rigid there."""
        spec = self.rigid_ends.get((member.name, member.ends[end]))
        return 0.0 if spec is None else max(spec.stiffness_length, spec.mass_length)

    def member(self, m: int) -> None:
        member = self.frame.members[m]
        axes, length = member_axes(self.frame, member)
        self.axes.append(axes)
        first, arm_1 = self.connect(m, 0, axes, length)
        last, arm_2 = self.connect(m, 1, axes, length)
        low, high = arm_1 / length, 1.0 - arm_2 / length
        regular = np.linspace(0.0, 1.0, member.elements + 1)[1:-1]
        if high <= low or (len(regular) and (regular[0] <= low or regular[-1] >= high)):
            joint = member.ends[0 if low >= 1.0 - high else 1]  # where the longer arm is
            raise ModelError(
                f"member {member.name!r}: the arm of a joint spring reaches past its end element",
                self.springs[member.name, joint],
            )
        grid = _stations([low, *regular, high], self.held.get(member.name, []), ON_MEMBER / length)
        stiff = [self.rigid_length(member, end) / length for end in (0, 1)]
        splits = [s for s in self.splits.get(member.name, []) if stiff[0] < s < 1.0 - stiff[1]]
        inner = _stations(grid, splits, SHORTEST_PIECE / member.elements)[1:-1]
        start = self.xyz[self.joint_index[member.ends[0]]]
        nodes = [first, *(self.node(start + axes[0] * length * s) for s in inner), last]
        bounds = np.concatenate([[low], inner, [high]])
        for (a, b), (s0, s1) in zip(pairwise(nodes), pairwise(bounds), strict=True):
            number = min(int((s0 + s1) / 2 * member.elements) + 1, member.elements)
            self.rows.append((a, b, m, number, s0, s1, np.nan))
        for end, row in ((0, len(self.rows) - len(nodes) + 1), (1, len(self.rows) - 1)):
            rigid = self.rigid_ends.get((member.name, member.ends[end]))
            if rigid is not None:
                self.rigid[row, end] = rigid

    def mesh(self) -> Mesh:
        for m in range(len(self.frame.members)):
            self.member(m)
        hung = [self.node(place_xyz(self.frame, item.at)) for item in self.frame.oscillators]
        table = np.array(self.rows, dtype=float).reshape(-1, 7)
        member = table[:, 2].astype(np.int64)
        rigid, rigid_mass = np.zeros((len(table), 2)), np.zeros((len(table), 2))
        for (row, end), spec in self.rigid.items():
            rigid[row, end], rigid_mass[row, end] = spec.stiffness_length, spec.mass_length
        return Mesh(
            xyz=np.array(self.xyz).reshape(-1, 3),
            ends=table[:, :2].astype(np.int64),
            axes=np.array(self.axes).reshape(-1, 3, 3)[member],
            member=member,
            number=table[:, 3].astype(np.int64),
            stations=table[:, 4:6],
            rigid=rigid,
            rigid_mass=rigid_mass,
            arm_factor=table[:, 6],
            connections=tuple(self.connections),
            oscillators=np.array(hung, dtype=np.int64),
        )


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


def _check_ends(frame: Frame) -> None:
    ends = {(member.name, name) for member in frame.members for name in member.ends}
    wanted: tuple[JointSpring | RigidEnd, ...] = (*frame.joint_springs, *frame.rigid_ends)
    for spec in wanted:
        if (spec.member, spec.joint) not in ends:
            raise ModelError(f"there is no member end {spec.member}@{spec.joint}", spec)


def _stations(grid: Sequence[float] | FloatArray, new: list[float], apart: float) -> FloatArray:
    """Return the grid with those new stations inside it that keep a distance to all others."""
    stations = list(grid)
    for s in new:
        inside = stations[0] < s < stations[-1]
        if inside and min(abs(s - other) for other in stations) > apart:
            bisect.insort(stations, s)
    return np.array(stations)


def build_mesh(frame: Frame) -> Mesh:
    """Return the mesh of a frame; an attachment between nodes splits the element there.

    Raises:
        ModelError: for a member without length, an arm longer than its element, or a joint spring
            or rigid end at no member end.
    """
    _check_ends(frame)
    return _Builder(frame).mesh()


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
        frame: any.
        xyz: the point in m, (3,).
    """
    place, foot, _ = _foot(frame, xyz)
    return place.joint or f"{place.member}@{place.s:.4g}", foot


def _foot(frame: Frame, xyz: FloatArray) -> tuple[Place, FloatArray, float]:
    """Return the place nearest to a point, where it is and how far away in m."""
    corners, ends = frame.corners, frame.member_ends
    distance = np.linalg.norm(corners - xyz, axis=1)
    nearest = int(distance.argmin())
    if distance[nearest] <= ON_MEMBER:
        return Place(joint=frame.joints[nearest].name), corners[nearest], float(distance[nearest])
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
