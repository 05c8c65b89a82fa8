"""The sensors of a test beside the structure: units, axes, and the nearest place of each."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import permutations, product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from femubench.core.case.case import Match
from femubench.core.case.faults import Misfit, WrongDirection
from femubench.core.case.frames import Site
from femubench.core.case.schema import LengthUnit
from femubench.core.case.tables import PLACES
from femubench.core.case.units import METRES
from femubench.core.errors import InputError
from femubench.core.fem.mesh import ON_MEMBER
from femubench.core.fem.sensors import Sensors, axis_of, direction_of
from femubench.core.typing import FloatArray

TOLERANCE = 0.01  # of the size of the structure
AXES = 'three of x, y, z with an optional minus, each once and right-handed, e.g. "x,z,-y"'
_EXTENT = (0.1, 1.2)  # of the size of the structure, that of a test of it
_NEAR = 0.05  # of the size of the structure: so far from it half of the sensors may be in a unit
_NAMED = re.compile(r"([+-]?)([xyz])", re.ASCII)


@dataclass(frozen=True)
class Alignment:
    """How coordinates and directions of a test become those of the model.

    Arguments:
        unit: of its coordinates in m; None where the size of the structure tells it.
        turn: the axes of the model in those of the test, (3, 3).
        tolerance: how far a sensor may be from the structure, of the size of the structure.
    """

    unit: float | None
    turn: FloatArray
    tolerance: float

    @classmethod
    def of(cls, unit: LengthUnit | None, frame: str | None, tolerance: float | None) -> Alignment:
        """Return what the keys of a case say; raises Misfit for a frame of axes that is none."""
        turn = np.eye(3) if frame is None else parse_frame(frame)
        known = None if unit is None else METRES[unit]
        return cls(known, turn, TOLERANCE if tolerance is None else tolerance)

    def limit(self, site: Site) -> float:
        """Return how far from a structure a sensor may be in m."""
        return max(self.tolerance * size_of(site.points), ON_MEMBER)

    def direction(self, name: str) -> str:
        """Return a direction of the test as one of the model."""
        if np.array_equal(self.turn, np.eye(3)):
            return name
        axis = axis_of(name)
        return direction_of(np.concatenate([self.turn @ axis[:3], self.turn @ axis[3:]]))


class Placed(NamedTuple):
    """Sensors on a structure.

    Arguments:
        sensors: that fit it.
        matches: where each was taken to sit.
        told: what to say of units and places.
        turn: from coordinates of the test to those of the model in m, (3, 3).
    """

    sensors: Sensors
    matches: tuple[Match, ...]
    told: tuple[str, ...]
    turn: FloatArray


def parse_frame(text: str) -> FloatArray:
    """Return the axes of the model in those of the test, (3, 3).

    Arguments:
        text: ``x,z,-y``: the model's x is the test's x, its y the test's z, its z minus its y.

    Raises:
        Misfit: when these are no three axes of a right-handed system.
    """
    found = [_NAMED.fullmatch(word.strip()) for word in text.split(",")]
    turn = np.zeros((len(found), 3))
    for row, match in zip(turn, found, strict=True):
        if match is not None:
            row["xyz".index(match[2])] = -1.0 if match[1] == "-" else 1.0
    if turn.shape != (3, 3) or abs(np.linalg.det(turn)) != 1.0:
        raise Misfit(f"{text[:40]!r} is no frame of axes", AXES)
    if np.linalg.det(turn) < 0.0:
        raise Misfit(f"{text[:40]!r} is left-handed", AXES)
    return turn


def size_of(points: FloatArray) -> float:
    """Return the diagonal of the box around points in m."""
    return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0


def unit_of(xyz: FloatArray, site: Site, alignment: Alignment) -> LengthUnit:
    """Return the unit in which coordinates fit the structure, by its size: m where that may be.

    Arguments:
        xyz: of the test, finite, (k, 3).
        site: the structure.
        alignment: how the test lies beside it.
    """
    fitting = _units_by_size(xyz, site)
    if "m" in fitting or not fitting:
        return "m"
    turned = xyz @ alignment.turn.T
    gap = {unit: float(np.median(_gaps(turned * METRES[unit], site))) for unit in fitting}
    best = min(fitting, key=gap.__getitem__)
    # One wrong coordinate may make any unit fit by size.
    return best if gap[best] <= _NEAR * size_of(site.points) else "m"


def _units_by_size(xyz: FloatArray, site: Site) -> list[LengthUnit]:
    ratio = size_of(xyz) / (size_of(site.points) or 1.0)
    return [u for u, metres in METRES.items() if _EXTENT[0] <= ratio * metres <= _EXTENT[1]]


def _gaps(xyz: FloatArray, site: Site) -> FloatArray:
    feet = np.array([foot for _, foot in site.nearest(xyz)])
    return np.asarray(np.linalg.norm(feet - xyz, axis=1))


def matches_of(
    labels: Sequence[str], xyz: FloatArray, site: Site, alignment: Alignment, unit: float
) -> list[Match]:
    """Return the nearest place of every sensor, near enough or not.

    Arguments:
        labels: of the sensors.
        xyz: of the test, finite, (k, 3).
        site: the structure.
        alignment: how the test lies beside it.
        unit: of the coordinates in m.
    """
    points = unit * xyz @ alignment.turn.T
    found = zip(labels, points, site.nearest(points), strict=True)
    # What sits where it should keeps its coordinates to the last bit.
    return [
        Match(label, place, at if np.linalg.norm(foot - at) <= ON_MEMBER else foot, at)
        for label, at, (place, foot) in found
    ]


def check_near(match: Match, site: Site, alignment: Alignment, every: FloatArray) -> None:
    """Check that a sensor is not too far from the structure.

    Arguments:
        match: of the sensor.
        site: the structure.
        alignment: how the test lies beside it.
        every: all coordinates of the test as they were given, for advice, (k, 3).

    Raises:
        Misfit: naming the nearest place and the distance.
    """
    limit = alignment.limit(site)
    if match.distance <= limit:
        return
    at, foot = (", ".join(f"{v:.6g}" for v in point) for point in (match.measured, match.xyz))
    what = (
        f"sensor {match.sensor!r} at ({at}) lies {match.distance:.3g} m off the structure, nearest "
        f"{match.place} at ({foot})"
    )
    expected = f"at most {limit:.3g} m (tolerance = {alignment.tolerance:g} of its size)"
    raise Misfit(what, f"{expected}{_advice(every, site, alignment)}")


def span_told(
    matches: Sequence[Match], file: str, site: Site, alignment: Alignment, every: FloatArray
) -> tuple[str, ...]:
    """Return what to say of sensors that lie close together beside the size of the structure.

    Arguments:
        matches: of all sensors.
        file: that lists them.
        site, alignment, every: as in `check_near`.

    Raises:
        Misfit: when they are moved, and lie closer together than they may be moved.
    """
    span = size_of(np.array([match.measured for match in matches]))
    size, limit = size_of(site.points), alignment.limit(site)
    if not ON_MEMBER < span < _EXTENT[0] * size:
        return ()
    what = f"the sensors span {span:.3g} m, the structure {size:.3g} m"
    question = "is one of the units wrong?"
    if span <= limit and any(match.distance > ON_MEMBER for match in matches):
        fitting = bool(_units_by_size(every, site))
        advice = _advice(every, site, alignment) if fitting else f"; {question}"
        expected = f"more than {limit:.3g} m (tolerance = {alignment.tolerance:g} of its size)"
        raise Misfit(what, f"{expected}{advice}")
    return (f"{file}: {what}: {question}",)


def _advice(every: FloatArray, site: Site, alignment: Alignment) -> str:
    """Return the unit and the frame of axes with which all points of a test would fit."""
    limit, units = alignment.limit(site), _units_by_size(every, site)
    if not units and len(every) > 1:
        sizes = f"{size_of(every):.3g} as they stand, the structure {size_of(site.points):.3g} m"
        return f"; the sensors span {sizes}: is one of the units wrong?"
    for unit in units:
        for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
            turn = np.zeros((3, 3))
            turn[range(3), list(order)] = signs
            points = METRES[unit] * every @ turn.T
            if np.linalg.det(turn) > 0.0 and _gaps(points, site).max() <= limit:
                axes = zip(order, signs, strict=True)
                frame = ",".join(f"{'-' if s < 0 else ''}{'xyz'[k]}" for k, s in axes)
                other = METRES[unit] != (alignment.unit or 1.0)
                keys = [f'unit = "{unit}"'] if other else []
                keys += [] if np.array_equal(turn, alignment.turn) else [f'frame = "{frame}"']
                return f"; with {' and '.join(keys)} all fit" if keys else ""
    return ""


def check_apart(
    found: Sequence[tuple[Match, str]], site: Site, alignment: Alignment, every: FloatArray
) -> None:
    """Check that no two sensors of different places went to one place and direction.

    Arguments:
        found: every match and its direction.
        site, alignment, every: as in `check_near`, for advice.

    Raises:
        Misfit: naming both sensors and the place.
    """
    taken: dict[tuple[str, str], Match] = {}
    for match, direction in found:
        way = direction.lstrip("+-")
        other = taken.setdefault((match.place, way), match)
        if np.linalg.norm(other.measured - match.measured) > ON_MEMBER:
            what = (
                f"sensors {other.sensor!r} and {match.sensor!r} both lie nearest to {match.place}, "
                f"direction {way} ({other.distance:.3g} and {match.distance:.3g} m away)"
            )
            expected = "a finer model, or one of the two left out"
            raise Misfit(what, f"{expected}{_advice(every, site, alignment)}")


def fitted_sensors(
    read: Sensors, file: Path, site: Site, alignment: Alignment, wanted: Collection[str] | None
) -> Placed:
    """Return the sensors of a file that a plugin has read, those that fit the structure.

    Files of three components a point list directions that a planar model does not have, and
    points whose place is in another file; such sensors are left out, one that lies off the
    structure is an error.

    Arguments:
        read: what the plugin read.
        file: for messages.
        site: the structure.
        alignment: how the test lies beside it; the unit is detected where it has none.
        wanted: labels with a shape; None for all.

    Raises:
        InputError: when a sensor lies off the structure, or none is left.
    """
    scale = 1.0
    known = np.asarray(np.isfinite(read.xyz).all(axis=1))
    if not known.any():
        raise InputError("sensors without places", file=file, expected=PLACES)
    rows = [
        i for i, label in enumerate(read.labels) if known[i] and (wanted is None or label in wanted)
    ]
    kept: list[tuple[Match, str]] = []
    told: tuple[str, ...] = ()
    if rows:
        xyz = read.xyz[rows]
        unit = unit_of(xyz, site, alignment)
        scale = METRES[unit] if alignment.unit is None else alignment.unit
        matches = matches_of([read.labels[i] for i in rows], xyz, site, alignment, scale)
        ways = [alignment.direction(read.directions[i]) for i in rows]
        found_as = replace(alignment, unit=scale)
        kept, told = _fitting(list(zip(matches, ways, strict=True)), file, site, found_as, xyz)
        if alignment.unit is None and unit != "m":
            told = (_detected(file.name, unit, size_of(xyz) / size_of(site.points)), *told)
    if not kept:
        expected = "nodes with coordinates, in a direction that the model has"
        raise InputError("no sensor fits the structure", file=file, expected=expected)
    found = tuple(match for match, _ in kept)
    places = np.array([match.xyz for match in found])
    labels = tuple(match.sensor for match in found)
    sensors = Sensors(labels, places, tuple(way for _, way in kept))
    return Placed(sensors, found, told, scale * alignment.turn)


def _fitting(
    found: Sequence[tuple[Match, str]],
    file: Path,
    site: Site,
    alignment: Alignment,
    every: FloatArray,
) -> tuple[list[tuple[Match, str]], tuple[str, ...]]:
    """Return the matches whose direction the model has, and what to say of all places.

    Raises:
        InputError: for one too far.
    """
    kept: list[tuple[Match, str]] = []
    try:
        told = span_told([match for match, _ in found], file.name, site, alignment, every)
        for match, direction in found:
            check_near(match, site, alignment, every)
            x, y, z = (float(v) for v in match.xyz)
            with suppress(WrongDirection):
                site.check_sensor((x, y, z), direction)
                kept.append((match, direction))
        check_apart(kept, site, alignment, every)
    except Misfit as misfit:
        raise InputError(misfit.what, file=file, expected=misfit.expected) from None
    return kept, (*told, *told_of([match for match, _ in kept], file.name))


def _detected(file: str, unit: str, ratio: float) -> str:
    return (
        f"{file}: coordinates were taken in {unit}, since in m the sensors would span {ratio:.3g} "
        "times the structure."
    )


def told_of(matches: Sequence[Match], file: str) -> tuple[str, ...]:
    """Return what to say of sensors that were moved to the structure, in one sentence.

    Arguments:
        matches: of all sensors.
        file: that lists them.
    """
    moved = [match for match in matches if match.distance > ON_MEMBER]
    if not moved:
        return ()
    worst = max(moved, key=lambda match: match.distance)
    return (
        f"{len(moved)} of the {len(matches)} sensors of {file} were moved to the nearest place of "
        f"the structure, {worst.sensor} furthest: {worst.distance:.3g} m to {worst.place}.",
    )
