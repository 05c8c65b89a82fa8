"""Rigid links: how the motions of some joints follow from those of others, without penalties."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from graphlib import CycleError, TopologicalSorter

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.frame import Link
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray


def rigid_arm(offset: FloatArray) -> FloatArray:
    """Return the (6, 6) motion of a point at `offset` (global, m) of a moving rigid body."""
    x, y, z = offset
    motion = np.eye(6)
    motion[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return motion


@dataclass(frozen=True)
class Linkage:
    """What rigid links tie together, as ``displacements = spread @ displacements that lead``.

    Arguments:
        spread: sparse, (6 n, 6 n); rows of what leads itself are those of the unit matrix.
        led: whether a displacement follows from others, (n, 6).
        bodies: joints that follow in all their motions, and what leads them in the end, (l, 2).
    """

    spread: SparseArray
    led: BoolArray
    bodies: IntArray


def linkage(
    links: Sequence[Link], names: Sequence[str], xyz: FloatArray, active: BoolArray
) -> Linkage:
    """Return what rigid links tie together.

    What follows a joint takes part in all six of its motions, so that a rigid body stays one.

    Arguments:
        names: the joints, or nodes, in the order of the displacements.
        xyz: where they are in m, (n, 3).
        active: which of x, y, z, rx, ry, rz may move at all, (6,).

    Raises:
        ModelError: for a joint that is not there, one that follows two others in one motion, or
            links that go round in a circle.
    """
    # A frame that is meshed anew with something else changed has the same links.
    return _linkage(tuple(links), tuple(names), np.asarray(xyz, float).tobytes(), active.tobytes())


@lru_cache(maxsize=8)
def _linkage(
    links: tuple[Link, ...], names: tuple[str, ...], points: bytes, moves: bytes
) -> Linkage:
    xyz, active = np.frombuffer(points).reshape(-1, 3), np.frombuffer(moves, dtype=bool)
    index = {name: i for i, name in enumerate(names)}
    leader = np.full((len(names), 6), -1)
    for link in links:
        wanted = np.isin(DIRECTIONS, link.motions) if link.motions else active
        motions = np.flatnonzero(wanted & active)
        for name in (link.leads, *link.follows):
            if name not in index:
                raise ModelError(f"there is no joint {name!r}", link)
        for name in link.follows:
            other = int(leader[index[name], motions].max(initial=-1))
            if other >= 0:
                what = f"joint {name!r} follows {names[other]!r} and {link.leads!r}"
                raise ModelError(what, link)
            leader[index[name], motions] = index[link.leads]
    # No joint follows, by way of others, itself.
    graph = {
        int(i): {int(j) for j in leader[i] if j >= 0} for i in np.flatnonzero((leader >= 0).any(1))
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        ring = [str(names[i]) for i in error.args[1]]
        item = next(link for link in links if link.leads in ring)
        what = f"the links go round in a circle: {', '.join(ring)}"
        raise ModelError(what, item) from None
    bodies = np.array([(i, _root(leader, i, active)) for i in range(len(names))])
    bodies = bodies[bodies[:, 0] != bodies[:, 1]]
    size = leader.size
    node, motion = np.nonzero(leader >= 0)
    base = leader[node, motion]
    offsets = xyz[node] - xyz[base]
    arms = [rigid_arm(o)[i] * active for o, i in zip(offsets, motion, strict=True)]
    rows = np.repeat(6 * node + motion, 6)
    columns = (6 * base[:, None] + np.arange(6)).ravel()
    data = np.array(arms, dtype=float).ravel()
    follow = sp.csr_array((data, (rows, columns)), shape=(size, size))
    follow.eliminate_zeros()
    spread = sp.csr_array(sp.diags_array((leader < 0).ravel().astype(float)))
    step = spread
    while step.nnz:  # as often as the longest chain has links
        step = sp.csr_array(follow @ step)
        spread = spread + step
    spread.eliminate_zeros()
    return Linkage(spread, leader >= 0, bodies)


def _root(leader: IntArray, joint: int, active: BoolArray) -> int:
    """Return the joint at the end of the chain of those that lead in all motions."""
    own = np.unique(leader[joint, active])
    return _root(leader, int(own[0]), active) if len(own) == 1 and own[0] >= 0 else joint
