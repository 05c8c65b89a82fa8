"""The wireframe of a structure: nodes, elements, joints, sensors and attachments, for drawing."""

from __future__ import annotations

from collections.abc import Iterable, Sized
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta
from scipy.spatial import cKDTree

from femubench.core.case.case import Case
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.effect.places import ALL
from femubench.core.fem.mesh import ON_MEMBER, place_xyz
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.schema.bounds import Real
from femubench.core.typing import FloatArray

Point = Annotated[tuple[Real, ...], Meta(min_length=3, max_length=3)]
Pair = tuple[int, int]
Plane = Literal["in-plane", "out-of-plane", "3d", "matrices"]

MOST_NODES = 3000  # more are no picture, and too much to keep for every job
_DECIMALS = 9  # of a metre


@dataclass(frozen=True, slots=True)
class DrawnJoint:
    """A joint, or a named node of a model that came as matrices; xyz in m, `node` in the mesh."""

    name: str
    xyz: Point
    type: str | None = ""
    node: int = -1


@dataclass(frozen=True, slots=True)
class DrawnMember:
    """A straight member between two joints, by their positions in the list of joints."""

    name: str
    ends: Pair
    elements: Annotated[int, Meta(ge=1)]


@dataclass(frozen=True, slots=True)
class DrawnSensor:
    """A measured point with its signed direction, and that as a vector; xyz in m."""

    label: str
    xyz: Point
    direction: str = ""
    axis: Point = (0.0, 0.0, 0.0)
    rotation: bool = False


@dataclass(frozen=True, slots=True)
class DrawnMass:
    """A known lump; xyz in m."""

    xyz: Point
    kg: Real


@dataclass(frozen=True, slots=True)
class DrawnSpring:
    """A spring to ground along or about an axis; in N/m or N m/rad."""

    xyz: Point
    axis: Point
    stiffness: Real
    rotation: bool = False


@dataclass(frozen=True, slots=True)
class DrawnSupport:
    """A point that is held in some directions; xyz in m."""

    xyz: Point
    fixed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DrawnOutline:
    """The edges of a part of a mesh, with the word of the place that it is; ends in m."""

    place: str
    lines: tuple[tuple[Point, Point], ...]


@dataclass(frozen=True, slots=True)
class Wireframe:
    """A structure as every drawing shows it, checked to be whole.

    Arguments:
        plane: in which it lies and moves; ``matrices`` where there are nodes alone.
        joints, members: members are straight lines between joints.
        nodes: of the mesh in m; empty where the mesh is too fine to draw.
        elements: pairs of nodes; `element_labels` (``member/k``) and `member_of` go with them.
            Without members they are the lines of a test, which belong to none.
        outlines: of the parts of a model of solids and shells.
    """

    plane: Plane
    joints: tuple[DrawnJoint, ...]
    members: tuple[DrawnMember, ...]
    sensors: tuple[DrawnSensor, ...] = ()
    supports: tuple[DrawnSupport, ...] = ()
    masses: tuple[DrawnMass, ...] = ()
    springs: tuple[DrawnSpring, ...] = ()
    nodes: tuple[Point, ...] = ()
    elements: tuple[Pair, ...] = ()
    element_labels: tuple[str, ...] = ()
    member_of: tuple[int, ...] = ()
    outlines: tuple[DrawnOutline, ...] = ()

    def __post_init__(self) -> None:
        check_within((end for m in self.members for end in m.ends), self.joints, "joint")
        check_within((end for ends in self.elements for end in ends), self.nodes, "node")
        if self.nodes:
            check_within((joint.node for joint in self.joints), self.nodes, "node")
        check_within(self.member_of, self.members, "member")
        check_same(self.element_labels, self.elements)
        if self.members:
            check_same(self.member_of, self.elements)

    @property
    def points(self) -> FloatArray:
        """Return all points with a name and all nodes in m, (n, 3)."""
        named = [joint.xyz for joint in self.joints] + [sensor.xyz for sensor in self.sensors]
        ends = self.lines.reshape(-1, 3) if self.outlines else ()
        return np.array([*named, *self.nodes, *ends], dtype=float).reshape(-1, 3)

    @property
    def lines(self) -> FloatArray:
        """Return the ends of all members, or of all edges or elements, (n, 2, 3)."""
        if self.outlines:
            ends = [list(line) for outline in self.outlines for line in outline.lines]
        elif self.members:
            ends = [[self.joints[end].xyz for end in member.ends] for member in self.members]
        else:
            ends = [[self.nodes[end] for end in pair] for pair in self.elements]
        return np.array(ends, dtype=float).reshape(-1, 2, 3)


def check_within(places: Iterable[int], listed: Sized, what: str) -> None:
    """Check that positions are those of a list; raises ValueError naming what is not there."""
    if not all(0 <= place < len(listed) for place in places):
        raise ValueError(f"a {what} that is not in the list")


def check_same(one: Sized, other: Sized) -> None:
    """Check that two lists go in pairs; raises ValueError when their lengths differ."""
    if len(one) != len(other):
        raise ValueError(f"{len(one)} entries instead of {len(other)}")


def wireframe_of(source: Case | Model) -> Wireframe:
    """Return what to draw of a structure.

    Arguments:
        source: a case has sensors, a model has none.

    Examples:
        >>> len(plot.wireframe_of(case).members)
        7
    """
    model = source.model if isinstance(source, Case) else source
    sensors = _sensors(source.measurement.sensors) if isinstance(source, Case) else ()
    xyz = node_positions(model)
    nodes = tuple(map(to_point, xyz)) if len(xyz) <= MOST_NODES else ()
    if model.structure is not None:
        frame, mesh = model.structure.frame, model.structure.mesh
        index = frame.joint_index
        kept = np.full(len(mesh.xyz), -1)
        stays = np.setdiff1d(np.arange(len(mesh.xyz)), mesh.oscillators)
        kept[stays] = np.arange(len(stays))
        rows = range(len(mesh.ends)) if nodes else range(0)
        return Wireframe(
            plane=frame.plane,
            joints=tuple(
                DrawnJoint(joint.name, to_point(joint.xyz), joint.type, k)
                for k, joint in enumerate(frame.joints)
            ),
            members=tuple(
                DrawnMember(m.name, (index[m.ends[0]], index[m.ends[1]]), m.elements)
                for m in frame.members
            ),
            sensors=sensors,
            supports=tuple(
                DrawnSupport(to_point(place_xyz(frame, s.at)), tuple(s.fixed))
                for s in frame.supports
            ),
            masses=tuple(DrawnMass(to_point(place_xyz(frame, m.at)), m.mass) for m in frame.masses),
            springs=tuple(
                DrawnSpring(
                    to_point(place_xyz(frame, spring.at)),
                    tuple(float(name == spring.direction[-1]) for name in "xyz"),
                    spring.stiffness,
                    "r" in spring.direction,
                )
                for spring in frame.springs
            ),
            nodes=tuple(nodes),
            elements=tuple((int(kept[i]), int(kept[j])) for i, j in mesh.ends[: len(rows)]),
            element_labels=tuple(model.structure.labels[: len(rows)]),
            member_of=tuple(mesh.member[: len(rows)].tolist()),
        )
    known = model.geometry.places if isinstance(model.geometry, MatrixGeometry) else {}
    joints = tuple(
        DrawnJoint(name, to_point(at), "", k) for k, (name, at) in enumerate(known.items())
    )
    lines = _test_lines(source, xyz) if isinstance(source, Case) and nodes else ()
    labels = tuple(f"line {k + 1}" for k in range(len(lines)))
    return Wireframe(
        "matrices", joints, (), sensors, nodes=nodes, elements=lines, element_labels=labels,
        outlines=_outlines(source.whole or model if isinstance(source, Case) else model),
    )  # fmt: skip


def _outlines(model: Model) -> tuple[DrawnOutline, ...]:
    """Return the edges of the groups of a model of solids and shells, of all that are few."""
    geometry = model.geometry
    parts = geometry.outlines if isinstance(geometry, MatrixGeometry) else {}
    if sum(map(len, parts.values())) > MOST_NODES:
        return ()
    return tuple(
        DrawnOutline(
            f"group:{name}" if name else ALL,
            tuple((to_point(start), to_point(end)) for start, end in ends),
        )
        for name, ends in parts.items()
    )


def _test_lines(case: Case, nodes: FloatArray) -> tuple[Pair, ...]:
    """Return the lines of a test as pairs of the nodes to which their ends were matched."""
    if case.lines is None or not len(case.lines) or not case.matches:
        return ()
    placed = cKDTree([match.measured for match in case.matches])
    away, which = placed.query(case.lines.reshape(-1, 3))
    # An end where nothing was measured draws nothing.
    found = np.array([match.xyz for match in case.matches])[which]
    node = cKDTree(nodes).query(found)[1].reshape(-1, 2)
    known = (away.reshape(-1, 2) <= ON_MEMBER).all(axis=1) & (node[:, 0] != node[:, 1])
    return tuple(dict.fromkeys((int(i), int(j)) for i, j in node[known]))


def node_positions(model: Model) -> FloatArray:
    """Return where the nodes of a picture are in m: those of the mesh, or of the dofs, (k, 3)."""
    if model.structure is not None:
        mesh = model.structure.mesh
        return np.asarray(np.delete(mesh.xyz, mesh.oscillators, axis=0))
    first = np.unique(model.dofs.node, return_index=True)[1]
    return np.asarray(model.dofs.xyz[first])


def to_point(xyz: Iterable[float]) -> Point:
    """Return a point in m to nine decimals."""
    return tuple(round(float(value), _DECIMALS) for value in xyz)


def _sensors(sensors: Sensors) -> tuple[DrawnSensor, ...]:
    rows = zip(sensors.labels, sensors.xyz, sensors.directions, sensors.axes, strict=True)
    drawn = []
    for label, xyz, direction, axes in rows:
        turns = "r" in direction
        axis = to_point(axes[3:] if turns else axes[:3])
        drawn.append(DrawnSensor(label, to_point(xyz), direction, axis, turns))
    return tuple(drawn)
