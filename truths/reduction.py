"""A small model that gives the modes of a stretched solid: few shapes, and matrices for each power.

Source: proper orthogonal decomposition of snapshots, Rayleigh-Ritz in its space (Benner, Gugercin &
Willcox 2015, SIAM Review 57).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.stats import qmc

from truths.affine import StretchedSolid
from truths.eigenmodes import attach, factorised, lowest, shift_at, translation
from truths.elasticity import Matrices
from truths.modes_of import stations
from truths.remade import RemadeSolid
from truths.seats import DIRECTIONS, observed, rigid_fit, seat_nodes
from truths.structure import Place, Structure

Array = npt.NDArray[np.float64]
KnownSolid = StretchedSolid | RemadeSolid

SPARE = 3  # modes beyond those listed: they mix into those of a changed structure
PURE = 1e-3  # of a mode's motion, across the plane of a planar structure
_SEED = 20260423
_TURNS = {"3d": (0, 1, 2), "in-plane": (1,), "out-of-plane": (0, 1)}
PLANES = {"3d": (0, 1, 2), "in-plane": (0, 2), "out-of-plane": (2,)}


def stretched(structure: Structure, solid: KnownSolid, factors: Array) -> Structure:
    """Return a structure of which all places lie where a stretch moves them."""
    move = solid.stretch.map(factors)
    return replace(structure, warp=lambda points: structure.warped(move(points)))


def drawn_factors(solid: KnownSolid, count: int, seed: int = _SEED) -> Array:
    """Return stretches that fill the ranges of the factors evenly, (count, factors)."""
    low, high = np.log(solid.stretch.ranges).T
    cube: Any = qmc.LatinHypercube  # whose argument is called rng by newer versions
    shares = cube(len(low), seed=seed).random(count)
    return np.asarray(np.exp(low + shares * (high - low)))


def snapshots(structure: Structure, solid: KnownSolid, factors: Array) -> Array:
    """Return modes of a stretched structure, and what forces at seats of changes do, (dofs, n).

    Raises:
        ValueError: where a mode of a planar structure moves both in and across its plane.
    """
    here, matrices = stretched(structure, solid, factors), solid.matrices(factors)
    system = attach(here, matrices, here.lumps, here.springs)
    factor = factorised(system.stiffness + shift_at(here.guess) * system.mass)
    count = here.used + here.held_out + SPARE
    planar = here.plane != "3d"
    found = lowest(system, factor, (2 * count + 16 if planar else count) + 6, here.guess).shapes
    if planar:
        found = found[:, _in_plane(here, matrices, found)]
    loads = system.observe.T @ _loads(here, matrices).T
    bent = np.column_stack([factor.solve(load) for load in loads.toarray().T])
    return np.hstack([found[:, :count], system.observe @ bent])


def _in_plane(structure: Structure, matrices: Matrices, shapes: Array) -> npt.NDArray[np.bool_]:
    """Return which modes move in the drawn plane's directions."""
    motion = observed(structure, matrices, stations(structure)) @ shapes
    squares = (motion**2).reshape(-1, 3, shapes.shape[1]).sum(axis=0)
    share = squares[list(PLANES[structure.plane])].sum(axis=0) / squares.sum(axis=0)
    if np.minimum(share, 1 - share).max() > PURE:
        raise ValueError(f"{structure.name}: a mode moves in and across the plane")
    return np.asarray(share > 0.5)


def _loads(structure: Structure, matrices: Matrices) -> sparse.csr_array:
    """Return unit forces where design changes attach masses and springs, (forces, dofs)."""
    rows, along = [], list(PLANES[structure.plane])
    for change in structure.changes:
        rows += [
            translation(rigid_fit(structure, matrices, lump.at), lump.offset)[along]
            for lump in change.lumps
        ]
        for spring in change.springs:
            fit = rigid_fit(structure, matrices, spring.at)
            rows.append(fit[[DIRECTIONS.index(spring.direction)]])
    return sparse.csr_array(sparse.vstack(rows, format="csr"))


def rigid_fields(structure: Structure, solid: KnownSolid) -> Array:
    """Return fields of which the rigid motions of every stretched shape are sums, (dofs, n)."""
    parts = [solid.stretch.parts(axis, solid.nodes[axis]) for axis in range(3)]
    along = PLANES[structure.plane]
    fields = np.zeros((len(along), solid.nodes.shape[1], 3))
    for field, axis in zip(fields, along, strict=True):
        field[:, axis] = 1.0
    found = list(fields)
    for axis in _TURNS[structure.plane]:
        b, c = (axis + 1) % 3, (axis + 2) % 3
        for name in range(len(solid.stretch.names)):
            field = np.zeros_like(fields[0])
            field[:, b], field[:, c] = -parts[c][name], parts[b][name]
            found.append(field)
    kept = [field.ravel() for field in found if np.abs(field).max() > 0.0]
    return np.array(kept).T


def basis_of(structure: Structure, solid: KnownSolid, taken: Array, size: int) -> Array:
    """Return shapes, (dofs, size at most), of which those of all stretches are sums.

    They have unit energy, as stiffness and mass of the drawing at the guessed frequency have it.

    Arguments:
        taken: snapshots, (dofs, n).
        size: of the basis without rigid motions.
    """
    one = np.ones(len(solid.stretch.names))
    matrices = solid.matrices(one)
    system = attach(replace(structure, clamps=()), matrices, structure.lumps, structure.springs)
    energy = system.stiffness + shift_at(structure.guess) * system.mass
    rigid = np.zeros((taken.shape[0], 0))
    if not structure.clamps:
        rigid = _orthonormal(energy, rigid_fields(structure, solid), 10_000)
    rest = taken / np.sqrt(np.einsum("ij,ij->j", taken, energy @ taken))
    for _ in range(2):
        rest = rest - rigid @ (rigid.T @ (energy @ rest))
    return np.hstack([rigid, _orthonormal(energy, rest, size)])


def _orthonormal(energy: sparse.csc_array, fields: Array, size: int) -> Array:
    """Return the strongest sums of fields, each of unit energy, at most `size` of them."""
    values, vectors = np.linalg.eigh(fields.T @ (energy @ fields))
    strong = np.flatnonzero(values > 1e-10 * values[-1])[::-1][:size]
    return np.asarray(fields @ (vectors[:, strong] / np.sqrt(values[strong])))


@dataclass(frozen=True)
class Seat:
    """The moments of a seat's nodes, from which its rigid motion follows at every stretch.

    Arguments:
        axes, factors: of each piece of the nodes' distances from the place, (pieces,).
        count: of nodes.
        first, second: sums over nodes of pieces, (pieces,), and of their products, m and m2.
        sums: of the shapes' motions over nodes, (3, n).
        moments: of these times pieces, (pieces, 3, n).
    """

    axes: npt.NDArray[np.int64]
    factors: npt.NDArray[np.int64]
    count: int
    first: Array
    second: Array
    sums: Array
    moments: Array


def seat_of(
    structure: Structure, solid: KnownSolid, matrices: Matrices, place: Place, shapes: Array
) -> Seat:
    """Return the moments of a seat of the drawing, of which these are the matrices."""
    nodes = seat_nodes(structure, matrices, place)
    centre = structure.warped(structure.point(place)[:, None])[:, 0]
    pieces = []
    for axis in range(3):
        there = solid.stretch.parts(axis, np.append(solid.nodes[axis, nodes], centre[axis]))
        arms = there[:, :-1] - there[:, -1:]
        pieces += [(axis, f, arms[f]) for f in range(len(arms)) if np.abs(arms[f]).max() > 0.0]
    arms = np.array([arm for *_, arm in pieces])
    motion = shapes.reshape(-1, 3, shapes.shape[1])[nodes]
    return Seat(
        axes=np.array([axis for axis, *_ in pieces]),
        factors=np.array([f for _, f, _ in pieces]),
        count=len(nodes),
        first=arms.sum(axis=1),
        second=arms @ arms.T,
        sums=motion.sum(axis=0),
        moments=np.einsum("pk,kcn->pcn", arms, motion),
    )
