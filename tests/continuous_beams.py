"""Cantilevers on rollers, solved as continuous beams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from femubench import Measurement, Sensors
from femubench.fem import FloatArray, Material, Section


def functions(t: float) -> FloatArray:
    """Return cosh, sinh, cos, sin and their first three derivatives, (4, 4)."""
    c, s, a, b = np.cosh(t), np.sinh(t), np.cos(t), np.sin(t)
    return np.array([[c, s, a, b], [s, c, -b, a], [c, s, -a, -b], [s, c, b, -a]])


@dataclass(frozen=True)
class Cantilever:
    """A uniform beam along x that bends along z.

    Arguments:
        length: in m.
        section: of which Iy and A count.
        material: of which E and rho count.
        stations: of sensors, in m.
        spring: on which the foot turns, in N m/rad; a clamp where infinite.
    """

    length: float
    section: Section
    material: Material
    stations: tuple[float, ...]
    spring: float = np.inf

    @property
    def bending(self) -> float:
        return self.material.E * self.section.Iy

    def conditions(self, beta: float, spans: FloatArray) -> FloatArray:
        """Return those at the foot, at rollers between spans and at a free tip, (4 k, 4 k)."""
        last, start = 4 * len(spans), functions(0.0)
        turn = start[1] - beta * self.bending / self.spring * start[2]  # k w' = EI w''
        rows = [np.pad(row, (0, last - 4)) for row in (start[0], turn)]
        for i, span in enumerate(spans[:-1]):
            end, none = functions(beta * span), np.zeros(4)
            pairs = (end[0], none), (none, start[0]), (end[1], -start[1]), (end[2], -start[2])
            rows += [np.pad(np.r_[pair], (4 * i, last - 4 * i - 8)) for pair in pairs]
        rows += [np.pad(row, (last - 4, 0)) for row in functions(beta * spans[-1])[2:]]
        found = np.array(rows)
        return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])

    def modes(self, count: int, rollers: Sequence[float] = ()) -> tuple[FloatArray, FloatArray]:
        """Return frequencies in Hz and shapes at the stations, whose largest reading is 1.

        Source: Euler and Bernoulli's beam by spans, the roots of the determinant of its conditions.
        """
        points = np.array([0.0, *sorted(rollers), self.length])
        spans = np.diff(points)

        def determinant(beta: float) -> float:
            return float(np.linalg.det(self.conditions(beta, spans)))

        grid = np.linspace(0.5, 4.0 * (count + len(rollers)), 1000) / self.length
        change = np.flatnonzero(np.diff(np.sign([determinant(b) for b in grid])))[:count]
        roots = np.array([brentq(determinant, grid[i], grid[i + 1]) for i in change])
        span = np.minimum(np.searchsorted(points, self.stations, "right") - 1, len(spans) - 1)
        shapes = []
        for root in roots:
            own = np.linalg.svd(self.conditions(root, spans))[2][-1].reshape(-1, 4)
            pairs = zip(span, self.stations, strict=True)
            shape = np.array([own[k] @ functions(root * (x - points[k]))[0] for k, x in pairs])
            shapes.append(shape / np.abs(shape).max())
        speed = np.sqrt(self.bending / (self.material.rho * self.section.A)) / (2.0 * np.pi)
        return speed * roots**2, np.array(shapes).T

    def measure(
        self,
        count: int,
        noise: float,
        shape_std: float,
        rng: np.random.Generator,
        rollers: Sequence[float] = (),
    ) -> Measurement:
        """Return modes with errors: a share of every frequency, and a deviation of the readings."""
        hertz, shapes = self.modes(count, rollers)
        sites = len(self.stations)
        xyz = np.column_stack([self.stations, np.zeros((sites, 2))])
        return Measurement(
            Sensors(tuple(f"s{x:g}" for x in self.stations), xyz, ("z",) * sites),
            tuple(range(1, count + 1)),
            hertz * (1.0 + noise * rng.standard_normal(count)),
            noise * hertz,
            np.full(count, np.nan),
            shapes + shape_std * rng.standard_normal(shapes.shape),
            np.full(shapes.shape, shape_std),
        )
