"""What a drawing of a diagnosed structure needs: joints, members, sensors, and where places are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from femubench.core.case.case import Case
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.effect.places import ALL, ends_of, joints_of, pair_of, point_of, split_direction
from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame, Place
from femubench.core.fem.mesh import place_xyz
from femubench.core.fem.model import Geometry
from femubench.core.fem.sensors import Sensors

Point = tuple[float, float, float]
PlaceKind = Literal["all", "joint", "member", "element", "end", "point", "pair", "elsewhere"]
Plane = Literal["in-plane", "out-of-plane", "3d", "matrices"]

_END = 0.125  # how much of its member an end takes in a drawing
_DECIMALS = 9  # of a metre


@dataclass(frozen=True)
class SketchJoint:
    """A joint, or a node of a model that came as matrices; xyz in m."""

    name: str
    type: str
    xyz: Point


@dataclass(frozen=True)
class SketchMember:
    """A straight member between two joints, by their positions in the list of joints."""

    name: str
    ends: tuple[int, int]
    elements: int


@dataclass(frozen=True)
class SketchSensor:
    """A measured point and its direction; xyz in m."""

    label: str
    xyz: Point
    direction: str


@dataclass(frozen=True)
class SketchSupport:
    """A point that is held in some directions; xyz in m."""

    xyz: Point
    fixed: tuple[str, ...]


@dataclass(frozen=True)
class SketchSpan:
    """A part of a member, by its position in the list of members, between two stations 0..1."""

    member: int
    start: float
    end: float


@dataclass(frozen=True)
class SketchPlace:
    """What the word of a place covers; nothing for ``all`` and for what is nowhere in space."""

    place: str
    kind: PlaceKind
    spans: tuple[SketchSpan, ...] = ()
    points: tuple[Point, ...] = ()


@dataclass(frozen=True)
class Sketch:
    """A structure as a drawing shows it.

    Arguments:
        places: every place that the causes, their rivals, the evidence and the smallest visible
            effects name. Members, ``member/k`` and joints stand for themselves.
    """

    plane: Plane
    joints: tuple[SketchJoint, ...]
    members: tuple[SketchMember, ...]
    sensors: tuple[SketchSensor, ...]
    supports: tuple[SketchSupport, ...]
    places: tuple[SketchPlace, ...]


def sketch_of(case: Case, diagnosis: Diagnosis) -> Sketch:
    """Return the structure of a case with the places that its diagnosis speaks of."""
    words = dict.fromkeys(_words(diagnosis))
    sensors = _sensors(case.measurement.sensors)
    if case.model.structure is None:
        return _of_matrices(case.model.geometry, sensors, words)
    frame = case.model.structure.frame
    index = frame.joint_index
    return Sketch(
        plane=frame.plane,
        joints=tuple(SketchJoint(j.name, j.type, _point(j.xyz)) for j in frame.joints),
        members=tuple(
            SketchMember(m.name, (index[m.ends[0]], index[m.ends[1]]), m.elements)
            for m in frame.members
        ),
        sensors=sensors,
        supports=tuple(
            SketchSupport(_point(place_xyz(frame, s.at)), tuple(s.fixed)) for s in frame.supports
        ),
        places=tuple(_place(frame, word) for word in words),
    )


def _of_matrices(
    geometry: Geometry, sensors: tuple[SketchSensor, ...], words: Iterable[str]
) -> Sketch:
    """Return the nodes of a model that came as matrices; groups of theirs are nowhere."""
    nodes = geometry.places if isinstance(geometry, MatrixGeometry) else {}
    points = {name: _point(xyz) for name, xyz in nodes.items()}
    found = []
    for word in words:
        node = split_direction(word)[0]
        if node in points:
            found.append(SketchPlace(word, "joint", points=(points[node],)))
        else:
            found.append(SketchPlace(word, "all" if word == ALL else "elsewhere"))
    joints = tuple(SketchJoint(name, "", xyz) for name, xyz in points.items())
    return Sketch("matrices", joints, (), sensors, (), tuple(found))


def _words(diagnosis: Diagnosis) -> Iterator[str]:
    yield from (cause.place for cause in diagnosis.causes)
    for rival in diagnosis.rivals:
        yield from rival.place.split(" + ")
    yield from (row.place for row in diagnosis.smallest_visible)
    yield from (row.place for row in diagnosis.locations if row.indicator == "evidence")


def _sensors(sensors: Sensors) -> tuple[SketchSensor, ...]:
    rows = zip(sensors.labels, sensors.xyz, sensors.directions, strict=True)
    return tuple(SketchSensor(label, _point(xyz), direction) for label, xyz, direction in rows)


def _point(xyz: Iterable[float]) -> Point:
    x, y, z = (round(float(value), _DECIMALS) for value in xyz)
    return x, y, z


def _place(frame: Frame, word: str) -> SketchPlace:
    head, _ = split_direction(word)
    if head == ALL:
        return SketchPlace(word, "all")
    joints = joints_of(frame, head)
    if joints:
        points = tuple(_point(place_xyz(frame, Place(joint=name))) for name in joints)
        return SketchPlace(word, "joint", points=points)
    if head in frame.member_index:
        return SketchPlace(word, "member", (SketchSpan(frame.member_index[head], 0.0, 1.0),))
    readers: tuple[Callable[[Frame, str, str], SketchPlace], ...] = (_element, _ends, _at, _pair)
    for reader in readers:
        try:
            return reader(frame, word, head)
        except ModelError:
            continue
    return SketchPlace(word, "elsewhere")


def _element(frame: Frame, word: str, head: str) -> SketchPlace:
    name, _, number = head.rpartition("/")
    if name not in frame.member_index or not number.isdecimal():
        raise ModelError(f"there is no element {head!r}")
    member = frame.member_index[name]
    count = frame.members[member].elements
    k = min(max(int(number), 1), count)
    return SketchPlace(word, "element", (SketchSpan(member, (k - 1) / count, k / count),))


def _ends(frame: Frame, word: str, head: str) -> SketchPlace:
    spans = []
    for end in ends_of(frame, head):
        name, _, joint = end.rpartition("@")
        member = frame.member_index[name]
        first = frame.members[member].ends[0] == joint
        spans.append(SketchSpan(member, *((0.0, _END) if first else (1.0 - _END, 1.0))))
    return SketchPlace(word, "end", tuple(spans))


def _at(frame: Frame, word: str, head: str) -> SketchPlace:
    return SketchPlace(word, "point", points=(_point(place_xyz(frame, point_of(frame, head))),))


def _pair(frame: Frame, word: str, head: str) -> SketchPlace:
    points = tuple(_point(place_xyz(frame, Place(joint=name))) for name in pair_of(frame, head))
    return SketchPlace(word, "pair", points=points)
