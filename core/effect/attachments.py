"""How points of a model move with its dofs, and the figures that the sizes of effects go by."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from femubench.core.case.nodes import MatrixGeometry
from femubench.core.change.terms import RowOperator, Term
from femubench.core.effect.places import point_of, split_direction
from femubench.core.errors import ModelError
from femubench.core.fem.frame import ACTIVE, Frame, Place
from femubench.core.fem.kinematics import node_at, point_rows
from femubench.core.fem.mesh import ON_MEMBER
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.modal.eigen import cache_by_model, modes_of
from femubench.core.modal.rigid import mass_orthonormal, rigid_body_vectors, rigid_share
from femubench.core.typing import FloatArray, SparseArray

TRANSLATIONS = ("x", "y", "z")
_BAND = 6
_RIGID = 6
_SUSPENDED = 0.95
_HELD = 1e-9


def point_in(model: Model, place: str) -> Place:
    """Return the point that a word of `point_places` stands for; a direction is left out.

    Raises:
        ModelError: when there is no such point.

    Examples:
        >>> effect.point_in(model, "rung-middle@0.5").s
        0.5
    """
    if model.structure is None:
        return Place(joint=split_direction(place)[0])
    return point_of(model.structure.frame, place)


def find_directed_point(source: Frame | Model, place: str) -> tuple[Place, str]:
    """Return the point and the direction that a place with a direction stands for.

    Out of plane there is one translation, which goes unsaid.

    Raises:
        ModelError: when there is no such point, or the direction is missing.

    Examples:
        >>> effect.find_directed_point(frame, "J1")[1]
        'z'
    """
    frame: Frame | None
    if isinstance(source, Frame):
        frame = source
    else:
        frame = None if source.structure is None else source.structure.frame
    head, direction = split_direction(place)
    if direction is None and frame is not None and frame.plane == "out-of-plane":
        direction = "z"
    if direction is None:
        raise ModelError(f"place {place!r} names no direction")
    return Place(joint=head) if frame is None else point_of(frame, head), direction


def list_directed_places(model: Model, points: Sequence[str]) -> tuple[str, ...]:
    """Return the places of points in each direction that they can move in.

    Arguments:
        points: words of `point_places`.

    Examples:
        >>> effect.list_directed_places(model, ["J1", "rung-middle@0.5"])
        ('J1', 'rung-middle@0.5')
    """
    structure = model.structure
    if structure is not None and structure.frame.plane == "out-of-plane":
        return tuple(p for p in points if free_translations(model, point_in(model, p)))
    return tuple(f"{p}:{d}" for p in points for d in free_translations(model, point_in(model, p)))


@cache_by_model
def point_motion(model: Model, at: Place) -> SparseArray:
    """Return the displacement and rotation of a point from the dofs, sparse (6, n).

    Between nodes the element's shape functions interpolate; what cannot move is a row of zeros.

    Arguments:
        model: any model; of one that came as matrices, `at` names a node.

    Raises:
        ModelError: when there is no such place.

    Examples:
        >>> effect.point_motion(model, fem.Place(joint="J1")).shape
        (6, 81)
    """
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
def free_translations(model: Model, at: Place) -> tuple[str, ...]:
    """Return the global directions in which a point can move, of x, y, z.

    Raises:
        ModelError: when there is no such place.

    Examples:
        >>> effect.free_translations(model, fem.Place(joint="J1"))
        ('z',)
    """
    structure, motion = model.structure, point_motion(model, at)
    active = TRANSLATIONS if structure is None else ACTIVE[structure.frame.plane]
    spans = pairwise(motion.indptr[:4])
    sizes = [np.abs(motion.data[start:stop]).max(initial=0.0) for start, stop in spans]
    moving = zip(TRANSLATIONS, sizes, strict=True)
    return tuple(d for d, size in moving if d in active and size > _HELD)


def translation_rows(model: Model, at: Place, directions: Sequence[str]) -> SparseArray:
    """Return the displacements of a point in some global directions, sparse (p, n).

    Raises:
        ModelError: when there is no such place.

    Examples:
        >>> effect.translation_rows(model, fem.Place(joint="J1"), ["z"]).shape
        (1, 81)
    """
    # Picking rows by hand takes a tenth of the time, and there is a point for every hypothesis.
    motion = point_motion(model, at)
    spans = [motion.indptr[i : i + 2] for i in map(DIRECTIONS.index, directions)]
    entries = [np.arange(start, stop) for start, stop in spans]
    where = np.concatenate(entries) if entries else np.zeros(0, dtype=np.int64)
    bounds = np.cumsum([0, *map(len, entries)])
    shape = (len(entries), model.size)
    return sp.csr_array((motion.data[where], motion.indices[where], bounds), shape=shape)


def mass_term(model: Model, places: Sequence[Place]) -> Term:
    """Return the mass matrix of 1 kg at every one of some points, without rotary inertia.

    Raises:
        ModelError: when there is no such place.

    Examples:
        >>> effect.mass_term(model, [fem.Place(joint="J1")]).matrix
        'mass'
    """
    rows = [translation_rows(model, at, free_translations(model, at)) for at in places]
    together = rows[0] if len(rows) == 1 else sp.csr_array(sp.vstack(rows))
    return Term("mass", RowOperator(together, np.eye(together.shape[0])))


def elongation_row(model: Model, ends: tuple[str, str]) -> SparseArray:
    """Return how much further apart two joints get along the line between them, sparse (1, n).

    Raises:
        ModelError: when there are no such joints, or they lie at one point.

    Examples:
        >>> effect.elongation_row(model, ("J1", "J7")).shape
        (1, 81)
    """
    frame = model.frame_structure.frame
    first, last = (Place(joint=name) for name in ends)
    motion = point_motion(model, last)[:3] - point_motion(model, first)[:3]
    along = np.array(frame.joint(ends[1]).xyz) - np.array(frame.joint(ends[0]).xyz)
    length = float(np.linalg.norm(along))
    if length < ON_MEMBER:
        raise ModelError(f"joints {ends[0]!r} and {ends[1]!r} lie at one point")
    return sp.csr_array(sp.csr_array(along[None, :] / length) @ motion)


def with_extra(rows: SparseArray, extra: Sequence[float]) -> SparseArray:
    """Return rows on the dofs of the model and on one that an effect adds behind them.

    Arguments:
        rows: sparse (p, n).
        extra: what each row has there, (p,).

    Examples:
        >>> effect.with_extra(readings[:1], [-1.0]).shape
        (1, 82)
    """
    count, size = rows.shape
    data = np.insert(rows.data, rows.indptr[1:], extra)
    indices = np.insert(rows.indices, rows.indptr[1:], size)
    bounds = rows.indptr + np.arange(count + 1)
    return sp.csr_array((data, indices, bounds), shape=(count, size + 1))


def total_mass(model: Model) -> float:
    """Return the mass of the whole structure in kg.

    Examples:
        >>> round(effect.total_mass(model), 3)
        1.214
    """
    return model.total_mass


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
