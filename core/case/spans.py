"""Pairs of nodes of a model from matrices that a strut or a cable may tie: it is a short cut."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from femubench.core.case.nodes import MatrixGeometry, with_mesh
from femubench.core.fem.model import Model
from femubench.core.typing import SparseArray

_MOST = 25  # nodes: 300 pairs
# The way through the body over the straight line: along a bar or across a plate it is up to 1.1 by
# the corners of the mesh, between two sides of a right angle 1.2 and more.
_DETOUR = 1.15


def find_spans(model: Model, names: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Return the pairs of nodes to which the way through the body is no straight one.

    What ties the others acts along a part, and is a stiffener of it.

    Arguments:
        model: a whole one from files, with all of its nodes.
        names: of nodes; of more than 25 those that lie farthest from each other.
    """
    geometry = model.geometry
    assert isinstance(geometry, MatrixGeometry)
    if geometry.mesh is None:
        geometry = with_mesh(model).geometry
        assert isinstance(geometry, MatrixGeometry)
    points, place = geometry.points, {name: i for i, name in enumerate(geometry.placed)}
    chosen = np.array([place[name] for name in spread_nodes(geometry, names)], dtype=np.int64)
    way = dijkstra(_edges(geometry), directed=False, indices=chosen)[:, chosen]
    straight = np.linalg.norm(points[chosen, None] - points[None, chosen], axis=2)
    pairs = zip(*np.nonzero(np.triu((way > _DETOUR * straight) & (straight > 0.0))), strict=True)
    return tuple((geometry.placed[chosen[a]], geometry.placed[chosen[b]]) for a, b in pairs)


def spread_nodes(geometry: MatrixGeometry, names: Iterable[str]) -> tuple[str, ...]:
    """Return nodes in their order, of more than 25 those that lie farthest from each other."""
    known = tuple(names)
    if len(known) <= _MOST:
        return known
    own = np.array([geometry.places[name] for name in known])
    chosen = [int(np.linalg.norm(own - own.mean(axis=0), axis=1).argmax())]
    away = np.full(len(own), np.inf)
    while len(chosen) < _MOST:
        away = np.minimum(away, np.linalg.norm(own - own[chosen[-1]], axis=1))
        chosen.append(int(away.argmax()))
    return tuple(known[i] for i in sorted(chosen))


def _edges(geometry: MatrixGeometry) -> SparseArray:
    """Return how far in m places that share an element are from each other, sparse (k, k)."""
    assert geometry.mesh is not None
    outer = np.unique(geometry.dofs.node[~geometry.dofs.internal])
    mesh = sp.coo_array(geometry.mesh[outer][:, outer])
    gap = geometry.points[mesh.row] - geometry.points[mesh.col]
    return sp.csr_array((np.linalg.norm(gap, axis=1), (mesh.row, mesh.col)), shape=mesh.shape)
