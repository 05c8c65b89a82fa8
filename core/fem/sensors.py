"""Sensors: points and directions at which a structure is measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.typing import FloatArray

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Sensors:
    """Points and directions at which mode shapes are measured.

    Arguments:
        labels: one name a sensor.
        xyz: positions in m, (n_sensors, 3).
        directions: one of x y z rx ry rz a sensor, with an optional leading minus.
    """

    labels: tuple[str, ...]
    xyz: FloatArray
    directions: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def axes(self) -> FloatArray:
        """Return the signed unit vectors in (x, y, z, rx, ry, rz), (n_sensors, 6)."""
        axes = np.zeros((len(self), 6))
        for row, direction in enumerate(self.directions):
            sign, name = (-1.0, direction[1:]) if direction[:1] in "-+" else (1.0, direction)
            axes[row, DIRECTIONS.index(name)] = 1.0 if direction[:1] == "+" else sign
        return axes
