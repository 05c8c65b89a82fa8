"""Shell elements as the solids that CalculiX makes of them.

A node becomes a line of two or three nodes along the normal. Where elements meet at more than 20
degrees it becomes a line for each normal, and these move as a rigid body that can swell: a knot.

Source: Dhondt (2004), The Finite Element Method for Three-Dimensional Thermomechanical
Applications, section 2.12, and his manual of CalculiX, "Eight-node shell element", "Knots",
"Expansion of the one-dimensional and two-dimensional elements".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from femubench.fem import FloatArray, SparseArray
from femubench.plugins.readers.nodes import Point
from femubench.plugins.readers.solid_elements import evaluate

Element = tuple[str, tuple[int, ...]]


class Shell(NamedTuple):
    """A kind of shell element.

    Arguments:
        corners: how many; the nodes amid edges follow them.
    """

    solid: str
    functions: str
    corners: int

    @property
    def edges(self) -> tuple[tuple[int, ...], ...]:
        """Return the pairs of corners with a node between them, as a chain."""
        whole = (*range(self.corners), 0)
        return (whole,) if self.functions.endswith("2") else ()

    @property
    def places(self) -> FloatArray:
        """Return where the nodes lie in the reference element, (n, 2)."""
        corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
        corners = corners if self.corners == 4 else corners[[0, 1, 3]]
        pairs = [pair for chain in self.edges for pair in pairwise(chain)]
        return np.vstack([corners, *(corners[list(pair)].mean(axis=0) for pair in pairs)])

    def edge_of(self, point: FloatArray) -> tuple[int, int, int] | None:
        """Return the ends of the edge that a point of the reference element is on, and amid it."""
        for i in range(self.corners):
            start, end = self.places[i], self.places[(i + 1) % self.corners]
            if abs(np.linalg.det(np.stack([end - start, point - start]))) < _STRAIGHT:
                return i, (i + 1) % self.corners, self.corners + i
        return None


SHELLS = {
    "S3": Shell("C3D6", "ElementTriP1", 3),
    "S4": Shell("C3D8I", "ElementQuad1", 4),
    "S6": Shell("C3D15", "ElementTriP2", 3),
    "S8": Shell("C3D20", "ElementQuadS2", 4),
    "S8R": Shell("C3D20R", "ElementQuadS2", 4),
}
BETTER = {"S3": "S6", "S4": "S8R"}
# Corners of the parts of a shell that is cut in four, and which way their axes point.
_QUARTERS = {
    3: [((0.0, 0.0), 0.5), ((0.5, 0.0), 0.5), ((0.0, 0.5), 0.5), ((0.5, 0.5), -0.5)],
    4: [((x, y), 0.5) for x in (0.0, 0.5) for y in (0.0, 0.5)],
}
ALIKE = np.cos(np.deg2rad(20.0))  # of normals: elements that share a line of nodes
_STRAIGHT = 1e-9  # of a unit vector: what rounding leaves of it


class NodeLine(NamedTuple):
    """The nodes that a node of shells becomes along one normal: below, in the middle, above."""

    nodes: tuple[int, int, int]
    normal: FloatArray
    thickness: float

    @property
    def arms(self) -> Iterator[tuple[int, FloatArray]]:
        """Return the nodes and where they lie, seen from the middle."""
        for node, share in zip(self.nodes, (-0.5, 0.0, 0.5), strict=True):
            yield node, share * self.thickness * self.normal


class Motion(NamedTuple):
    """A degree of freedom.

    Arguments:
        node, direction: its label, which counts from 0.
        axes: its unit motion in (x, y, z, rx, ry, rz); zero where no motion of the body moves it.
    """

    node: int
    direction: int
    xyz: FloatArray
    axes: FloatArray


@dataclass
class Motions:
    """How degrees of freedom move the nodes of solids.

    Arguments:
        row: of every node of solids; direction d of it has row 3 row + d.
        held: node and direction of supports.
        early: nodes that come before those of better elements, as `find_lines_of_three` has them.
        owner: the node of the input file whose degrees of freedom are added.
        order: of the degrees of freedom: those inside a line of nodes behind those of nodes.
    """

    row: Mapping[int, int]
    held: Set[tuple[int, int]]
    early: Mapping[int, bool]
    found: list[Motion] = field(default_factory=list)
    owner: int = 0
    order: list[int] = field(default_factory=list)
    entries: list[tuple[int, int, float]] = field(default_factory=list)

    def add(self, motion: Motion, moved: Mapping[int, FloatArray], inner: bool = False) -> None:
        """Add a degree of freedom that moves some nodes along vectors."""
        for node, vector in moved.items():
            if node in self.row:
                start, column = 3 * self.row[node], len(self.found)
                self.entries += [
                    (start + d, column, float(vector[d])) for d in range(3) if vector[d]
                ]
        self.found.append(motion)
        late = not self.early.get(self.owner, False) if inner else self.owner not in self.early
        self.order.append(2 * late + inner)

    def add_node(self, node: int, xyz: FloatArray, moved: Set[int]) -> None:
        """Add the translations of a node, which some nodes follow."""
        for d, axes in enumerate(np.eye(6)[:3]):
            if (node, d) not in self.held:
                along: FloatArray = axes[:3]
                self.add(Motion(node, d, xyz, axes), dict.fromkeys(moved, along))

    def matrix(self) -> tuple[list[Motion], SparseArray]:
        """Return the degrees of freedom and what they do to all rows of solids, (3 N, n)."""
        order = np.argsort(self.order, kind="stable")
        rows, columns, values = np.array(self.entries).reshape(-1, 3).T
        shape = (3 * len(self.row), len(order))
        whole = sp.csc_array((values, (rows.astype(int), columns.astype(int))), shape=shape)
        return [self.found[i] for i in order], sp.csc_array(whole[:, order])


def find_lines_of_three(elements: Mapping[int, Element]) -> dict[int, bool]:
    """Return all nodes, and of which a shell makes a line with a node in the middle."""
    found: dict[int, bool] = {}
    for kind, own in elements.values():
        three = SHELLS[kind].corners if kind in SHELLS and SHELLS[kind].edges else 0
        for i, node in enumerate(own):
            found[node] = i < three or found.get(node, False)
    return found


@cache
def _slopes(kind: str) -> FloatArray:
    """Return the slopes of the functions (n) at the nodes (q), (n, 2, q)."""
    places = SHELLS[kind].places
    return evaluate(SHELLS[kind].functions, places, places.T)[1]


class _QuarterNode(NamedTuple):
    """A node of a quarter of a shell.

    Arguments:
        old: the node of the whole that it is; None for a new one.
        edge: the nodes of the edge that it is on, if any.
        point: its place in the reference element.
    """

    old: int | None
    edge: tuple[int, int, int] | None
    near: int
    point: tuple[float, ...]


@cache
def _quarters(kind: str) -> tuple[list[_QuarterNode], FloatArray]:
    """Return the nodes of all quarters (4 n), and the functions (n) there, (n, 4 n)."""
    shell, found = SHELLS[kind], []
    places = shell.places
    at = np.vstack([start + turn * places for start, turn in _QUARTERS[shell.corners]])
    for point in at:
        same = np.flatnonzero(np.abs(places - point).max(axis=1) < _STRAIGHT)
        near = int(np.abs(places[: shell.corners] - point).sum(axis=1).argmin())
        old = int(same[0]) if len(same) else None
        label = tuple(np.round(point, 6).tolist())
        found.append(_QuarterNode(old, shell.edge_of(point), near, label))
    return found, evaluate(shell.functions, places, at.T)[0]


def split_shells(
    elements: Mapping[int, Element], places: Mapping[int, Point]
) -> tuple[dict[int, list[Element]], dict[int, Point], dict[int, tuple[int, ...]]]:
    """Return the four parts of every shell with nodes amid its edges, all nodes, and their edges.

    New nodes lie on the surface of the element; of those on an edge the nodes of it are returned.

    Arguments:
        elements: kind and nodes by number.
    """
    found, own_places = {}, dict(places)
    edges: dict[int, tuple[int, ...]] = {}
    known: dict[tuple[object, ...], int] = {}
    first = max(places) + 1
    for number, (kind, own) in elements.items():
        if kind not in SHELLS or not SHELLS[kind].edges:
            continue
        parts, functions = _quarters(kind)
        nodes = []
        for part, where in zip(parts, functions.T @ [places[n] for n in own], strict=True):
            if part.old is not None:
                nodes.append(own[part.old])
                continue
            ends = () if part.edge is None else tuple(own[i] for i in part.edge)
            # Two elements share a node of an edge by its ends and the nearer of these.
            key = (*sorted(ends[:2]), own[part.near]) if ends else (-number, *part.point)
            if key not in known:
                known[key] = first + len(known)
                x, y, z = where
                own_places[known[key]] = float(x), float(y), float(z)
                edges |= {known[key]: ends} if ends else {}
            nodes.append(known[key])
        n = len(own)
        found[number] = [(kind, tuple(nodes[i : i + n])) for i in range(0, 4 * n, n)]
    return found, own_places, edges


def find_normals(kind: str, xyz: FloatArray) -> FloatArray:
    """Return the unit normals of an element at its nodes, (n, 3), from their places (n, 3).

    Raises:
        ValueError: for an element without an area.
    """
    along = np.einsum("na,nkq->kqa", xyz, _slopes(kind))
    across = np.cross(*along)
    length = np.linalg.norm(across, axis=1)
    if (
        not (length > _STRAIGHT * np.ptp(xyz) ** 2).all()
        or (across @ across.sum(axis=0) <= 0).any()
    ):
        raise ValueError("an element has no area, or edges that cross")
    return np.asarray(across / length[:, None])


@dataclass(frozen=True)
class Thickened:
    """The solids that shells become.

    Arguments:
        elements: all of a deck, solids in place of shells.
        lines: of nodes, by the node of shells that they come from.
    """

    elements: dict[int, Element]
    places: dict[int, Point]
    lines: dict[int, list[NodeLine]]

    def add_motions(self, node: int, motions: Motions) -> None:
        """Add what a node of shells does, the mean of the lines through it."""
        lines, held, xyz = self.lines[node], motions.held, np.array(self.places[node])
        arms = {own: arm for line in lines for own, arm in line.arms}
        first = lines[0]
        if self.straight(node):
            self._add_line(node, xyz, arms, motions)
        else:
            motions.add_node(node, xyz, {node, *arms})
            for axis, axes in enumerate(np.eye(6)[3:], start=3):
                if (node, axis) not in held:
                    turned = {own: np.cross(axes[3:], arm) for own, arm in arms.items()}
                    motions.add(Motion(node, axis, xyz, axes), turned)
            motions.add(Motion(first.nodes[0], 0, xyz, np.zeros(6)), arms)
        for d in range(3):
            middle = {line.nodes[1]: np.eye(3)[d] for line in lines if line.nodes[1] in motions.row}
            if middle and (node, d) not in held and len(lines) == 1:
                motions.add(Motion(first.nodes[1], d, xyz, np.zeros(6)), middle, inner=True)

    def straight(self, node: int) -> tuple[int, FloatArray] | None:
        """Return the lowest node of the straight line that a node became, and its arm."""
        lines = self.lines.get(node, ())
        if not lines or any(abs(e.normal @ lines[0].normal) <= 1.0 - _STRAIGHT for e in lines):
            return None
        return next(lines[0].arms)

    def swell(self, row: Mapping[int, int], factor: float) -> SparseArray:
        """Return what makes lines of nodes so many times as long, and turn as before, (N, N).

        It acts on places as on displacements. What the middle moves by itself grows with the square
        of the factor, as it bulges where a plate bends.

        Arguments:
            row: of every node of solids.
        """
        found = sp.eye_array(len(row), format="lil")
        for line in (line for lines in self.lines.values() for line in lines):
            below, middle, above = (row.get(node) for node in line.nodes)
            for own, other in ((below, above), (above, below)):
                found[own, own], found[own, other] = (1.0 + factor) / 2.0, (1.0 - factor) / 2.0
            if middle is not None:
                found[middle, middle] = factor**2
                found[middle, below] = found[middle, above] = (1.0 - factor**2) / 2.0
        return sp.csr_array(found)

    def follow(self, node: int, held: Set[tuple[int, int]]) -> Iterator[tuple[int, FloatArray]]:
        """Return the nodes of solids, and how they move with a motion that a node is given, (3, 6).

        As in `_add_line`, u = (1 - B B^T) (w + r x a) + B z.
        """
        arms = {own: arm for line in self.lines.get(node, ()) for own, arm in line.arms}
        straight = self.straight(node)
        yield node, np.eye(3, 6)
        if straight is None:
            for own, arm in arms.items():
                yield own, np.hstack([np.eye(3), -cross_matrix(arm)])
            return
        _, least = straight
        free = _free_of(self._across(node, least / np.linalg.norm(least), held))
        kept = np.eye(3) - free @ free.T
        given = kept @ np.hstack([np.eye(3), -cross_matrix(least)])
        for own, arm in arms.items():
            share = float(arm @ least / (least @ least))
            yield own, np.eye(3, 6) + share * (given - np.eye(3, 6))

    def _across(self, node: int, normal: FloatArray, held: Set[tuple[int, int]]) -> FloatArray:
        """Return what the held rotations of a line of nodes stop at its ends, (k, 3)."""
        axes = [np.cross(np.eye(3)[d], normal) for d in range(3) if (node, 3 + d) in held]
        return np.array(axes).reshape(-1, 3)

    def _add_line(
        self, node: int, xyz: FloatArray, arms: Mapping[int, FloatArray], motions: Motions
    ) -> None:
        """Add the mean of a straight line of nodes, and of its lowest node what is free.

        With w of the mean, u of the lowest node at the arm a, and n along the line, another node
        moves by w + (b . n / a . n) (u - w). A rotation about e that is held leaves
        (e x n) . (u - w) at zero, so that u = w - B B^T w + B z.
        """
        lowest, normal, _ = self.lines[node][0]
        least = arms[lowest[0]] @ normal
        share = {own: float(arm @ normal / least) for own, arm in arms.items()}
        free = _free_of(self._across(node, normal, motions.held))
        kept = np.eye(3) - free @ free.T
        for d in range(3):
            if (node, d) not in motions.held:
                along = np.eye(3)[d]
                moved = {own: along + s * (kept[d] - along) for own, s in share.items()}
                unit = np.eye(6)[d]
                motions.add(Motion(node, d, xyz, unit), {node: along, **moved})
        below, left = xyz + arms[lowest[0]], [0, 1, 2]
        for column in free.T:
            d = max(left, key=lambda d: abs(column[d]))
            left.remove(d)
            moved = {own: s * column for own, s in share.items()}
            motions.add(Motion(lowest[0], d, below, np.r_[column, np.zeros(3)]), moved)


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Return the matrix that multiplies as a vector crosses, (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _free_of(held: FloatArray) -> FloatArray:
    """Return a basis of the motions that move along none of some vectors (k, 3), (3, 3 - rank)."""
    if not len(held):
        return np.eye(3)
    _, sizes, turn = np.linalg.svd(held)
    return np.asarray(turn[int((sizes > _STRAIGHT).sum()) :].T)


def thicken(
    elements: Mapping[int, Element], places: Mapping[int, Point], thickness: Mapping[int, float]
) -> Thickened:
    """Return what CalculiX makes of the shells among some elements.

    Arguments:
        elements: kind and nodes by number.

    Raises:
        ValueError: with the number of an element without an area.
    """
    ends: dict[int, list[tuple[int, int, FloatArray]]] = {}
    shells = sorted(number for number, (kind, _) in elements.items() if kind in SHELLS)
    for number in shells:
        kind, own = elements[number]
        try:
            normals = find_normals(kind, np.array([places[node] for node in own]))
        except ValueError:
            raise ValueError(number) from None
        for i, node in enumerate(own):
            ends.setdefault(node, []).append((number, i, normals[i]))
    found, next_node = dict(places), max(places) + 1
    lines: dict[int, list[NodeLine]] = {}
    line_of: dict[tuple[int, int], NodeLine] = {}
    for node, meeting in ends.items():
        for part in _parts(meeting, elements, thickness):
            mean = np.sum([normal for _, _, normal in part], axis=0)
            normal: FloatArray = np.divide(mean, np.linalg.norm(mean))
            three = next_node, next_node + 1, next_node + 2
            line = NodeLine(three, normal, thickness[part[0][0]])
            next_node += 3
            for own_node, arm in line.arms:
                x, y, z = places[node] + arm
                found[own_node] = float(x), float(y), float(z)
            lines.setdefault(node, []).append(line)
            line_of |= {(number, i): line for number, i, _ in part}
    solids = dict(elements)
    for number in shells:
        kind, own = elements[number]
        own_lines = [line_of[number, i].nodes for i in range(len(own))]
        below, middle, above = (list(side) for side in zip(*own_lines, strict=True))
        n = SHELLS[kind].corners
        amid = middle[:n] if SHELLS[kind].edges else []
        solids[number] = (
            SHELLS[kind].solid,
            (*below[:n], *above[:n], *below[n:], *above[n:], *amid),
        )
    return Thickened(solids, found, lines)


def _parts(
    meeting: Sequence[tuple[int, int, FloatArray]],
    elements: Mapping[int, Element],
    thickness: Mapping[int, float],
) -> Iterator[list[tuple[int, int, FloatArray]]]:
    """Return the elements that meet at a node by normal, kind and thickness, the first first."""
    left = list(meeting)
    while left:
        number, _, normal = left[0]
        alike = [
            own @ normal > ALIKE
            and thickness[other] == thickness[number]
            and elements[other][0] == elements[number][0]
            for other, _, own in left
        ]
        yield [item for item, same in zip(left, alike, strict=True) if same]
        left = [item for item, same in zip(left, alike, strict=True) if not same]
