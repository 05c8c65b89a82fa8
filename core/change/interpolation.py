"""Polynomials between Chebyshev points, by which what has no closed form is tabulated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from femubench.core.typing import FloatArray


@dataclass(frozen=True)
class ChebyshevPoints:
    """Chebyshev points of the second kind, and the polynomials through values there.

    Arguments:
        low, high: the first point and the last.
        count: of points.
    """

    low: float
    high: float
    count: int

    @cached_property
    def points(self) -> FloatArray:
        """Return the points, ascending, (count,).

        Examples:
            >>> print(effect.ChebyshevPoints(0.0, 2.0, 3).points)
            [0. 1. 2.]
        """
        turn = np.cos(np.pi * np.arange(self.count) / (self.count - 1))
        return np.asarray(0.5 * (self.low + self.high) - 0.5 * (self.high - self.low) * turn)

    def shares(self, x: FloatArray) -> FloatArray:
        """Return the share of the value at every point in those at x, (n, count).

        Arguments:
            x: where to evaluate, (n,).

        Source: Berrut & Trefethen (2004), equation (5.4).

        Examples:
            >>> nodes = effect.ChebyshevPoints(0.0, 2.0, 4)
            >>> np.allclose(nodes.shares(np.array([0.7])) @ nodes.points**3, 0.7**3)
            True
        """
        weight = (-1.0) ** np.arange(self.count)
        weight[[0, -1]] *= 0.5
        gap = x[:, None] - self.points[None, :]
        hit = np.abs(gap) < 1e-14 * max(float(np.ptp(self.points)), 1e-300)
        share = weight / np.where(hit, 1.0, gap)
        share = share / share.sum(axis=1, keepdims=True)
        on_node = hit.any(axis=1)
        share[on_node] = hit[on_node]
        return np.asarray(share)
