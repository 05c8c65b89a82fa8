"""Where the words for places lie on a wireframe: parts of members and points."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import Meta

from femubench.core.case.case import Case
from femubench.core.drawing.wireframe import (
    Point,
    Wireframe,
    check_within,
    to_point,
    wireframe_of,
)
from femubench.core.effect.model_places import ModelPlaces
from femubench.core.effect.places import ALL, Places, bare_place, split_direction
from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame, Place
from femubench.core.fem.group_factors import GROUP, Groups
from femubench.core.fem.mesh import place_xyz
from femubench.core.fem.model import Model
from femubench.core.modal.interfaces import Interfaces

PlaceKind = Literal[
    "all", "joint", "member", "element", "end", "point", "pair", "outline", "elsewhere"
]
_Station = Annotated[float, Meta(ge=0.0, le=1.0)]

_SENSOR = "sensor:"  # or several with + between
_END = 0.125  # how much of its member an end takes in a drawing


@dataclass(frozen=True, slots=True)
class Span:
    """A part of a member, by its position in the list of members, between two stations 0..1."""

    member: int
    start: _Station
    end: _Station


@dataclass(frozen=True, slots=True)
class DrawnPlace:
    """What the word of a place covers; nothing for ``all`` and for what is nowhere in space.

    The points of an outline are the ends of its lines, two for each.
    """

    place: str
    kind: PlaceKind
    spans: tuple[Span, ...] = ()
    points: tuple[Point, ...] = ()


@dataclass(frozen=True, slots=True)
class PlacedWireframe(Wireframe):
    """A structure with the places that something is said of.

    Arguments:
        places: those that do not stand for themselves, as joints, members, ``member/k`` and
            sensors do, may be found here alone.
    """

    places: tuple[DrawnPlace, ...] = ()

    def __post_init__(self) -> None:
        Wireframe.__post_init__(self)
        check_within((s.member for p in self.places for s in p.spans), self.members, "member")

    def place(self, word: str) -> DrawnPlace:
        """Return what the word of a place covers."""
        listed = next((place for place in self.places if place.place == word), None)
        if listed is not None and listed.kind != "elsewhere":
            return listed
        return _plain_place(self, word, split_direction(bare_place(word))[0])


def find_wireframe(source: Case | Model, words: Iterable[str]) -> PlacedWireframe:
    """Return a structure with the places that some words stand for.

    Arguments:
        words: in the grammar of places.
    """
    wireframe = wireframe_of(source)
    model = source.model if isinstance(source, Case) else source
    places = tuple(_place(wireframe, model, word) for word in dict.fromkeys(words))
    return PlacedWireframe(**{n: getattr(wireframe, n) for n in Wireframe.__slots__}, places=places)


def _plain_place(wireframe: Wireframe, word: str, head: str) -> DrawnPlace:
    """Return the place of a joint, a member, an element or a sensor by its name alone."""
    if head == ALL:
        return DrawnPlace(word, "all")
    if lines := _lines(wireframe, head):
        return DrawnPlace(word, "outline", points=tuple(end for line in lines for end in line))
    for joint in wireframe.joints:
        if joint.name == head:
            return DrawnPlace(word, "joint", points=(joint.xyz,))
    name, _, number = head.rpartition("/")
    for k, member in enumerate(wireframe.members):
        if member.name == head:
            return DrawnPlace(word, "member", (Span(k, 0.0, 1.0),))
        count = member.elements
        if member.name == name and number.isdecimal() and 0 < int(number[:7]) <= count:
            span = Span(k, (int(number) - 1) / count, int(number) / count)
            return DrawnPlace(word, "element", (span,))
    named = word.removeprefix(_SENSOR).split("+") if word.startswith(_SENSOR) else [word]
    at = {s.label: s.xyz for s in reversed(wireframe.sensors) if s.label in named}
    return DrawnPlace(word, "point" if at else "elsewhere", points=tuple(at.values()))


def _lines(wireframe: Wireframe, head: str) -> list[tuple[Point, Point]]:
    """Return the edges of a group, or of an interface: those that both parts have.

    Where they have none in common, as with the ground, all of the part with fewer.
    """
    names = [head]
    if head.startswith(Interfaces.PREFIX):
        names = [f"{GROUP}{name}" for name in head.removeprefix(Interfaces.PREFIX).split("|")]
    found = sorted(
        (list(o.lines) for o in wireframe.outlines if o.place in names and o.lines), key=len
    )
    if len(found) < 2:
        return found[0] if found else []
    few, other = found[0], {end for line in found[1] for end in line}
    return [line for line in few if other.issuperset(line)] or few


def _place(wireframe: Wireframe, model: Model, word: str) -> DrawnPlace:
    head, _ = split_direction(bare_place(word))
    plain = _plain_place(wireframe, word, head)
    if plain.kind == "all" or (model.structure is None and plain.kind != "elsewhere"):
        return plain
    if model.structure is None:
        groups = (f"{GROUP}{name}" for name in Groups(model).names(head))
        if drawn := [end for g in groups for line in _lines(wireframe, g) for end in line]:
            return DrawnPlace(word, "outline", points=tuple(drawn))
        with suppress(ModelError):
            pairs = ModelPlaces(model).node_pairs(head)
            ends = [to_point(ModelPlaces(model).nodes[name]) for pair in pairs for name in pair]
            return DrawnPlace(word, "pair", points=tuple(ends))
        return plain
    frame = model.structure.frame
    # A budget has free ends and feet by their type, which is none of the grammar of places.
    alike = [joint.name for joint in frame.joints if joint.family == head]
    if joints := Places(frame).joints_of(head) or alike:
        return DrawnPlace(word, "joint", points=_points(frame, joints))
    if plain.kind in ("member", "element"):
        return plain
    if named := Places(frame).members(head):
        spans = tuple(Span(frame.member_index[name], 0.0, 1.0) for name in named)
        return DrawnPlace(word, "member", spans)
    with suppress(ModelError):
        held = [Places(frame).point(at) for at in Places(frame).supports_of(word)]
        return DrawnPlace(word, "point", points=tuple(to_point(place_xyz(frame, p)) for p in held))
    with suppress(ModelError):
        parts = []
        for end in Places(frame).ends_of(head):
            name, _, joint = end.rpartition("@")
            member = frame.member_index[name]
            first = frame.members[member].ends[0] == joint
            parts.append(Span(member, *((0.0, _END) if first else (1.0 - _END, 1.0))))
        return DrawnPlace(word, "end", tuple(parts))
    with suppress(ModelError):
        at = to_point(place_xyz(frame, Places(frame).point(head)))
        return DrawnPlace(word, "point", points=(at,))
    with suppress(ModelError):
        return DrawnPlace(word, "pair", points=_points(frame, Places(frame).pair(head)))
    return plain


def _points(frame: Frame, joints: Iterable[str]) -> tuple[Point, ...]:
    return tuple(to_point(place_xyz(frame, Place(joint=name))) for name in joints)
