"""Coordinate systems that files of other programs define."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from femubench.fem import FloatArray

Kind = Literal["R", "C", "S"]  # rectangular, cylindrical, spherical


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
            z, off_axis = radius * _circle(down)
            local = np.array([*(off_axis * _circle(around)), z])
        return np.asarray(self.origin + local @ self.axes)

    def axes_at(self, point: FloatArray) -> FloatArray:
        """Return the axes of displacements at a point (basic coordinates), as rows, (3, 3).

        On the axis of a system that is not rectangular, the point counts as next to it along x.
        """
        if self.kind == "R":
            return self.axes
        x, y, z = self.axes @ (point - self.origin)
        off_axis = float(np.hypot(x, y))
        c, s = (x / off_axis, y / off_axis) if off_axis > 0.0 else (1.0, 0.0)
        turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        if self.kind == "S":
            radius = float(np.hypot(off_axis, z))
            up, out = (z / radius, off_axis / radius) if radius > 0.0 else (1.0, 0.0)
            along, across, pole = turned
            turned = np.array([out * along + up * pole, up * along - out * pole, across])
        return np.asarray(turned @ self.axes)


def _circle(degrees: float) -> FloatArray:
    angle = np.radians(degrees)
    return np.array([np.cos(angle), np.sin(angle)])


BASIC = System(np.zeros(3), np.eye(3))
