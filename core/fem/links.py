"""Rigid links: how the motions of some joints follow from those of others, without penalties."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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
    """

    spread: SparseArray
    led: BoolArray


def linkage(
    links: Sequence[Link],
    names: Sequence[str],
    xyz: FloatArray,
    active: BoolArray,
    held: BoolArray,
) -> Linkage:
    """Return what rigid links tie together.

    A joint that follows in all its motions is one body with its leader, and so are those that
    follow it in turn. Where another joint of such a body than its leader is held, that one leads.

    Arguments:
        links: the rigid links.
        names: the joints, or nodes, in the order of the displacements.
        xyz: where they are in m, (n, 3).
        active: which of x, y, z, rx, ry, rz may move at all, (6,).
        held: which displacements supports hold, (n, 6).

    Raises:
        ModelError: for a joint or a motion that is not there, a joint that follows two others in
            one motion, or links that go round in a circle.
    """
    index = {name: i for i, name in enumerate(names)}
    leader = np.full((len(names), 6), -1)
    for link in links:
        motions = _motions(link, active)
        for name in (link.leads, *link.follows):
            if name not in index:
                raise ModelError(f"there is no joint {name!r}", link)
        for name in link.follows:
            other = leader[index[name], motions].max()
            if other >= 0:
                what = f"joint {name!r} follows {names[other]!r} and {link.leads!r}"
                raise ModelError(what, link)
            leader[index[name], motions] = index[link.leads]
    order = _order(leader, names, links)
    leader = _led_by_the_held(leader, order, active, held)
    return Linkage(_spread(leader, xyz, active), leader >= 0)


def _motions(link: Link, active: BoolArray) -> IntArray:
    wrong = [d for d in link.motions if d not in DIRECTIONS or not active[DIRECTIONS.index(d)]]
    if wrong:
        raise ModelError(f"a link has no motion {wrong[0]!r} in this plane", link)
    wanted = [d in link.motions for d in DIRECTIONS] if link.motions else active
    return np.flatnonzero(wanted)


def _order(leader: IntArray, names: Sequence[str], links: Sequence[Link]) -> list[int]:
    """Return the joints that have to do with links, what leads before what follows."""
    graph = {
        int(i): {int(j) for j in leader[i] if j >= 0} for i in np.flatnonzero((leader >= 0).any(1))
    }
    try:
        return list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        ring = [names[i] for i in error.args[1]]
        item = next(link for link in links if link.leads in ring)
        what = f"the links go round in a circle: {', '.join(ring)}"
        raise ModelError(what, item) from None


def _led_by_the_held(
    leader: IntArray, order: Sequence[int], active: BoolArray, held: BoolArray
) -> IntArray:
    """Return the leaders such that in every body the joint leads that supports hold most."""
    root: dict[int, int] = {}
    for i in order:
        own = np.unique(leader[i, active])
        whole = len(own) == 1 and own[0] >= 0
        root[i] = root[int(own[0])] if whole else i
    found = leader.copy()
    for first in set(root.values()):
        body = np.array([i for i in root if root[i] == first], dtype=np.int64)
        most = max(body, key=lambda i: (int(held[i].sum()), bool(i == first)))
        # One that follows others in some motions stays what it is.
        chosen = first if (leader[first] >= 0).any() else most
        found[np.ix_(body, np.flatnonzero(active))] = chosen
        found[chosen] = leader[first]
    return found


def _spread(leader: IntArray, xyz: FloatArray, active: BoolArray) -> SparseArray:
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
        step = follow @ step
        spread = spread + step
    spread.eliminate_zeros()
    return spread


def held_leaders(tie: Linkage, free: BoolArray, held: BoolArray) -> BoolArray | None:
    """Return which free displacements cannot move, since something that follows them is held.

    None where what is held does not hold single motions of the leader, but a mixture of them.

    Arguments:
        tie: the rigid links.
        free: which displacements are free, (n, 6).
        held: which displacements supports hold, (n, 6).
    """
    stopped = np.zeros(free.shape, dtype=bool)
    rows = tie.spread[np.flatnonzero((held & tie.led).ravel())][:, np.flatnonzero(free.ravel())]
    tied = np.unique(rows.indices)
    if len(tied):
        block = rows[:, tied].toarray()
        if np.linalg.matrix_rank(block) < len(tied):
            return None
        stopped.ravel()[np.flatnonzero(free.ravel())[tied]] = True
    return stopped
