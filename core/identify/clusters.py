"""Poles that models of many orders share."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from femubench.core.identify.lscf import Poles
from femubench.core.typing import AnyArray

_WIDEST = 0.03  # relative distance of poles that may belong to one mode
_LIKENESS = 0.02  # that distance for participations that have nothing in common
_TWICE = 0.25  # of the orders with two poles or more: there are two modes


@dataclass(frozen=True)
class Cluster:
    """Poles of several orders that stand for one mode.

    Arguments:
        pole: their median, in rad/s.
        participation: their common direction, (n_ref,).
        support: share of the orders that have one of them.
        members: their positions among all poles.
    """

    pole: complex
    participation: AnyArray
    support: float
    members: tuple[int, ...]


def clusters_of(poles: Poles, orders: int) -> list[Cluster]:
    """Return the clusters of decaying poles, by frequency.

    A tree of average linkage is cut where a branch has two poles in hardly any order: two modes,
    however close, appear side by side in the same orders, and one mode never does.
    """
    from scipy.cluster.hierarchy import linkage, to_tree
    from scipy.spatial.distance import squareform

    if len(poles) < 2:
        return [_cluster(poles, [i], orders) for i in range(len(poles))]
    values = poles.values
    apart = np.abs(values[:, None] - values) / np.sqrt(np.abs(values[:, None] * values))
    unlike = 1.0 - np.square(np.abs(poles.participation.conj() @ poles.participation.T))
    distance = np.maximum(apart + _LIKENESS * unlike, 0.0)
    np.fill_diagonal(distance, 0.0)
    tree = to_tree(linkage(squareform(distance, checks=False), "average"))
    found = [_cluster(poles, members, orders) for members in _branches(tree, poles)]
    return sorted(found, key=lambda cluster: cluster.pole.imag)


def _branches(tree: Any, poles: Poles) -> Iterator[list[int]]:  # noqa: ANN401 - scipy's node
    """Yield the members of every branch that stands for one mode."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        members = node.pre_order()
        _, count = np.unique(poles.orders[members], return_counts=True)
        if node.dist <= _WIDEST and np.mean(count > 1) <= _TWICE:
            yield members
        else:
            waiting += [node.left, node.right]


def _cluster(poles: Poles, members: list[int], orders: int) -> Cluster:
    own = poles.select(members)
    pole = complex(np.median(own.values.real), np.median(own.values.imag))
    _, vectors = np.linalg.eigh(own.participation.T @ own.participation.conj())
    support = len(np.unique(own.orders)) / orders
    return Cluster(pole, vectors[:, -1], support, tuple(members))
