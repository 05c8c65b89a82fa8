"""Sensors: points and directions at which a structure is measured."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from femubench.core.errors import InputError
from femubench.core.typing import FloatArray

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
_TINY = 1e-9  # of a unit vector
_APART = 1e-3  # of the coordinates of a point in two files


def unit_motions(directions: Iterable[str]) -> FloatArray:
    """Return the unit motions in (x, y, z, rx, ry, rz) of directions among these six, (n, 6)."""
    number = {name: i for i, name in enumerate(DIRECTIONS)}
    return np.eye(6)[np.fromiter((number[name] for name in directions), dtype=np.int8)]


def axis_of(direction: str) -> FloatArray:
    """Return the unit vector of a direction in (x, y, z, rx, ry, rz), (6,).

    Arguments:
        direction: ``z``, ``-rx``, or along no axis: ``0.6 0 0.8``, about it ``r 0.6 0 0.8``.

    Raises:
        ValueError: when it is none of these.
    """
    axis = np.zeros(6)
    name = direction.removeprefix("+").removeprefix("-")
    if name in DIRECTIONS and len(direction) - len(name) <= 1:
        axis[DIRECTIONS.index(name)] = -1.0 if direction.startswith("-") else 1.0
        return axis
    first, words = 3 if direction[:1] == "r" else 0, direction.removeprefix("r").split()
    try:
        vector = np.array([float(word) for word in words])
    except ValueError:
        vector = np.zeros(0)
    if len(vector) != 3 or not np.isfinite(vector).all() or not np.abs(vector).max() > _TINY:
        raise ValueError(f"{direction[:40]!r} is no direction")
    axis[first : first + 3] = vector / np.linalg.norm(vector)
    return axis


def direction_of(axis: FloatArray) -> str:
    """Return the text of a direction, as short as it reads back.

    Arguments:
        axis: a translation or a rotation in (x, y, z, rx, ry, rz), (6,).
    """
    turns = bool(np.abs(axis[3:]).max() > np.abs(axis[:3]).max())
    vector = axis[3:] if turns else axis[:3]
    vector = vector / np.linalg.norm(vector)
    vector = np.where(np.abs(vector) < _TINY, 0.0, vector)
    along = np.flatnonzero(vector)
    if len(along) == 1:
        sign = "-" if vector[along[0]] < 0.0 else ""
        return f"{sign}{DIRECTIONS[along[0] + (3 if turns else 0)]}"
    return ("r " if turns else "") + " ".join(repr(float(v)) for v in vector)


def moved_names(direction: str) -> tuple[str, ...]:
    """Return the directions of `DIRECTIONS` that a sensor reads.

    Raises:
        ValueError: when it is no direction.
    """
    return tuple(DIRECTIONS[k] for k in np.flatnonzero(axis_of(direction)))


@dataclass(frozen=True)
class Sensors:
    """Points and directions at which mode shapes are measured.

    Arguments:
        labels: one name a sensor.
        xyz: positions in m, (n_sensors, 3).
        directions: one of x y z rx ry rz a sensor, with an optional leading minus; or three
            numbers, the vector along which it measures (about which, behind an r).
    """

    labels: tuple[str, ...]
    xyz: FloatArray
    directions: tuple[str, ...]

    @classmethod
    def unplaced(cls, labels: Iterable[str], direction: str = "") -> Sensors:
        """Return sensors of which the names are known, and perhaps one direction of all."""
        names = tuple(labels)
        return cls(names, np.full((len(names), 3), np.nan), (direction,) * len(names))

    @classmethod
    def along(cls, labels: Iterable[str], xyz: FloatArray, axes: FloatArray) -> Sensors:
        """Return sensors along any axes.

        Arguments:
            labels: one name a sensor.
            xyz: positions in m, (n_sensors, 3).
            axes: translations or rotations in (x, y, z, rx, ry, rz), (n_sensors, 6).
        """
        return cls(tuple(labels), xyz, tuple(direction_of(axis) for axis in axes))

    @classmethod
    def united(cls, every: Sequence[Sensors]) -> Sensors:
        """Return the sensors of several lists, each label once, at the first place that is known.

        Raises:
            InputError: for a label at two places.
        """
        held: dict[str, tuple[FloatArray, str]] = {}
        for one in every:
            for label, xyz, direction in zip(one.labels, one.xyz, one.directions, strict=True):
                before, _ = held.setdefault(label, (xyz, direction))
                if not np.isfinite(before).all():
                    held[label] = (xyz, direction)
                elif np.linalg.norm(xyz - before) > _APART * np.linalg.norm(before):
                    what, expected = (
                        f"{label!r} has two places",
                        "a name of its own for every point",
                    )
                    raise InputError(what, key="sensors", expected=expected)
        xyz = np.array([place for place, _ in held.values()], dtype=float).reshape(-1, 3)
        return cls(tuple(held), xyz, tuple(direction for _, direction in held.values()))

    def __len__(self) -> int:
        return len(self.labels)

    def take(self, rows: Iterable[int]) -> Sensors:
        """Return some of the sensors, in the given order."""
        own = [int(row) for row in rows]
        labels, directions = ([side[k] for k in own] for side in (self.labels, self.directions))
        return Sensors(tuple(labels), self.xyz[own], tuple(directions))

    @property
    def axes(self) -> FloatArray:
        """Return the signed unit vectors in (x, y, z, rx, ry, rz), (n_sensors, 6)."""
        known = {direction: axis_of(direction) for direction in set(self.directions)}
        rows = [known[direction] for direction in self.directions]
        return np.array(rows, dtype=float).reshape(-1, 6)


@dataclass(frozen=True)
class Outline:
    """What a file of a test says apart from modes.

    Arguments:
        title: in a few words; empty where there is none.
        lines: that draw the structure, in the unit of the file, (k, 2, 3).

    Examples:
        >>> fem.Outline("wing", np.zeros((0, 2, 3))).title
        'wing'
    """

    title: str
    lines: FloatArray
