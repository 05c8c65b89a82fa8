"""Coordinate systems of bulk data: rectangular, cylindrical and spherical, by points or grids."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from femubench.fem import FloatArray
from femubench.plugins.readers.axes import BASIC, Kind, System
from femubench.plugins.readers.bulk_data.cards import Card

_DEEPEST = 50  # systems one in another
_BY_GRIDS, _BY_POINTS = ("CORD1R", "CORD1C", "CORD1S"), ("CORD2R", "CORD2C", "CORD2S")
KINDS = (*_BY_GRIDS, *_BY_POINTS)


class Systems:
    """The coordinate systems of a file by their numbers, 0 for the basic one.

    Arguments:
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
                expected = "a point on z, and one in x-z next to it"
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
            key = f"G{i - 1}"
            grid = card.pick(self._grids, card.id(i, key), "GRID", key)
            found.append(self.place(grid, depth))
        return found


def _parted(card: Card) -> list[Card]:
    """Return a card for every system of a card: a CORD1 may hold two."""
    if card.name in _BY_POINTS or len(card.fields) <= 4:
        return [card]
    halves = card.fields[:4], card.fields[4:8]
    return [Card(card.name, half, card.file, card.first, card.last) for half in halves]
