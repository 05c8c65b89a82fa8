"""The sensors of a test on the structure: units, axes, and the nearest place of each."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import permutations, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from femubench.core.case.case import Match
from femubench.core.case.faults import Misfit, Remedy, WrongDirection
from femubench.core.case.frames import FrameSite, Site
from femubench.core.case.nodes import BETWEEN
from femubench.core.case.schema import LARGEST, LengthUnit, MeasurementSpec
from femubench.core.case.tables import PLACES
from femubench.core.case.units import METRES
from femubench.core.errors import InputError
from femubench.core.fem.frame import ACTIVE
from femubench.core.fem.mesh import ON_MEMBER
from femubench.core.fem.sensors import Sensors, axis_of, direction_of, moved_names
from femubench.core.typing import FloatArray

TOLERANCE = 0.01  # of the size of the structure
AXES = 'three of x, y, z with an optional minus, each once and right-handed, e.g. "x,z,-y"'
_EXTENT = (0.1, 1.2)  # of the size of the structure, that of a test of it
_NEAR = 0.05  # of the size of the structure: so far from it most sensors of a fit may be
_MOST = 0.8  # of the sensors must fit: the others may have a wrong place
_AS_WELL = 1.25  # times the distance of the best fit, within which another one fits as well
_FAR = 4.0  # times the distance that most sensors keep: one beyond has a wrong place
_STEPS = 10  # of moving a test to the places nearest to it
_STATIONS = 41  # points of a member, from which axes and units are sought
_NAMED = re.compile(r"([+-]?)([xyz])", re.ASCII)


@dataclass(frozen=True)
class Alignment:
    """How coordinates and directions of a test become those of the model.

    Arguments:
        unit: of its coordinates in m; None where the size of the structure tells it.
        turn: the axes of the model in those of the test, (3, 3).
        tolerance: how far a sensor may be from the structure, of the size of the structure.
        origin: of the test's origin in m along the axes of the model, (3,).
        without: labels of sensors that are left out.
        model_unit: of a model that comes in files; None of one that is in m by definition.
        directions: the axes of the model in those of the directions, (3, 3); None for `turn`.
    """

    unit: float | None
    turn: FloatArray
    tolerance: float
    origin: FloatArray = field(default_factory=lambda: np.zeros(3))
    without: Collection[str] = ()
    model_unit: LengthUnit | None = None
    directions: FloatArray | None = None

    @classmethod
    def of(cls, spec: MeasurementSpec, model_unit: LengthUnit | None = None) -> Alignment:
        """Return what the keys of a case say; raises Misfit for a frame of axes that is none."""
        return cls(
            None if spec.unit is None else METRES[spec.unit],
            np.eye(3) if spec.frame is None else parse_frame(spec.frame),
            TOLERANCE if spec.tolerance is None else spec.tolerance,
            np.array(spec.origin, dtype=float),
            spec.without,
            model_unit,
            None if spec.directions is None else parse_frame(spec.directions),
        )

    def moved(self, xyz: FloatArray) -> FloatArray:
        """Return coordinates of the test as those of the model in m, (..., 3)."""
        return np.asarray((self.unit or 1.0) * xyz @ self.turn.T + self.origin)

    def direction(self, name: str) -> str:
        """Return a direction of the test as one of the model."""
        turn = self.turn if self.directions is None else self.directions
        if np.array_equal(turn, np.eye(3)):
            return name
        return direction_of(np.kron(np.eye(2), turn) @ axis_of(name))


class Placed(NamedTuple):
    """Sensors on a structure.

    Arguments:
        stated: what to say of units and places.
        alignment: by which coordinates of the test become those of the model.
    """

    sensors: Sensors
    matches: tuple[Match, ...]
    stated: tuple[str, ...]
    alignment: Alignment


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
        every: all coordinates of the test as they were given, finite, (k, 3).
    """

    site: Site
    alignment: Alignment
    every: FloatArray
    labels: Sequence[str] = ()
    directions: Sequence[str] = ()

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
        tried = {unit: replace(self.alignment, unit=METRES[unit]) for unit in self._units}
        gap = {u: float(np.median(self._gaps(way.moved(self.every)))) for u, way in tried.items()}
        best = min(self._units, key=gap.__getitem__)
        # One wrong coordinate may make any unit fit by size.
        return best if gap[best] <= _NEAR * self.size else "m"

    def in_its_unit(self, file: str) -> tuple[Placement, tuple[str, ...]]:
        """Return it in the unit that is stated or seen from its size, and what to say of that."""
        if self.alignment.unit is not None:
            return self, ()
        unit = self.detect_unit()
        found = replace(self, alignment=replace(self.alignment, unit=METRES[unit]))
        if unit == "m":
            return found, ()
        why = (
            f"in m the sensors would span {size_of(self.every) / self.size:.3g} times the structure"
        )
        return found, (f"{file}: coordinates were taken in {unit}, since {why}.",)

    def match_labels(self, labels: Sequence[str]) -> list[Match]:
        """Return the nearest place of every sensor, near enough or not."""
        points = self.alignment.moved(self.every)
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
        raise self._misfit(what, f"at most {self.limit:.3g} m {tolerance}")

    def check_span(self, matches: Sequence[Match], file: str) -> tuple[str, ...]:
        """Return what to say of sensors that are close together for the size of the structure.

        Raises:
            Misfit: when they are moved, and lie closer together than they may be moved.
        """
        span = size_of(np.array([match.measured for match in matches]))
        if not ON_MEMBER < span < _EXTENT[0] * self.size:
            return ()
        what = f"the sensors span {span:.3g} m, the structure {self.size:.3g} m"
        if span <= self.limit and any(match.distance > ON_MEMBER for match in matches):
            tolerance = f"(tolerance = {self.alignment.tolerance:g} of its size)"
            raise self._misfit(what, f"more than {self.limit:.3g} m {tolerance}")
        return (f"{file}: {what}: is one of the units wrong?",)

    def check_apart(self, found: Sequence[tuple[Match, str]]) -> None:
        """Check that no two sensors of different places went to one place and direction.

        Raises:
            Misfit: naming both sensors and the place.
        """
        taken: dict[tuple[object, ...], Match] = {}
        for match, direction in found:
            way = direction.lstrip("+-")
            x, y, z = np.round(match.xyz, 6).tolist()
            other = taken.setdefault((match.place, x, y, z, way), match)
            if np.linalg.norm(other.measured - match.measured) > ON_MEMBER:
                what = (
                    f"sensors {other.sensor!r} and {match.sensor!r} both lie nearest to "
                    f"{match.place}, direction {way} ({other.distance:.3g} and "
                    f"{match.distance:.3g} m away)"
                )
                left_out = f'without = ["{match.sensor}"], `bench init --without {match.sensor}`'
                raise self._misfit(what, f"a finer model, or one of the two left out: {left_out}")

    def _misfit(self, what: str, expected: str) -> Misfit:
        """Return the fault, with the keys under which the test would fit where these are clear."""
        fits = sorted(self._fits() if len(self.every) > 1 else (), key=lambda fit: fit[:3])
        if not fits:
            sizes = f"{size_of(self.every):.3g} as they stand, the structure {self.size:.3g} m"
            question = "is it the right model, or is one of the units wrong?"
            found = f"no unit, axes or origin fit: the sensors span {sizes}: {question}"
            if len(self.every) == 1:
                options = "`bench init --unit`, `--frame`, `--origin` or a larger `--tolerance`"
                found = (
                    f"one place alone shows neither unit, axes nor origin: say it with {options}"
                )
            return Misfit(what, f"{expected}; {found}")
        alike = [fit for fit in fits if fit.kind == fits[0].kind]
        near = _AS_WELL * min(fit.gap for fit in alike) + ON_MEMBER
        alike = [fit for fit in alike if fit.gap <= near]
        proper = [fit for fit in alike if np.linalg.det(fit.way.turn) > 0.0]
        if not proper:
            advice = "turn one axis of the test, its coordinates and its directions"
            mirrored = f"only mirrored axes {frame_text(alike[0].way.turn)!r} fit: {advice}"
            return Misfit(what, f"{expected}; {mirrored}")
        remedy = self._remedy(proper[0])
        if not remedy.keys:
            return Misfit(what, expected)
        text = f"{expected}; with {remedy} all fit"
        if "without" in remedy.keys:
            text = f"{expected}; put those places right, or with {remedy} the others fit"
        frames = list(dict.fromkeys(frame_text(fit.way.turn) for fit in proper))
        if len(frames) > 1:
            text += f"; by symmetry so they do with {' or '.join(frames[1:4])}: compare MACs"
        return Misfit(what, text, remedy)

    def _fits(self) -> Iterator[Laying]:
        """Yield units, axes and offsets with which most of the sensors lie on the structure."""
        tree, own = cKDTree(cloud_of(self.site)), self.alignment
        middle = 0.5 * (tree.mins + tree.maxes)
        count = max(2, int(np.ceil(_MOST * len(self.every))))
        site = self.site
        there = set(
            ACTIVE[site.frame.plane] if isinstance(site, FrameSite) else site.dofs.direction
        )
        own_scale = METRES[own.model_unit or "m"]
        units = [(u, v) for u in METRES.values() for v in (METRES if own.model_unit else (None,))]
        found = False
        for origin, (unit, model_unit) in product((False, True), units):
            factor = unit * own_scale / METRES[model_unit or "m"]
            size = factor * size_of(self.every) / (self.size or 1.0)
            if found and origin:
                return
            if origin and not _EXTENT[0] <= size <= _EXTENT[1]:
                continue
            for turn in signed_axes():
                points = factor * self.every @ turn.T
                points += middle - np.median(points, axis=0) if origin else own.origin
                for _ in range(_STEPS if origin else 1):
                    gaps, at = tree.query(points)
                    near = np.argsort(gaps)[:count]
                    step = (tree.data[at[near]] - points[near]).mean(axis=0)
                    points = points + step if origin else points
                gap, spread = float(gaps[near[-1]]), size_of(points[near]) / (self.size or 1.0)
                if gap > _NEAR * self.size or not _EXTENT[0] <= spread <= _EXTENT[1]:
                    continue
                shift = (points - factor * self.every @ turn.T)[0] * unit / factor
                way = replace(own, unit=unit, turn=turn, origin=shift, model_unit=model_unit)
                lost = sum(not set(moved_names(way.direction(d))) <= there for d in self.directions)
                changed = (unit != (own.unit or 1.0)) + (model_unit != own.model_unit)
                kind = (changed, -round(spread, 1), lost, unit, model_unit or "")
                found = True
                yield Laying(kind, not np.array_equal(turn, own.turn), gap, way, points)

    def _remedy(self, fit: Laying) -> Remedy:
        """Return the keys of a fit that differ from those as they are."""
        own, way, size = self.alignment, fit.way, self.size or 1.0
        gaps = self._gaps(fit.points) / size
        far = gaps > max(_FAR * fit.gap / size, _NEAR)
        needed, keys = float(gaps[~far].max()), {}
        if way.model_unit not in (None, own.model_unit):
            keys["model-unit"] = str(way.model_unit)
        if way.unit != (own.unit or 1.0):
            keys["unit"] = next(str(u) for u, metres in METRES.items() if metres == way.unit)
        if fit.turned:
            keys["frame"] = frame_text(way.turn)  # axes
        if np.abs(way.origin - own.origin).max() > ON_MEMBER:
            keys["origin"] = ",".join(f"{value:.4g}" for value in way.origin)
        if needed > own.tolerance:
            keys["tolerance"] = f"{float(f'{1.05 * needed:.2g}'):g}"
        if far.any():
            keys["without"] = ",".join(s for s, out in zip(self.labels, far, strict=True) if out)
        return Remedy(keys)


class Laying(NamedTuple):
    """A way in which most sensors of a test lie on a structure; the best one sorts first.

    Arguments:
        kind: units changed, minus what the test spans, directions that are lost, the units.
        turned: whether axes are changed.
        gap: that most sensors keep to the structure in m.
        way: it.
        points: the sensors by it, in m of the structure as it was read, (k, 3).
    """

    kind: tuple[Any, ...]
    turned: bool
    gap: float
    way: Alignment
    points: FloatArray


def signed_axes() -> Iterator[FloatArray]:
    """Yield the 24 turns of three axes, then the 24 mirrored ones, (3, 3) each."""
    every = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.zeros((3, 3))
        turn[range(3), list(order)] = signs
        every.append(turn)
    yield from sorted(every, key=lambda turn: -np.linalg.det(turn))


def frame_text(turn: FloatArray) -> str:
    """Return signed axes as the key ``frame`` has them."""
    axes = [int(np.abs(row).argmax()) for row in turn]
    pairs = zip(turn, axes, strict=True)
    return ",".join(f"{'-' if row[k] < 0.0 else ''}{'xyz'[k]}" for row, k in pairs)


def cloud_of(site: Site) -> FloatArray:
    """Return points all over a structure in m, (k, 3)."""
    if not isinstance(site, FrameSite):
        return site.points
    places = {joint.name: np.array(joint.xyz) for joint in site.frame.joints}
    share = np.linspace(0.0, 1.0, _STATIONS)[:, None]
    ends = [[places[name] for name in member.ends] for member in site.frame.members]
    return np.vstack([(1.0 - share) * first + share * last for first, last in ends])


def match_sensors(
    read: Sensors, file: Path, site: Site, alignment: Alignment, wanted: Collection[str] | None
) -> Placed:
    """Return the sensors of a file that a plugin has read, those that fit the structure.

    Files of three components a point list directions that a planar model does not have, and
    points whose place is in another file; such sensors are left out, one that lies off the
    structure is an error.

    Arguments:
        alignment: how the test lies to it; the unit is detected where it has none.
        wanted: labels with a shape; None for all.

    Raises:
        InputError: when a sensor lies off the structure, or none is left.
    """
    known = np.asarray(np.isfinite(read.xyz).all(axis=1))
    if not known.any():
        raise InputError("sensors without places", file=file, expected=PLACES)
    rows = [
        i
        for i, label in enumerate(read.labels)
        if known[i] and (wanted is None or label in wanted) and label not in alignment.without
    ]
    for i in rows:
        if (size := np.abs(read.xyz[i]).max()) > LARGEST:
            what = f"a coordinate of {read.labels[i]!r} is {size:.3g}"
            raise InputError(what, file=file, expected=f"finite numbers up to {LARGEST:g}")
    kept: list[tuple[Match, str]] = []
    stated: tuple[str, ...] = ()
    if rows:
        labels = tuple(read.labels[i] for i in rows)
        ways = tuple(read.directions[i] for i in rows)
        test = Placement(site, alignment, read.xyz[rows], labels, ways)
        test, taken = test.in_its_unit(file.name)
        alignment = test.alignment
        matches = test.match_labels(labels)
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
            raise misfit.at(file) from None
        stated = (*taken, *stated, *describe_matches([match for match, _ in kept], file.name))
    if not kept:
        expected = "nodes with coordinates, in a direction that the model has (--directions AXES)"
        raise InputError("no sensor fits the structure", file=file, expected=expected)
    found = tuple(match for match, _ in kept)
    places = np.array([match.xyz for match in found])
    sensors = Sensors(tuple(match.sensor for match in found), places, tuple(way for _, way in kept))
    return Placed(sensors, found, stated, alignment)


def describe_matches(matches: Sequence[Match], file: str) -> tuple[str, ...]:
    """Return what to say of sensors between nodes, and of those moved to the structure."""
    moved = [match for match in matches if match.distance > ON_MEMBER]
    amid = [match for match in matches if BETWEEN in match.place]
    stated: tuple[str, ...] = ()
    if amid:
        count = f"{len(amid)} of the {len(matches)} sensors of {file}"
        stated = (f"{count} lie between nodes: what they read is interpolated linearly.",)
    if not moved:
        return stated
    worst = max(moved, key=lambda match: match.distance)
    return (
        *stated,
        f"{len(moved)} of the {len(matches)} sensors of {file} were moved to the nearest place of "
        f"the structure, {worst.sensor} furthest: {worst.distance:.3g} m to {worst.place}.",
    )
