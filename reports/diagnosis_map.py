"""A structure as lines, with what a diagnosis says of every place on it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from femubench.reports.diagnosis_labels import middle_of, names_on
from femubench.reports.diagnosis_svg import drawing, label, line, tag

Data = Mapping[str, Any]
Flat = tuple[float, float]

_WIDTH, _HEIGHT, _MARGIN = 440.0, 340.0, 44.0
_SMALL = 30.0  # margin of a drawing without names
_TURN, _TILT = math.radians(-52.0), math.radians(24.0)
_MOST_MEMBERS, _MOST_SENSORS = 3000, 400
_LEVELS = 5


@dataclass(frozen=True)
class Spot:
    """A place with a value 0..1 and, where it is a cause, its numbers in the list of causes."""

    place: str
    value: float
    causes: str = ""


def structure_map(
    structure: Data, spots: Sequence[Spot], *, name: str, says: str, anchor: str, names: bool = True
) -> Markup | None:
    """Return the structure with its spots, strong ones thick and dark; None for no geometry.

    Arguments:
        structure: the block of the JSON.
        spots: strongest first.
        name, says: what it is, what one sees in it.
        anchor: an id of its own.
        names: whether joints, members and sensors are written down.
    """
    view = _View.of(structure, _MARGIN if names else _SMALL)
    if view is None:
        return None
    finder = _Finder(structure)
    found = [(spot, finder.shape(spot.place)) for spot in spots]
    everywhere = any(shape.all for _, shape in found)
    parts = [*_members(view, structure, everywhere), *_held(view, structure)]
    # Weak ones first, so that strong ones lie on top.
    for number, (spot, shape) in reversed(list(enumerate(found))):
        parts.append(_spot(view, spot, shape, number))
    if names:
        joints = [view.flat(joint["xyz"]) for joint in structure["joints"]]
        parts += [*_sensors(view, structure), *names_on(structure, joints)]
        parts += _badges(view, found)
        parts += _triad(view)
    return drawing(parts, width=_WIDTH, height=view.height, name=name, says=says, anchor=anchor)


def level(value: float) -> int:
    """Return the step 1..5 of the scale for a value 0..1."""
    return min(_LEVELS, max(1, math.ceil(value * _LEVELS)))


@dataclass(frozen=True)
class _Shape:
    """Where a place is: lines and points in space, or all of it."""

    lines: tuple[tuple[Sequence[float], Sequence[float]], ...] = ()
    points: tuple[Sequence[float], ...] = ()
    dashed: bool = False
    all: bool = False


class _Finder:
    """Finds places: those that the block lists, members, ``member/k``, joints and sensors."""

    def __init__(self, structure: Data) -> None:
        self._joints = [joint["xyz"] for joint in structure["joints"]]
        self._members = structure["members"]
        self._places = {place["place"]: place for place in structure["places"]}
        self._by_name = {member["name"]: i for i, member in enumerate(self._members)}
        points = [(s["label"], s["xyz"]) for s in structure["sensors"]]
        self._points = dict([*points, *((j["name"], j["xyz"]) for j in structure["joints"])])

    def shape(self, word: str) -> _Shape:
        """Return where a place is; nowhere is a shape without lines and points."""
        place = self._places.get(word)
        if place is not None:
            lines = tuple(self._line(s["member"], s["start"], s["end"]) for s in place["spans"])
            points = tuple(place["points"])
            if place["kind"] == "pair" and len(points) == 2:
                return _Shape(((points[0], points[1]),), dashed=True)
            return _Shape(lines, points, all=place["kind"] == "all")
        if word in self._by_name:
            return _Shape((self._line(self._by_name[word], 0.0, 1.0),))
        if word in self._points:
            return _Shape(points=(self._points[word],))
        member, _, number = word.rpartition("/")
        if member in self._by_name and number.isdecimal() and len(number) < 7:
            count = self._members[self._by_name[member]]["elements"]
            if 0 < int(number) <= count:
                ends = ((int(number) - 1) / count, int(number) / count)
                return _Shape((self._line(self._by_name[member], *ends),))
        return _Shape(all=word == "all")

    def _line(
        self, member: int, start: float, end: float
    ) -> tuple[Sequence[float], Sequence[float]]:
        first, last = (self._joints[i] for i in self._members[member]["ends"])
        return tuple(
            [a + s * (b - a) for a, b in zip(first, last, strict=True)] for s in (start, end)
        )  # type: ignore[return-value]


@dataclass(frozen=True)
class _View:
    """From space to the page; `axes` are the directions of x, y, z on it."""

    flat: Callable[[Sequence[float]], Flat]
    axes: tuple[tuple[str, Flat], ...]
    height: float

    @classmethod
    def of(cls, structure: Data, margin: float) -> _View | None:
        """Return the view in which the structure fits the page; None where it has no extent."""
        points = [joint["xyz"] for joint in structure["joints"]]
        points += [sensor["xyz"] for sensor in structure["sensors"]]
        if not points:
            return None
        project, axes = _projection(structure["plane"], points)
        flat = [project(point) for point in points]
        (left, right), (low, high) = ((min(side), max(side)) for side in zip(*flat, strict=True))
        wide, tall = right - left, high - low
        if not math.isfinite(wide + tall) or max(wide, tall) <= 0.0:
            return None
        room = _WIDTH - 2.0 * margin, _HEIGHT - 2.0 * margin
        scale = min(r / size for r, size in zip(room, (wide, tall), strict=True) if size > 0.0)
        shift = (_WIDTH - scale * wide) / 2.0

        def on_page(point: Sequence[float]) -> Flat:
            x, y = project(point)
            return shift + scale * (x - left), margin + scale * (high - y)

        return cls(on_page, axes, scale * tall + 2.0 * margin)


def _projection(
    plane: str, points: Sequence[Sequence[float]]
) -> tuple[Callable[[Sequence[float]], Flat], tuple[tuple[str, Flat], ...]]:
    """Return a plan or an elevation of what lies in a plane, else a view from above the corner."""
    sides = [max(column) - min(column) for column in zip(*points, strict=True)]
    thin = [side <= 1e-6 * max(sides) for side in sides]
    pair = {"in-plane": (0, 2), "out-of-plane": (0, 1)}.get(plane)
    if pair is None and any(thin):
        away = 2 if thin[2] else thin.index(True)
        pair = next(p for p in ((0, 1), (0, 2), (1, 2)) if away not in p)
    if pair is not None:
        a, b = pair
        return lambda p: (p[a], p[b]), (("xyz"[a], (1.0, 0.0)), ("xyz"[b], (0.0, 1.0)))
    c, s, up = math.cos(_TURN), math.sin(_TURN), math.sin(_TILT)
    # From the corner that sees the structure wider, so that fewer members hide each other.
    across = [[c * p[0] + side * s * p[1] for p in points] for side in (1.0, -1.0)]
    if max(across[1]) - min(across[1]) > 1.01 * (max(across[0]) - min(across[0])):
        s = -s

    def seen(p: Sequence[float]) -> Flat:
        depth = -s * p[0] + c * p[1]
        return c * p[0] + s * p[1], math.cos(_TILT) * p[2] + up * depth

    units = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return seen, tuple(("xyz"[i], seen(unit)) for i, unit in enumerate(units))


def _members(view: _View, structure: Data, everywhere: bool) -> Iterator[Markup]:
    joints = [view.flat(joint["xyz"]) for joint in structure["joints"]]
    ends = [[joints[i] for i in m["ends"]] for m in structure["members"][:_MOST_MEMBERS]]
    if everywhere:
        yield from (line(a, b, "everywhere") for a, b in ends)
    yield from (line(a, b, "member") for a, b in ends)
    size = 3.0 if structure["members"] else 4.0
    for x, y in joints[:_MOST_MEMBERS]:
        yield tag("circle", cx=x, cy=y, r=size, class_="joint")


def _held(view: _View, structure: Data) -> Iterator[Markup]:
    for support in structure["supports"]:
        x, y = view.flat(support["xyz"])
        held = tag("title", f"held: {', '.join(support['fixed'])}")
        corners = f"{x:.1f},{y + 3:.1f} {x - 8:.1f},{y + 15:.1f} {x + 8:.1f},{y + 15:.1f}"
        yield tag("g", held, tag("polygon", points=corners, class_="support"))


def _spot(view: _View, spot: Spot, shape: _Shape, number: int) -> Markup:
    step = level(spot.value)
    kind = f"spot e{step}"
    parts = [tag("title", f"{spot.place}: {spot.value:.2f}")]
    for start, end in shape.lines:
        a, b = view.flat(start), view.flat(end)
        more: dict[str, str] = {"stroke_dasharray": "9 4"} if shape.dashed else {}
        parts.append(line(a, b, kind, stroke_width=3.0 + 2.0 * step, **more))
    for point in shape.points:
        x, y = view.flat(point)
        parts.append(tag("circle", cx=x, cy=y, r=4.0 + 1.6 * step, class_=f"{kind} disc"))
    return tag("g", *parts, data_at=number)


def _sensors(view: _View, structure: Data) -> Iterator[Markup]:
    sensors = structure["sensors"]
    if len(sensors) > _MOST_SENSORS:
        return
    for sensor in sensors:
        x, y = view.flat(sensor["xyz"])
        said = tag("title", f"sensor {sensor['label']}, {sensor['direction']}")
        corners = f"{x:.1f},{y - 4:.1f} {x + 4:.1f},{y + 3:.1f} {x - 4:.1f},{y + 3:.1f}"
        yield tag("g", said, tag("polygon", points=corners, class_="sensor"))


def _badges(view: _View, found: Iterable[tuple[Spot, _Shape]]) -> Iterator[Markup]:
    """Return the numbers of the causes beside their places, at most four times each."""
    taken: list[Flat] = []
    for spot, shape in found:
        anchors = [middle_of([view.flat(a), view.flat(b)]) for a, b in shape.lines]
        anchors += [view.flat(point) for point in shape.points]
        for x, y in anchors[:4] if spot.causes else ():
            wide = 12.0 + 6.0 * len(spot.causes)
            sides = [(x + 9.0, y - 26.0), (x - 9.0 - wide, y - 26.0)]
            sides += [(x + 9.0, y + 9.0), (x - 9.0 - wide, y + 9.0)]
            clear = (side for side in sides if all(_apart(side, other) for other in taken))
            left, top = next(clear, sides[0])
            taken.append((left, top))
            box = tag("rect", x=left, y=top, width=wide, height=18.0, rx=9.0, class_="badge")
            number = label(left + wide / 2.0, top + 13.0, spot.causes, "badge-number", "middle")
            yield tag("g", box, number)


def _apart(one: Flat, other: Flat) -> bool:
    return abs(one[0] - other[0]) > 24.0 or abs(one[1] - other[1]) > 20.0


def _triad(view: _View) -> Iterator[Markup]:
    x, y = 12.0, view.height - 12.0
    x += 20.0 * max(0.0, *(-across for _, (across, _) in view.axes))
    for name, (across, up) in view.axes:
        tip = x + 20.0 * across, y - 20.0 * up
        yield line((x, y), tip, "axis")
        yield label(x + 28.0 * across, y - 28.0 * up + 4.0, name, "tick", "middle")
