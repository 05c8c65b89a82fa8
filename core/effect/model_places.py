"""Where the places of a model lie among its elements and dofs, and how its points move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from femubench.core.case.nodes import MatrixGeometry, add_node
from femubench.core.case.spans import find_spans, spread_nodes
from femubench.core.change.terms import RowOperator, Term
from femubench.core.effect.places import Places, bare_place, split_direction
from femubench.core.errors import ModelError
from femubench.core.fem.frame import ACTIVE, Place
from femubench.core.fem.kinematics import node_at, point_rows
from femubench.core.fem.mesh import ON_MEMBER
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.modal.eigen import cache_by_model, modes_of
from femubench.core.modal.rigid import mass_orthonormal, rigid_body_vectors, rigid_share
from femubench.core.typing import FloatArray, IntArray, SparseArray

TRANSLATIONS = ("x", "y", "z")
_BAND = 6
_RIGID = 6
_SUSPENDED = 0.95
_HELD = 1e-9
_FEW = 4
_OFF = 0.01  # of the size of the structure


@dataclass(frozen=True)
class ModelPlaces:
    """The places of a model, a meshed frame or one from matrices, whose nodes are places."""

    model: Model

    @property
    def nodes(self) -> Mapping[str, FloatArray]:
        """Return where joints of a frame, or nodes of matrices, are in m."""
        if self.model.structure is not None:
            return {j.name: np.array(j.xyz) for j in self.model.structure.frame.joints}
        geometry = self.model.geometry
        return geometry.places if isinstance(geometry, MatrixGeometry) else {}

    def elements(self, place: str, *, arms: bool = False) -> IntArray:
        """Return the rows of the mesh at ``all``, a member, a set of members or ``member/k``.

        Pieces of split elements are there too.

        Arguments:
            place: where.
            arms: whether the massless arms of joint springs count with their member.

        Raises:
            ModelError: when there is no such place.

        Examples:
            >>> print(effect.ModelPlaces(model).elements("rung-middle"))
            [24 25 26 27]
        """
        structure = self.model.frame_structure
        mesh, frame = structure.mesh, structure.frame
        plain = np.isnan(mesh.arm_factor)
        named = Places(frame).members(place)
        if named:
            chosen = np.isin(mesh.member, [frame.member_index[name] for name in named])
        else:
            member, _, number = place.rpartition("/")
            if member not in frame.member_index or not number.isdecimal():
                raise ModelError(f"there is no place {place!r}")
            chosen = (mesh.member == frame.member_index[member]) & (mesh.number == int(number))
            arms = False
        rows = np.flatnonzero(chosen if arms else chosen & plain)
        if not len(rows):
            raise ModelError(f"there is no place {place!r}")
        return rows

    def points(self, *, few: bool = False) -> tuple[str, ...]:
        """Return where something may be attached: every joint, free ends too, and along members.

        A member of up to four elements offers its mesh nodes, a longer one those nearest to its
        quarter points; a model that came as matrices offers its nodes.

        Arguments:
            few: whether of more than 25 nodes of matrices those far from each other are enough.

        Examples:
            >>> effect.ModelPlaces(model).points()[-3:]
            ('rung-middle@0.25', 'rung-middle@0.5', 'rung-middle@0.75')
        """
        if self.model.structure is None:
            geometry = self.model.geometry
            if not isinstance(geometry, MatrixGeometry):
                return ()
            return spread_nodes(geometry, geometry.placed) if few else geometry.placed
        frame = self.model.structure.frame
        points = [joint.name for joint in frame.joints]
        for member in frame.members:
            count = member.elements
            nodes = range(1, count) if count <= _FEW else [round(q * count / 4) for q in (1, 2, 3)]
            points += [f"{member.name}@{k / count:g}" for k in nodes]
        return tuple(points)

    def point(self, place: str) -> Place:
        """Return the point that a word of `points` stands for; a direction is left out.

        Raises:
            ModelError: when there is no such point.

        Examples:
            >>> effect.ModelPlaces(model).point("rung-middle@0.5").s
            0.5
        """
        if self.model.structure is None:
            return Place(joint=split_direction(place)[0])
        return Places(self.model.structure.frame).point(place)

    def directed_point(self, place: str) -> tuple[Place, str]:
        """Return the point and the direction of a place with one, as `Places.directed_point`.

        Raises:
            ModelError: when there is no such point, or the direction is missing.

        Examples:
            >>> effect.ModelPlaces(model).directed_point("J1")[1]
            'z'
        """
        if self.model.structure is not None:
            return Places(self.model.structure.frame).directed_point(place)
        head, direction = split_direction(bare_place(place))
        if direction is None:
            raise ModelError(f"place {place!r} names no direction")
        return Place(joint=head), direction

    def directed(self, points: Sequence[str]) -> tuple[str, ...]:
        """Return the places of points in each direction that they can move in.

        Arguments:
            points: words of `points`.

        Examples:
            >>> effect.ModelPlaces(model).directed(["J1", "rung-middle@0.5"])
            ('J1', 'rung-middle@0.5')
        """
        structure = self.model.structure
        free = {place: self.free(self.point(place)) for place in points}
        if structure is not None and structure.frame.plane == "out-of-plane":
            return tuple(place for place, directions in free.items() if directions)
        return tuple(f"{place}:{d}" for place, directions in free.items() for d in directions)

    def motion(self, at: Place) -> SparseArray:
        """Return the displacement and rotation of a point from the dofs, sparse (6, n).

        Between nodes the element's shape functions interpolate; what cannot move is a row of zeros.

        Arguments:
            at: a point; of a model that came as matrices it names a node.

        Raises:
            ModelError: when there is no such place.

        Examples:
            >>> effect.ModelPlaces(model).motion(fem.Place(joint="J1")).shape
            (6, 81)
        """
        return _motion(self.model, at)

    def free(self, at: Place) -> tuple[str, ...]:
        """Return the global directions in which a point can move, of x, y, z.

        Raises:
            ModelError: when there is no such place.

        Examples:
            >>> effect.ModelPlaces(model).free(fem.Place(joint="J1"))
            ('z',)
        """
        return _free(self.model, at)

    def translations(self, at: Place, directions: Sequence[str]) -> SparseArray:
        """Return the displacements of a point in some global directions, sparse (p, n).

        Raises:
            ModelError: when there is no such place.

        Examples:
            >>> effect.ModelPlaces(model).translations(fem.Place(joint="J1"), ["z"]).shape
            (1, 81)
        """
        # Picking rows by hand takes a tenth of the time, and there is a point for every hypothesis.
        motion = self.motion(at)
        spans = [motion.indptr[i : i + 2] for i in map(DIRECTIONS.index, directions)]
        entries = [np.arange(start, stop) for start, stop in spans]
        where = np.concatenate(entries) if entries else np.zeros(0, dtype=np.int64)
        bounds = np.cumsum([0, *map(len, entries)])
        shape = (len(entries), self.model.size)
        return sp.csr_array((motion.data[where], motion.indices[where], bounds), shape=shape)

    def mass_term(self, points: Sequence[Place]) -> Term:
        """Return the mass matrix of 1 kg at every one of some points, without rotary inertia.

        Raises:
            ModelError: when there is no such place.

        Examples:
            >>> effect.ModelPlaces(model).mass_term([fem.Place(joint="J1")]).matrix
            'mass'
        """
        rows = [self.translations(at, self.free(at)) for at in points]
        together = rows[0] if len(rows) == 1 else sp.csr_array(sp.vstack(rows))
        return Term("mass", RowOperator(together, np.eye(together.shape[0])))

    def elongation(self, ends: tuple[str, str]) -> SparseArray:
        """Return how much further apart two joints or nodes get along their line, sparse (1, n).

        Raises:
            ModelError: when there are no such joints, or they lie at one point.

        Examples:
            >>> effect.ModelPlaces(model).elongation(("J1", "J7")).shape
            (1, 81)
        """
        first, last = (Place(joint=name) for name in ends)
        motion = self.motion(last)[:3] - self.motion(first)[:3]
        along = self.nodes[ends[1]] - self.nodes[ends[0]]
        length = float(np.linalg.norm(along))
        if length < ON_MEMBER:
            raise ModelError(f"{ends[0]!r} and {ends[1]!r} lie at one point")
        return sp.csr_array(sp.csr_array(along[None, :] / length) @ motion)

    def spans(self) -> tuple[tuple[str, str], ...]:
        """Return the pairs of nodes of matrices to which the body leads by a detour, of up to 25.

        Examples:
            >>> effect.ModelPlaces(model).spans()
            ()
        """
        geometry = self.model.geometry
        if not isinstance(geometry, MatrixGeometry):
            return ()
        if geometry.spans is None:
            return _spans(self.model)
        return tuple((geometry.names[a], geometry.names[b]) for a, b in geometry.spans)

    def add_node(self, at: Place, direction: str) -> Model:
        """Return matrices with a further node, their last row, that moves in one direction.

        It lies off a node along that direction, where it turns with it as if it were there, and has
        neither mass nor stiffness yet.

        Arguments:
            at: a node.
            direction: one of x, y, z.
        """
        xyz, points = self.nodes[str(at)].copy(), np.array(list(self.nodes.values()))
        xyz[TRANSLATIONS.index(direction)] += _OFF * float(np.ptp(points, axis=0).max())
        name = f"{at}~{direction}"
        while name in self.nodes:
            name += "~"
        return add_node(self.model, name, direction, xyz)

    def node_pairs(self, place: str) -> tuple[tuple[str, str], ...]:
        """Return the pairs of ``A-B``, or of ``A+B-C+D``, where A faces C and B faces D.

        A direction is left out; names with a dash or a plus of their own are understood.

        Raises:
            ModelError: when there are no such nodes, or more on one side than on the other.

        Examples:
            >>> effect.ModelPlaces(model).node_pairs("J1+J3-J7+J9")
            (('J1', 'J7'), ('J3', 'J9'))
        """
        known = self.nodes
        words = split_direction(place)[0].split("-")
        for cut in range(1, len(words)):
            sides = [_names("-".join(part), known) for part in (words[:cut], words[cut:])]
            if sides[0] and len(sides[0]) == len(sides[1]) and not set(sides[0]) & set(sides[1]):
                return tuple(zip(*sides, strict=True))
        raise ModelError(f"there is no pair of nodes {place!r}")

    def pair_directions(self, place: str) -> tuple[str, ...]:
        """Return the direction of pairs of nodes, or all translations that all of them can make.

        Raises:
            ModelError: when there are no such nodes, or they cannot move that way.

        Examples:
            >>> effect.ModelPlaces(model).pair_directions("J1-J7")
            ('z',)
        """
        names = [name for pair in self.node_pairs(place) for name in pair]
        free = [self.free(Place(joint=name)) for name in names]
        shared = tuple(d for d in free[0] if all(d in other for other in free))
        direction = split_direction(place)[1]
        found = shared if direction is None else tuple(d for d in shared if d == direction)
        if not found:
            raise ModelError(f"the nodes of {place!r} do not move that way")
        return found


def _names(word: str, known: Mapping[str, FloatArray]) -> list[str]:
    """Return the nodes of ``A+B``; nothing where one is unknown."""
    if word in known:
        return [word]
    parts = word.split("+")
    for cut in range(1, len(parts)):
        first, rest = "+".join(parts[:cut]), _names("+".join(parts[cut:]), known)
        if first in known and rest:
            return [first, *rest]
    return []


@cache_by_model
def _motion(model: Model, at: Place) -> SparseArray:
    structure, geometry = model.structure, model.geometry
    if structure is not None:
        mesh, transform = structure.mesh, structure.kinematics.transform
        node = node_at(structure.frame, mesh, at)
        if node is not None:
            return transform[6 * node : 6 * node + 6]
        return point_rows(structure.frame, mesh, structure.properties, at) @ transform
    if not isinstance(geometry, MatrixGeometry) or at.joint not in geometry.places:
        raise ModelError(f"there is no node {str(at)!r}")
    found = [(i, geometry.rows.get((str(at.joint), d))) for i, d in enumerate(DIRECTIONS)]
    entries = [(i, row) for i, row in found if row is not None]
    index = ([i for i, _ in entries], [row for _, row in entries])
    return sp.csr_array((np.ones(len(entries)), index), shape=(6, model.size))


@cache_by_model
def _spans(model: Model) -> tuple[tuple[str, str], ...]:
    return find_spans(model, ModelPlaces(model).points())


@cache_by_model
def _free(model: Model, at: Place) -> tuple[str, ...]:
    structure, motion = model.structure, _motion(model, at)
    active = TRANSLATIONS if structure is None else ACTIVE[structure.frame.plane]
    spans = pairwise(motion.indptr[:4])
    sizes = [np.abs(motion.data[start:stop]).max(initial=0.0) for start, stop in spans]
    moving = zip(TRANSLATIONS, sizes, strict=True)
    return tuple(d for d, size in moving if d in active and size > _HELD)


@cache_by_model
def elastic_band(model: Model) -> FloatArray:
    """Return the lowest six elastic natural frequencies in Hz, fewer where there are fewer.

    Raises:
        ModelError: when the model has no elastic mode.

    Examples:
        >>> print(effect.elastic_band(model).round())
        [ 256.  278.  581.  911. 1049. 1318.]
    """
    modes = modes_of(model, _BAND + _RIGID).elastic
    frequencies = modes.natural_frequencies
    # On a soft suspension the structure still moves as a rigid body: no scale to go by.
    rigid = mass_orthonormal(model, rigid_body_vectors(model.dofs))
    bodily = rigid_share(model, modes.shapes, rigid) > _SUSPENDED
    for chosen in (frequencies[(frequencies > 0.0) & ~bodily], frequencies[frequencies > 0.0]):
        if len(chosen):
            return np.asarray(chosen[:_BAND])
    raise ModelError("the model has no elastic mode")
