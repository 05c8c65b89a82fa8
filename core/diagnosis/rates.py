"""Few numbers for many: rates of elements, gathered on nodes of their logarithm.

A spring in series with an element, or shear beside its bending, gives a share c r / (1 + c r) or
1 / (1 + c r) with a rate r of the element and one c for all. Elements of one rate share a term of
a `Change`; where there are too many rates, the share is interpolated in ln r, of which it is a
smooth function: its nearest singularity lies pi away from the real axis whatever c is.
"""

from __future__ import annotations

import numpy as np

from femubench.core.diagnosis.change import barycentric, chebyshev_nodes
from femubench.core.typing import FloatArray

_MOST = 24
_NODES = 20
_ALIKE = 1e-10


def rate_nodes(rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rates that stand for all, and how much every one takes of each.

    Arguments:
        rates: positive, (k,).

    Returns:
        nodes (q,) and weights (k, q): f(rates) = weights @ f(nodes), exactly for up to 24
        different rates, else to about 1e-6 of the largest share over a range of 1:1000.
    """
    if not len(rates):
        return np.zeros(0), np.zeros((0, 0))
    order = np.argsort(rates)
    ordered = rates[order]
    fresh = np.concatenate([[True], np.diff(ordered) > _ALIKE * ordered[1:]])
    nodes = ordered[fresh]
    if len(nodes) <= _MOST:
        weights = np.zeros((len(rates), len(nodes)))
        weights[order, np.cumsum(fresh) - 1] = 1.0
        return nodes, weights
    points = chebyshev_nodes(float(np.log(nodes[0])), float(np.log(nodes[-1])), _NODES)
    return np.exp(points), barycentric(points, np.log(rates))
