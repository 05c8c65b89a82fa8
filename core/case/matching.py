"""The sensors of a test on the structure: units, axes, and the nearest place of each."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
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
        stated: what to say of units and places.
        turn: from coordinates of the test to those of the model in m, (3, 3).
    """

    sensors: Sensors
    matches: tuple[Match, ...]
    stated: tuple[str, ...]
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


@dataclass(frozen=True)
class Placement:
    """Coordinates of a test and those of the structure.

    Arguments:
        site: the structure.
        alignment: how the test lies to it.
        every: all coordinates of the test as they were given, finite, (k, 3).
    """

    site: Site
    alignment: Alignment
    every: FloatArray

    @cached_property
    def size(self) -> float:
        """Return the size of the structure in m."""
        return size_of(self.site.points)

    @cached_property
    def limit(self) -> float:
        """Return how far from the structure a sensor may be in m."""
        return max(self.alignment.tolerance * self.size, ON_MEMBER)

    @cached_property
    def _units(self) -> list[LengthUnit]:
        """Return the units in which the test is about as large as the structure."""
        ratio = size_of(self.every) / (self.size or 1.0)
        return [u for u, metres in METRES.items() if _EXTENT[0] <= ratio * metres <= _EXTENT[1]]

    def _gaps(self, xyz: FloatArray) -> FloatArray:
        feet = np.array([foot for _, foot in self.site.nearest(xyz)])
        return np.asarray(np.linalg.norm(feet - xyz, axis=1))

    def detect_unit(self) -> LengthUnit:
        """Return the unit in which the test fits the structure: m where that may be."""
        if "m" in self._units or not self._units:
            return "m"
        turned = self.every @ self.alignment.turn.T
        gap = {unit: float(np.median(self._gaps(turned * METRES[unit]))) for unit in self._units}
        best = min(self._units, key=gap.__getitem__)
        # One wrong coordinate may make any unit fit by size.
        return best if gap[best] <= _NEAR * self.size else "m"

    def match_labels(self, labels: Sequence[str]) -> list[Match]:
        """Return the nearest place of every sensor, near enough or not."""
        points = (self.alignment.unit or 1.0) * self.every @ self.alignment.turn.T
        found = zip(labels, points, self.site.nearest(points), strict=True)
        # What sits where it should keeps its coordinates to the last bit.
        return [
            Match(label, place, at if np.linalg.norm(foot - at) <= ON_MEMBER else foot, at)
            for label, at, (place, foot) in found
        ]

    def check_near(self, match: Match) -> None:
        """Check that a sensor is not too far from the structure.

        Raises:
            Misfit: naming the nearest place and the distance.
        """
        if match.distance <= self.limit:
            return
        at, foot = (", ".join(f"{v:.6g}" for v in point) for point in (match.measured, match.xyz))
        what = (
            f"sensor {match.sensor!r} at ({at}) lies {match.distance:.3g} m off the structure, "
            f"nearest {match.place} at ({foot})"
        )
        tolerance = f"(tolerance = {self.alignment.tolerance:g} of its size)"
        raise Misfit(what, f"at most {self.limit:.3g} m {tolerance}{self._advice()}")

    def check_span(self, matches: Sequence[Match], file: str) -> tuple[str, ...]:
        """Return what to say of sensors that are close together for the size of the structure.

        Raises:
            Misfit: when they are moved, and lie closer together than they may be moved.
        """
        span = size_of(np.array([match.measured for match in matches]))
        if not ON_MEMBER < span < _EXTENT[0] * self.size:
            return ()
        what = f"the sensors span {span:.3g} m, the structure {self.size:.3g} m"
        question = "is one of the units wrong?"
        if span <= self.limit and any(match.distance > ON_MEMBER for match in matches):
            advice = self._advice() if self._units else f"; {question}"
            tolerance = f"(tolerance = {self.alignment.tolerance:g} of its size)"
            raise Misfit(what, f"more than {self.limit:.3g} m {tolerance}{advice}")
        return (f"{file}: {what}: {question}",)

    def check_apart(self, found: Sequence[tuple[Match, str]]) -> None:
        """Check that no two sensors of different places went to one place and direction.

        Arguments:
            found: every match and its direction.

        Raises:
            Misfit: naming both sensors and the place.
        """
        taken: dict[tuple[str, str], Match] = {}
        for match, direction in found:
            way = direction.lstrip("+-")
            other = taken.setdefault((match.place, way), match)
            if np.linalg.norm(other.measured - match.measured) > ON_MEMBER:
                what = (
                    f"sensors {other.sensor!r} and {match.sensor!r} both lie nearest to "
                    f"{match.place}, direction {way} ({other.distance:.3g} and "
                    f"{match.distance:.3g} m away)"
                )
                raise Misfit(what, f"a finer model, or one of the two left out{self._advice()}")

    def _advice(self) -> str:
        """Return the unit and the frame of axes with which all points of the test would fit."""
        if not self._units and len(self.every) > 1:
            sizes = f"{size_of(self.every):.3g} as they stand, the structure {self.size:.3g} m"
            return f"; the sensors span {sizes}: is one of the units wrong?"
        for unit in self._units:
            for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
                turn = np.zeros((3, 3))
                turn[range(3), list(order)] = signs
                points = METRES[unit] * self.every @ turn.T
                if np.linalg.det(turn) > 0.0 and self._gaps(points).max() <= self.limit:
                    axes = zip(order, signs, strict=True)
                    frame = ",".join(f"{'-' if s < 0 else ''}{'xyz'[k]}" for k, s in axes)
                    other = METRES[unit] != (self.alignment.unit or 1.0)
                    keys = [f'unit = "{unit}"'] if other else []
                    same = np.array_equal(turn, self.alignment.turn)
                    keys += [] if same else [f'frame = "{frame}"']
                    return f"; with {' and '.join(keys)} all fit" if keys else ""
        return ""


def match_sensors(
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
        alignment: how the test lies to it; the unit is detected where it has none.
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
    stated: tuple[str, ...] = ()
    if rows:
        test = Placement(site, alignment, read.xyz[rows])
        unit = test.detect_unit()
        scale = METRES[unit] if alignment.unit is None else alignment.unit
        test = replace(test, alignment=replace(alignment, unit=scale))
        matches = test.match_labels([read.labels[i] for i in rows])
        try:
            stated = test.check_span(matches, file.name)
            for i, match in zip(rows, matches, strict=True):
                test.check_near(match)
                way = alignment.direction(read.directions[i])
                with suppress(WrongDirection):
                    site.check_sensor(tuple(match.xyz.tolist()), way)
                    kept.append((match, way))
            test.check_apart(kept)
        except Misfit as misfit:
            raise InputError(misfit.what, file=file, expected=misfit.expected) from None
        if alignment.unit is None and unit != "m":
            ratio = size_of(test.every) / test.size
            why = f"in m the sensors would span {ratio:.3g} times the structure."
            stated = (f"{file.name}: coordinates were taken in {unit}, since {why}", *stated)
        stated = (*stated, *describe_matches([match for match, _ in kept], file.name))
    if not kept:
        expected = "nodes with coordinates, in a direction that the model has"
        raise InputError("no sensor fits the structure", file=file, expected=expected)
    found = tuple(match for match, _ in kept)
    places = np.array([match.xyz for match in found])
    labels = tuple(match.sensor for match in found)
    sensors = Sensors(labels, places, tuple(way for _, way in kept))
    return Placed(sensors, found, stated, scale * alignment.turn)


def describe_matches(matches: Sequence[Match], file: str) -> tuple[str, ...]:
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
