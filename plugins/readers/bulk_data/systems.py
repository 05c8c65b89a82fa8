"""Coordinate systems of bulk data: rectangular, cylindrical and spherical, by points or grids."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from femubench.fem import FloatArray
from femubench.plugins.readers.bulk_data.cards import Card

_DEEPEST = 50  # systems one in another
Kind = Literal["R", "C", "S"]  # the last letter of a card


@dataclass(frozen=True)
class System:
    """A coordinate system: its origin, its axes as rows, and what its coordinates are.

    Arguments:
        kind: R for x, y, z; C for radius, angle about z, z; S for radius, angle from z, angle
            about z.
    """

    origin: FloatArray
    axes: FloatArray
    kind: Kind = "R"

    def point(self, coordinates: FloatArray) -> FloatArray:
        """Return where a point lies in basic coordinates, (3,); angles are in degrees."""
        local = coordinates
        if self.kind == "C":
            radius, around, z = coordinates
            local = np.array([*(radius * _circle(around)), z])
        elif self.kind == "S":
            radius, down, around = coordinates
            z, beside = radius * _circle(down)
            local = np.array([*(beside * _circle(around)), z])
        return np.asarray(self.origin + local @ self.axes)

    def axes_at(self, point: FloatArray) -> FloatArray:
        """Return the axes of displacements at a point (basic coordinates), as rows, (3, 3).

        On the axis of a system that is not rectangular, the point counts as beside it along x.
        """
        if self.kind == "R":
            return self.axes
        x, y, z = self.axes @ (point - self.origin)
        beside = float(np.hypot(x, y))
        c, s = (x / beside, y / beside) if beside > 0.0 else (1.0, 0.0)
        turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        if self.kind == "S":
            radius = float(np.hypot(beside, z))
            up, out = (z / radius, beside / radius) if radius > 0.0 else (1.0, 0.0)
            along, across, pole = turned
            turned = np.array([out * along + up * pole, up * along - out * pole, across])
        return np.asarray(turned @ self.axes)


def _circle(degrees: float) -> FloatArray:
    angle = np.radians(degrees)
    return np.array([np.cos(angle), np.sin(angle)])


BASIC = System(np.zeros(3), np.eye(3))
_BY_GRIDS, _BY_POINTS = ("CORD1R", "CORD1C", "CORD1S"), ("CORD2R", "CORD2C", "CORD2S")
KINDS = (*_BY_GRIDS, *_BY_POINTS)


class Systems:
    """The coordinate systems of a file by their numbers, 0 for the basic one.

    Arguments:
        cards: of the file, of any kind.
        grids: the GRID cards by number, on which systems may hang.
        usual: the system in which grids lie that name none.

    Raises:
        InputError: where a number is there twice, for different systems.
    """

    def __init__(self, cards: Iterable[Card], grids: Mapping[int, Card], usual: int = 0) -> None:
        self._cards: dict[int, Card] = {}
        for card in (c for both in cards if both.name in KINDS for c in _parted(both)):
            other = self._cards.setdefault(card.id(1, "CID"), card)
            if (other.name, other.fields) != (card.name, card.fields):
                raise card.error(f"{other} is there already", "a number of its own")
        self._grids, self._usual = grids, usual
        self._known = {0: BASIC}

    def find(self, number: int, user: Card, key: str, depth: int = 0) -> System:
        """Return a system.

        Arguments:
            number: as a card names it.
            user: the card that names it.
            key: the field of that card.
            depth: how many systems stand between.

        Raises:
            InputError: when there is none, or its points give no axes.
        """
        if number not in self._known:
            card = self._cards.get(number)
            if card is None or depth > _DEEPEST:
                expected = "0 or the number of a CORD1 or CORD2, none within itself"
                raise user.error(f"there is no coordinate system {number}", expected, key)
            # Origin, on z, in x-z.
            origin, on_z, in_xz = self._points(card, depth + 1)
            z, towards_x = on_z - origin, in_xz - origin
            y = np.cross(z, towards_x)
            sizes = np.linalg.norm(z), np.linalg.norm(towards_x), np.linalg.norm(y)
            if not sizes[2] > 1e-9 * sizes[0] * sizes[1]:
                expected = "a point on z, and one in x-z beside it"
                raise card.error("the points lie on one line", expected)
            z, y = z / sizes[0], y / sizes[2]
            axes = np.array([np.cross(y, z), y, z])
            kinds: dict[str, Kind] = {"R": "R", "C": "C", "S": "S"}
            self._known[number] = System(origin, axes, kinds[card.name[-1]])
        return self._known[number]

    def place(self, grid: Card, depth: int = 0) -> FloatArray:
        """Return where a grid lies in basic coordinates, (3,); raises InputError."""
        system = self.find(grid.id(2, "CP", self._usual), grid, "CP", depth)
        return system.point(np.array(grid.vector(3, "X")))

    def _points(self, card: Card, depth: int) -> list[FloatArray]:
        """Return the three points of a system: origin, on z, in x-z."""
        if card.name in _BY_POINTS:
            base = self.find(card.id(2, "RID", 0), card, "RID", depth)
            return [base.point(np.array(card.vector(3 + 3 * i, k))) for i, k in enumerate("ABC")]
        found = []
        for i in (2, 3, 4):
            number = card.id(i, f"G{i - 1}")
            if number not in self._grids:
                expected = "the number of a GRID"
                raise card.error(f"there is no GRID {number}", expected, f"G{i - 1}")
            found.append(self.place(self._grids[number], depth))
        return found


def _parted(card: Card) -> list[Card]:
    """Return a card for every system of a card: a CORD1 may hold two."""
    if card.name in _BY_POINTS or len(card.fields) <= 4:
        return [card]
    halves = card.fields[:4], card.fields[4:8]
    return [Card(card.name, half, card.file, card.first, card.last) for half in halves]
