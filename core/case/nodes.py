"""The nodes and degrees of freedom of a model that comes as matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.optimize import nnls
from scipy.spatial import cKDTree

from femubench.core.case.faults import Misfit, WrongDirection
from femubench.core.case.tables import read_table
from femubench.core.errors import InputError, ModelError
from femubench.core.fem.frame import GroundSpring, Place, PointMass, Vector
from femubench.core.fem.links import rigid_arm
from femubench.core.fem.mesh import ON_MEMBER
from femubench.core.fem.model import Dofs, Model
from femubench.core.fem.sensors import DIRECTIONS, Sensors, moved_names, unit_motions
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

_MOST_DOFS = 1_000_000
DOF_COLUMNS = ("row", "node", "direction", "x", "y", "z")
INTERNAL = "internal"  # the column that marks what moves with no motion of the body
BETWEEN = " + "  # the names of nodes that a place lies amid
_STARTS = 4  # nearest nodes, one of which has the element of a point
_NEARER, _ALIKE = 1e-4, 1e-6  # how much near nodes are preferred, and even shares among these


@dataclass(frozen=True)
class MatrixGeometry:
    """Where the rows of the matrices sit: nodes by name, their places and directions.

    Arguments:
        names: the nodes, in the order in which the dofs file first names them.
        dofs: the rows; `dofs.node` counts the names.
        first_row: the number that the dofs file gives to the first row, 0 or 1.
        mesh: which nodes share an element, sparse (k, k); None where a sensor sits at nodes alone.
        spans: numbers of nodes that a strut may tie, where those between are gone; None elsewhere.
        outlines: ends in m of edges that draw a group, (e, 2, 3), by its name; "" of all.
    """

    names: tuple[str, ...]
    dofs: Dofs
    first_row: int = 1
    mesh: SparseArray | None = None
    spans: tuple[tuple[int, int], ...] | None = None
    outlines: Mapping[str, FloatArray] = field(default_factory=dict, compare=False)

    @cached_property
    def rows(self) -> dict[tuple[str, str], int]:
        """Return from (node, direction) to the row."""
        pairs = zip(self.dofs.node, self.dofs.direction, strict=True)
        return {(self.names[node], direction): i for i, (node, direction) in enumerate(pairs)}

    @cached_property
    def rows_of(self) -> dict[str, list[int]]:
        """Return from a node to its rows."""
        found: dict[str, list[int]] = {}
        for (name, _), row in self.rows.items():
            found.setdefault(name, []).append(row)
        return found

    @cached_property
    def places(self) -> dict[str, FloatArray]:
        """Return where the nodes that move with the body are in m, by name."""
        outer = np.flatnonzero(~self.dofs.internal)
        number, first = np.unique(self.dofs.node[outer], return_index=True)
        return {
            self.names[i]: xyz for i, xyz in zip(number, self.dofs.xyz[outer[first]], strict=True)
        }

    @cached_property
    def placed(self) -> tuple[str, ...]:
        """Return the names of the nodes that move with the body, in the order of `points`."""
        return tuple(self.places)

    @cached_property
    def points(self) -> FloatArray:
        """Return where the nodes are in m, (k, 3)."""
        return np.array(list(self.places.values()))

    @cached_property
    def _at(self) -> dict[int, int]:
        """Return from the number of a node to its place in `points`, in the order of these."""
        numbers = np.unique(self.dofs.node[~self.dofs.internal]).tolist()
        return {number: i for i, number in enumerate(numbers)}

    @cached_property
    def _joined(self) -> IntArray:
        """Return the places that a sensor may sit at: not those that hang on a node alone."""
        every = np.arange(len(self.placed))
        return every if self.mesh is None else every[np.diff(self.mesh.indptr)[list(self._at)] > 0]

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points[self._joined])

    def nearest(self, xyz: FloatArray) -> list[tuple[str, FloatArray]]:
        """Return the nearest place of every point and where it is in m: a node, or amid some.

        Arguments:
            xyz: in m, (k, 3).
        """
        found = [self._shares(point) for point in np.atleast_2d(xyz)]
        return [(BETWEEN.join(shares), foot) for shares, foot in found]

    def _shares(self, point: FloatArray) -> tuple[dict[str, float], FloatArray]:
        """Return the shares that nodes have in the motion nearest to a point, and where that is.

        They are those of the simplex of Delaunay among the nodes of the elements there: exact for
        motions of a body and, as are linear elements, for constant strains; no share is negative.
        """
        near = self._tree.query(point, min(_STARTS, len(self._joined)))[1]
        starts = self._joined[np.atleast_1d(near)]
        first = self.points[starts[0]]
        best: tuple[dict[str, float], FloatArray] = ({self.placed[starts[0]]: 1.0}, first)
        gap = float(np.linalg.norm(first - point))
        for start in starts if self.mesh is not None else ():
            if gap <= ON_MEMBER:
                break
            near = self._around(int(start))
            arms = self.points[near] - point
            size = float(np.abs(arms).max())
            far = np.square(arms / size).sum(axis=1)
            sums = [np.ones(len(near)), *(arms / size).T, _NEARER * far]
            wanted = np.zeros(5 + len(near))
            wanted[0] = 1.0
            shares = nnls(np.vstack([*sums, _ALIKE * np.diag(np.sqrt(far))]), wanted)[0]
            shares /= shares.sum()
            foot = shares @ self.points[near]
            if (own := float(np.linalg.norm(foot - point))) < gap - ON_MEMBER:
                some = np.flatnonzero(shares > ON_MEMBER)
                best = {self.placed[near[i]]: float(shares[i]) for i in some}, foot
                gap = own
        return best

    def _around(self, start: int) -> list[int]:
        """Return the places that share an element with one, as `mesh` has them."""
        assert self.mesh is not None
        row = self.mesh[[list(self._at)[start]]]
        return [self._at[node] for node in row.indices if node in self._at]

    def node(self, place: Place) -> str:
        """Return the node of a place; raises Misfit."""
        if str(place) not in self.places:
            raise Misfit(f"there is no node {str(place)!r}", "the name of a node of the dofs file")
        return str(place)

    def point(self, place: Place) -> Vector:
        """Return where a node lies in m; raises Misfit."""
        node = self.node(place)
        x, y, z = (float(v) for v in self.places[node])
        shared = [name for name, _ in self.near((x, y, z)) if name != node]
        if shared:
            raise Misfit(f"node {node!r} shares its place with {shared[0]!r}", "a place of its own")
        return x, y, z

    def check_direction(self, place: Place, direction: str) -> None:
        """Check that a node has a dof in a direction; raises Misfit."""
        node = self.node(place)
        if (node, direction.lstrip("+-")) not in self.rows:
            there = ", ".join(name for other, name in self.rows if other == node)
            raise WrongDirection(f"node {node!r} has no direction {direction!r}", there)

    def check_sensor(self, xyz: Vector, direction: str) -> None:
        """Check that a node with that direction lies at a point; raises Misfit."""
        for name in moved_names(direction):
            self.rows_at(np.array(xyz), name)

    def near(self, xyz: Vector | FloatArray) -> list[tuple[str, float]]:
        """Return the nodes within 1e-6 m of a point with their distances."""
        gaps = np.linalg.norm(self.points - np.array(xyz), axis=1)
        return [(self.placed[i], float(gaps[i])) for i in np.flatnonzero(gaps <= ON_MEMBER)]

    def rows_at(self, xyz: FloatArray, direction: str) -> dict[int, float]:
        """Return the rows that a sensor reads and their shares; raises Misfit."""
        names = [name for name, _ in self.near(xyz)]
        where = f"({', '.join(f'{v:g}' for v in xyz)})"
        if not names:
            shares, foot = self._shares(xyz)
            if np.linalg.norm(foot - xyz) > ON_MEMBER:
                what = "the place of a node, within 1e-6 m"
                raise Misfit(f"there is no node at {where}", what)
            names = [name for name in shares if (name, direction) not in self.rows]
            if not names:
                return {self.rows[name, direction]: share for name, share in shares.items()}
        rows = [self.rows[name, direction] for name in names if (name, direction) in self.rows]
        if not rows:
            there = sorted({d for name, d in self.rows if name in names}, key=DIRECTIONS.index)
            raise WrongDirection(f"direction {direction!r} is no dof at {where}", ", ".join(there))
        if len(rows) > 1:
            what = f"nodes {' and '.join(map(repr, names))} share the place {where}"
            raise Misfit(what, "a sensor at a place of one node")
        return {rows[0]: 1.0}

    def observe(self, sensors: Sensors) -> SparseArray:
        """Return sensor readings from dofs, sparse (n_sensors, n)."""
        axes, entries = sensors.axes, []
        try:
            for i, k in zip(*np.nonzero(axes), strict=True):
                shares = self.rows_at(sensors.xyz[i], DIRECTIONS[k])
                entries += [(axes[i, k] * share, i, row) for row, share in shares.items()]
        except Misfit as misfit:
            raise ModelError(misfit.what) from None
        values, i, rows = np.array(entries, dtype=float).reshape(-1, 3).T
        shape = (len(sensors), len(self.dofs))
        return sp.csr_array((values, (i.astype(int), rows.astype(int))), shape=shape)

    def assemble_attachments(
        self, masses: Sequence[PointMass], springs: Sequence[GroundSpring]
    ) -> tuple[SparseArray, SparseArray]:
        """Return the mass and stiffness that attachments add, sparse (n, n) each.

        Raises:
            ModelError: when a node has no such dof, or an arm needs a rotation that is not there.
        """
        n = len(self.dofs)
        mass, stiffness = sp.csc_array((n, n)), sp.csc_array((n, n))
        try:
            for item in masses:
                rows = self._moved(self.node(item.at), np.array(item.offset))
                mass = mass + item.mass * (rows.T @ rows)
            for spring in springs:
                self.check_direction(spring.at, spring.direction)
                row = self.rows[self.node(spring.at), spring.direction.lstrip("+-")]
                one = sp.csc_array(([spring.stiffness], ([row], [row])), shape=(n, n))
                stiffness = stiffness + one
        except Misfit as misfit:
            raise ModelError(misfit.what) from None
        return sp.csc_array(mass), sp.csc_array(stiffness)

    def _moved(self, node: str, offset: FloatArray) -> SparseArray:
        """Return the displacements of a mass on a rigid arm from the dofs, sparse (3, n)."""
        arm = rigid_arm(offset)[:3]
        own = [self.rows.get((node, name)) for name in DIRECTIONS]
        if all(row is None for row in own[:3]):
            raise ModelError(f"node {node!r} has no translation that a mass could take part in")
        entries: list[tuple[int, int, float]] = []
        for i in range(3):
            for j in np.flatnonzero(arm[i]):
                row = own[j]
                if row is not None:
                    entries.append((i, row, float(arm[i, j])))
                elif j >= 3 and own[i] is not None:
                    what = f"node {node!r} has no rotation {DIRECTIONS[j]} for the arm of a mass"
                    raise ModelError(what)
        i_rows, columns, values = zip(*entries, strict=True)
        return sp.csr_array((values, (i_rows, columns)), shape=(3, len(self.dofs)))


def matrix_model(
    mass: SparseArray,
    stiffness: SparseArray,
    nodes: Sequence[object] | None = None,
    directions: Sequence[str] | None = None,
    xyz: FloatArray | None = None,
    groups: Mapping[str, SparseArray] | None = None,
    internal: BoolArray | None = None,
) -> Model:
    """Return a model of a pair of matrices with labelled rows.

    Arguments:
        mass, stiffness: symmetric, sparse or dense, (n, n) each.
        nodes: the name of every row's node, (n,); None, with `directions`, where rows have no
            labels, which a table must then give.
        directions: one of x y z rx ry rz a row, (n,).
        xyz: position of every row's node, (n, 3); None or nan where it is not known.
        groups: named parts of the stiffness, (n, n) each.
        internal: which rows no motion of the body moves, as those of nodes that a solver adds
            inside elements, (n,); None for none.

    Raises:
        ModelError: when sizes differ, or a degree of freedom is there twice.

    Examples:
        >>> chain = fem.matrix_model(np.eye(2), 5.0 * np.eye(2), ["a", "b"], ["x", "x"])
        >>> chain.geometry.rows["b", "x"]
        1
    """
    n = mass.shape[0]
    if nodes is None or directions is None:
        nodes, directions = range(1, n + 1), ("",) * n
    labels = [str(node) for node in nodes]
    names = {label: i for i, label in enumerate(dict.fromkeys(labels))}
    places = np.full((n, 3), np.nan) if xyz is None else np.asarray(xyz, dtype=float)
    own = {} if groups is None else groups
    shapes = {part.shape for part in (mass, stiffness, *own.values())}
    if shapes != {(n, n)} or {len(labels), len(directions), len(places)} != {n}:
        raise ModelError(f"matrices and labels differ in size from the {n} rows of the mass")
    if len(set(zip(labels, directions, strict=True))) < n:
        raise ModelError("a degree of freedom is there twice")
    numbers = np.array([names[label] for label in labels], dtype=np.int64)
    dofs = Dofs(numbers, tuple(directions), places)
    if internal is not None:
        dofs = mark_internal(dofs, internal)
    parts = {name: sp.csc_array(part, dtype=float) for name, part in own.items()}
    return Model(
        mass=sp.csc_array(mass, dtype=float),
        stiffness=sp.csc_array(stiffness, dtype=float),
        dofs=dofs,
        geometry=MatrixGeometry(tuple(names), dofs),
        groups=parts,
    )


def read_dofs(file: Path) -> MatrixGeometry:
    """Return the dofs of a CSV file row,node,direction,x,y,z; rows count from 0 or from 1.

    A column `internal` has a 1 for rows that no motion of the body moves.

    Raises:
        InputError: for a row listed twice or left out, a dof listed twice, a node at two places.
    """
    table = read_table(file)
    table.check_columns(DOF_COLUMNS, (INTERNAL,))
    if not table.rows or len(table.rows) > _MOST_DOFS:
        raise InputError(f"{len(table.rows)} rows", file=file, expected="a row for every dof")
    numbers = [row.whole("row") for row in table.rows]
    first, count = min(numbers), len(numbers)
    seen: set[int] = set()
    names: dict[str, int] = {}
    places: dict[str, Vector] = {}
    listed: dict[tuple[str, str], int] = {}
    internal = np.zeros(count, dtype=bool)
    for number, row in zip(numbers, table.rows, strict=True):
        if number in seen or first > 1 or number - first >= count:
            expected = f"the numbers 1 to {count} (or 0 to {count - 1}), each once"
            raise row.error("row", f"row {number}", expected)
        seen.add(number)
        node, direction, xyz = row.text("node"), row.direction().lstrip("-"), row.vector()
        if row.cells["direction"] != direction:
            raise row.error("direction", row.cells["direction"], ", ".join(DIRECTIONS))
        if (node, direction) in listed:
            raise row.error("node", f"node {node!r} has {direction} twice", "every dof once")
        if places.setdefault(node, xyz) != xyz:
            raise row.error("x", f"node {node!r} lies at two places", f"{places[node]}")
        names.setdefault(node, len(names))
        listed[node, direction] = number - first
        if row.cells.get(INTERNAL):
            internal[number - first] = row.whole(INTERNAL) > 0
    order = sorted(listed, key=lambda key: listed[key])
    dofs = Dofs(
        node=np.array([names[node] for node, _ in order], dtype=np.int64),
        direction=tuple(direction for _, direction in order),
        xyz=np.array([places[node] for node, _ in order], dtype=float),
    )
    return MatrixGeometry(tuple(names), mark_internal(dofs, internal), first)


def with_mesh(model: Model) -> Model:
    """Return a model from files with the nodes that share an element, so far as K couples them."""
    geometry, size = model.geometry, model.size
    assert isinstance(geometry, MatrixGeometry)
    ones = (np.ones(size), (geometry.dofs.node, np.arange(size)))
    nodes = sp.csr_array(ones, shape=(len(geometry.names), size))
    mesh = sp.coo_array(nodes @ abs(model.stiffness) @ nodes.T)
    moving = np.zeros((len(geometry.names), len(DIRECTIONS)), dtype=bool)
    moving[geometry.dofs.node, [DIRECTIONS.index(d) for d in geometry.dofs.direction]] = True
    alike = (moving[mesh.col] | ~moving[mesh.row]).all(axis=1)  # and move along the same directions
    pairs = (mesh.row[alike], mesh.col[alike])
    mesh = sp.csr_array((np.ones(alike.sum()), pairs), shape=mesh.shape)
    return replace(model, geometry=replace(geometry, mesh=mesh))


def add_node(model: Model, name: str, direction: str, xyz: FloatArray) -> Model:
    """Return a model from files with a further node, which moves in one direction, its last row.

    Arguments:
        name: of the node, which no other one has.
        direction: one of x y z.
        xyz: where it is in m, (3,).
    """
    geometry, own = model.geometry, model.dofs
    assert isinstance(geometry, MatrixGeometry)
    number = len(geometry.names)
    dofs = Dofs(
        np.append(own.node, number),
        (*own.direction, direction),
        np.vstack([own.xyz, xyz]),
        np.vstack([own.motions, unit_motions([direction])]),
    )
    names, mesh = (*geometry.names, name), geometry.mesh
    if mesh is not None:
        mesh = mesh.copy()
        mesh.resize((len(names), len(names)))
    geometry = replace(geometry, names=names, dofs=dofs, mesh=mesh)
    return model.with_dofs(dofs, geometry)


def mark_internal(dofs: Dofs, internal: BoolArray) -> Dofs:
    """Return degrees of freedom of which some move with no motion of the body, (n,)."""
    if not internal.any():
        return dofs
    return replace(dofs, axes=np.where(internal[:, None], 0.0, dofs.motions))


def read_nodes(file: Path) -> dict[str, Vector]:
    """Return the places of nodes of a CSV file node,x,y,z.

    Raises:
        InputError: for a node listed twice, a number that is none.
    """
    table = read_table(file)
    table.check_columns(("node", "x", "y", "z"))
    places: dict[str, Vector] = {}
    for row in table.rows:
        node = row.text("node")
        if node in places:
            raise row.error("node", f"node {node!r} is listed twice", "every node once")
        places[node] = row.vector()
    return places
