"""Springs, masses and rigid elements at nodes of solids and shells.

They hang on the motion of a node in (x, y, z, rx, ry, rz), which is linear in the degrees of
freedom, (6, n): of shells the rotation is that of the line of nodes, of a knot its own. Nothing
resists the rotation of a node of solids, or of a line about itself: a spring there carries none,
and one that leads others has it as a degree of freedom of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag
from scipy.sparse.csgraph import connected_components

from femubench import InputError
from femubench.fem import FloatArray, SparseArray
from femubench.plugins.readers.nodes import Point
from femubench.plugins.readers.shells import Motion, Motions, Thickened, cross_matrix

_NOTHING = 1e-9  # of a unit vector: what rounding leaves of it
_LOST = 1e-13  # of the sum of sizes: what rounding leaves of a sum
_ROUNDING = 1e-12  # of the stiffness in a direction


@dataclass(frozen=True)
class Follower:
    """A node of which some directions follow the motions of others.

    Arguments:
        directions: which, 0 to 5.
        of: from the motion of each of the others, (6, 6).
    """

    node: int
    directions: frozenset[int]
    of: Mapping[int, FloatArray]


@dataclass(frozen=True)
class NodeSpring:
    """Springs of a group that resist the sum of motions.

    Arguments:
        ends: nodes, and what each adds to the sum, (k, 6).
        stiffness: of each, (k,).
    """

    group: str
    ends: Sequence[tuple[int, FloatArray]]
    stiffness: FloatArray


@dataclass
class Attachments:
    """What hangs on the nodes of a model.

    Arguments:
        masses: nodes, and the mass matrix there, (6, 6).
    """

    followers: list[Follower] = field(default_factory=list)
    springs: list[NodeSpring] = field(default_factory=list)
    masses: list[tuple[int, FloatArray]] = field(default_factory=list)

    def nodes(self) -> Iterator[int]:
        """Return all nodes on which something hangs, again where more does."""
        yield from (node for spring in self.springs for node, _ in spring.ends)
        yield from (node for node, _ in self.masses)
        for follower in self.followers:
            yield from (follower.node, *follower.of)

    def led(self) -> set[tuple[int, int]]:
        """Return node and direction of all that follows."""
        return {(f.node, d) for f in self.followers for d in f.directions}

    def leaders(self) -> set[int]:
        """Return the nodes that others follow in a way that their rotation matters for."""
        return {n for f in self.followers for n, part in f.of.items() if part[:, 3:].any()}

    def with_edges(
        self, edges: Mapping[int, Sequence[int]], places: Mapping[int, Point]
    ) -> Attachments:
        """Return the same where new nodes follow a rigid element as all nodes of their edges do.

        Arguments:
            edges: by new node.
        """
        led: dict[int, dict[int, frozenset[int]]] = {}
        for f in self.followers:
            led.setdefault(f.node, {}).update(
                dict.fromkeys(f.of if len(f.of) == 1 else (), f.directions)
            )
        more = [
            Follower(node, along, {leader: rigid(np.subtract(places[node], places[leader]))})
            for node, ends in edges.items()
            for leader in led.get(ends[0], ())
            if (
                along := frozenset.intersection(
                    *(led.get(e, {}).get(leader, frozenset()) for e in ends)
                )
            )
        ]
        return replace(self, followers=[*self.followers, *more])

    def groups(self) -> list[str]:
        """Return the groups of the springs."""
        return list(dict.fromkeys(spring.group for spring in self.springs))


def rigid(arm: FloatArray) -> FloatArray:
    """Return the motion at an arm from the motion of a rigid body, (6, 6)."""
    found = np.eye(6)
    found[:3, 3:] = -cross_matrix(arm)
    return found


class NodeMotions:
    """The motions of nodes, (6, n), sparse.

    Arguments:
        solid: elements, of which the lines of nodes count.
        motions: none so far; those of what follows are held.
        used: nodes of elements in their order.
        alone: places of others, which come first.
    """

    def __init__(
        self,
        attached: Attachments,
        solid: Thickened,
        motions: Motions,
        used: Sequence[int],
        alone: Mapping[int, Point],
        path: Path,
    ) -> None:
        self._solid, self._row, self._held, self._path = solid, motions.row, motions.held, path
        # Those without elements, and those of elements whose turn makes others move.
        leaders = attached.leaders() - alone.keys()
        self._added: set[int] = set()
        for node in (*alone, *(n for n in used if n in leaders)):
            free = np.eye(6) if node in alone else self._loose(node)
            self._added.add(node)
            motions.owner = node
            for axis in free.T:
                d = int(np.abs(axis).argmax())
                if (node, d) not in self._held:
                    motions.add(Motion(node, d, np.array(solid.places[node]), axis), {})
        for node in used:
            motions.owner = node
            if node in solid.lines:
                solid.add_motions(node, motions)
            elif node in motions.row:
                motions.add_node(node, np.array(solid.places[node]), {node})
        self.found, moved = motions.matrix()
        self._moved = moved.tocsr()
        self._columns: dict[int, list[int]] = {}
        for i, motion in enumerate(self.found):
            if motion.axes.any():
                self._columns.setdefault(motion.node, []).append(i)
        self._followers: dict[int, list[Follower]] = {}
        for follower in attached.followers:
            self._followers.setdefault(follower.node, []).append(follower)
        self._known: dict[int, SparseArray] = {}
        self._open: set[int] = set()
        for node in self._followers:
            self.of(node)

    @property
    def moved(self) -> SparseArray:
        """Return what the degrees of freedom do to all rows of solids, (3 N, n), by rows."""
        return self._moved

    def reduced(self, matrix: SparseArray) -> SparseArray:
        """Return a matrix of solids (3 N, 3 N) for the degrees of freedom, (n, n).

        Of a body that only follows, rounding would leave a stiffness of any sign.
        """
        found = sp.csc_array(self._moved.T @ matrix @ self._moved)
        if self._followers:
            size = abs(self._moved)
            found = found.multiply(abs(found) > _LOST * (size.T @ abs(matrix) @ size))
        return sp.csc_array(found)

    def of(self, node: int) -> SparseArray:
        """Return the motion of a node; raises InputError where it follows itself."""
        if node not in self._known:
            if node in self._open:
                what = f"node {node} follows itself through rigid elements"
                raise InputError(what, file=self._path, expected="one that leads")
            self._open.add(node)
            self._known[node] = self._find(node)
        return self._known[node]

    def _find(self, node: int) -> SparseArray:
        n, own = len(self.found), self._columns.get(node, [])
        axes = np.array([self.found[i].axes for i in own]).reshape(-1, 6).T
        pick = sp.csr_array((np.ones(len(own)), (range(len(own)), own)), shape=(len(own), n))
        whole = sp.csr_array(axes) @ pick
        led = sp.csr_array((6, n))
        for follower in self._followers.get(node, ()):
            some = np.diag([float(d in follower.directions) for d in range(6)])
            for other, share in follower.of.items():
                led += sp.csr_array(some @ share) @ self.of(other)
        whole = sp.csr_array(whole + led)
        given = self._solid.follow(node, self._held)
        if led.nnz and (pairs := [(self._row[n], m) for n, m in given if n in self._row]):
            rows = [3 * at + d for at, _ in pairs for d in range(3)]
            entries = (np.ones(len(rows)), (rows, range(len(rows))))
            place = sp.csr_array(entries, shape=(self._moved.shape[0], len(rows)))
            follow = sp.csr_array(np.vstack([m for _, m in pairs]))
            self._moved = self._moved + place @ follow @ led
        line = self._solid.straight(node)
        if line is None:
            return whole
        lowest, arm = line
        length = float(np.linalg.norm(arm))
        start, turn = 3 * self._row[lowest], cross_matrix(arm / length**2)
        turned = sp.csr_array(turn) @ (self._moved[start : start + 3] - whole[:3])
        along = np.outer(arm, arm) / length**2
        return sp.csr_array(sp.vstack([whole[:3], turned + sp.csr_array(along) @ whole[3:]]))

    def _loose(self, node: int) -> FloatArray:
        """Return a basis of the rotations of a node that nothing resists, (6, k)."""
        turns = np.diag([float((node, d) not in self._held) for d in range(3, 6)])
        if line := self._solid.straight(node):
            turns = turns @ line[1][:, None] / np.linalg.norm(line[1])
        elif node in self._solid.lines or node not in self._row or node in self._added:
            turns = turns[:, :0]
        free = turns[:, np.abs(turns).max(axis=0) > _NOTHING]
        return np.vstack([0.0 * free, free])

    def stiffness(self, springs: Sequence[NodeSpring]) -> SparseArray:
        """Return the stiffness of springs, (n, n), statically condensed to what has resistance."""
        found = sp.csc_array((len(self.found),) * 2)
        for spring in springs:
            own = np.hstack([part for _, part in spring.ends])
            whole = own.T @ (spring.stiffness[:, None] * own)
            size = np.sqrt(whole.diagonal())
            idle = block_diag(*(self._loose(node) for node, _ in spring.ends))
            taken = whole @ idle
            whole -= taken @ np.linalg.pinv(idle.T @ taken, hermitian=True) @ taken.T
            whole[np.abs(whole) <= _ROUNDING * np.outer(size, size)] = 0.0
            motion = sp.vstack([self.of(node) for node, _ in spring.ends])
            found += motion.T @ sp.csr_array(whole) @ motion
        return sp.csc_array(found)

    def mass(self, masses: Sequence[tuple[int, FloatArray]]) -> SparseArray:
        """Return the mass of what is at nodes, (n, n)."""
        found = sp.csc_array((len(self.found),) * 2)
        for node, matrix in masses:
            found += self.of(node).T @ sp.csr_array(matrix) @ self.of(node)
        return sp.csc_array(found)

    def kept(self, matrix: SparseArray) -> list[int]:
        """Return the degrees of freedom of elements, and of other nodes what is in a matrix.

        Arguments:
            matrix: sum of stiffness and mass, (n, n).

        Raises:
            InputError: for a node that can move by itself all the same.
        """
        carried = abs(matrix).sum(axis=0) > 0.0
        own = (self._columns.get(node, ()) for node in self._added)
        added = np.array([i for columns in own for i in columns if carried[i]], dtype=int)
        count, part = connected_components(matrix[added][:, added])
        for number in range(count):  # chains of springs, and what hangs on one leader
            at = added[part == number]
            block = matrix[at][:, at].toarray()
            size = np.sqrt(block.diagonal())
            values, vectors = np.linalg.eigh(block / np.outer(size, size))
            if values[0] < _ROUNDING:
                node = self.found[at[np.abs(vectors[:, 0]).argmax()]].node
                what = f"nothing resists some motion of node {node}"
                expected = "springs that do; plates do not where it turns about their normal"
                raise InputError(what, file=self._path, expected=expected)
        return [i for i, m in enumerate(self.found) if carried[i] or m.node not in self._added]
