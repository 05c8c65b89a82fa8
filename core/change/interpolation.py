"""Polynomials between Chebyshev points, by which what has no closed form is tabulated."""

from __future__ import annotations

import numpy as np

from femubench.core.typing import FloatArray


def chebyshev_nodes(low: float, high: float, count: int) -> FloatArray:
    """Return the Chebyshev points of the second kind between two bounds, ascending, (count,).

    Examples:
        >>> print(effect.chebyshev_nodes(0.0, 2.0, 3))
        [0. 1. 2.]
    """
    return 0.5 * (low + high) - 0.5 * (high - low) * np.cos(np.pi * np.arange(count) / (count - 1))


def barycentric(nodes: FloatArray, points: FloatArray) -> FloatArray:
    """Return the Lagrange basis at points, (n_points, n_nodes) (Berrut & Trefethen 2004, (5.4)).

    Arguments:
        nodes: Chebyshev points of the second kind, (n_nodes,).
        points: where to evaluate, (n_points,).

    Examples:
        >>> nodes = effect.chebyshev_nodes(0.0, 2.0, 4)
        >>> np.allclose(effect.barycentric(nodes, np.array([0.7])) @ nodes**3, 0.7**3)
        True
    """
    weight = (-1.0) ** np.arange(len(nodes))
    weight[[0, -1]] *= 0.5
    gap = points[:, None] - nodes[None, :]
    hit = np.abs(gap) < 1e-14 * max(float(np.ptp(nodes)), 1e-300)
    share = weight / np.where(hit, 1.0, gap)
    share = share / share.sum(axis=1, keepdims=True)
    on_node = hit.any(axis=1)
    share[on_node] = hit[on_node]
    return np.asarray(share)
