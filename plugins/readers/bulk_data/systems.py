"""Coordinate systems of bulk data: rectangular and cylindrical, each given in another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from femubench.fem import FloatArray
from femubench.plugins.readers.bulk_data.cards import Card

_DEEPEST = 50  # systems one in another


@dataclass(frozen=True)
class System:
    """A coordinate system: its origin, its axes as rows, and whether it is cylindrical."""

    origin: FloatArray
    axes: FloatArray
    cylindrical: bool = False

    def point(self, coordinates: FloatArray) -> FloatArray:
        """Return where a point lies in basic coordinates, (3,)."""
        local = coordinates
        if self.cylindrical:
            radius, angle, z = coordinates
            angle = np.radians(angle)
            local = np.array([radius * np.cos(angle), radius * np.sin(angle), z])
        return np.asarray(self.origin + local @ self.axes)

    def axes_at(self, point: FloatArray) -> FloatArray:
        """Return the axes of displacements at a point (basic coordinates), as rows, (3, 3)."""
        if not self.cylindrical:
            return self.axes
        x, y, _ = self.axes @ (point - self.origin)
        radius = float(np.hypot(x, y))
        c, s = (x / radius, y / radius) if radius > 0.0 else (1.0, 0.0)
        return np.asarray(np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ self.axes)


BASIC = System(np.zeros(3), np.eye(3))
KINDS = ("CORD2R", "CORD2C")


class Systems:
    """The coordinate systems of a file by their numbers, 0 for the basic one.

    Arguments:
        cards: the CORD2R and CORD2C by number.
    """

    def __init__(self, cards: Mapping[int, Card]) -> None:
        self._cards = cards
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
                expected = f"0 or the number of a {' or '.join(KINDS)}, none within itself"
                raise user.error(f"there is no coordinate system {number}", expected, key)
            base = self.find(card.id(2, "RID", 0), card, "RID", depth + 1)
            self._known[number] = _system(card, base)
        return self._known[number]


def _system(card: Card, base: System) -> System:
    """Return the system of three points: origin, on z, in x-z."""
    points = [np.array(card.vector(3 + 3 * i, name)) for i, name in enumerate("ABC")]
    origin, on_z, in_xz = (base.point(point) for point in points)
    z, towards_x = on_z - origin, in_xz - origin
    y = np.cross(z, towards_x)
    sizes = np.linalg.norm(z), np.linalg.norm(towards_x), np.linalg.norm(y)
    if not sizes[2] > 1e-9 * sizes[0] * sizes[1]:
        raise card.error("the points lie on one line", "a point on z, and one in x-z beside it")
    z, y = z / sizes[0], y / sizes[2]
    axes = np.array([np.cross(y, z), y, z])
    return System(origin, axes, card.name == "CORD2C")
