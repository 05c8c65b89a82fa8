"""Rigid-body motions: their shapes from geometry, and how much of a mode lies in them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la

from femubench.core.fem.model import Dofs, Model
from femubench.core.typing import FloatArray

_Motion = Callable[[FloatArray, FloatArray], FloatArray]
_ZERO_ENERGY = 1e-12
_HELD = 1e-9  # of a motion whose largest translation is 1


def rigid_body_vectors(dofs: Dofs) -> FloatArray:
    """Return the rigid-body motions of labelled dofs, (n, r) with r up to six.

    Three translations and three rotations about the centroid, those that move nothing left out.
    """
    vectors = _motions(dofs)(dofs.xyz, dofs.motions)
    # A plane off the origin leaves roundoff in what moves nothing.
    return np.asarray(vectors[:, np.abs(vectors).max(axis=0, initial=0.0) > _HELD])


def _motions(dofs: Dofs) -> _Motion:
    """Return the six motions of a body about the centroid, from positions and axes of dofs."""
    centre = dofs.xyz.mean(axis=0)
    size = max(float(np.abs(dofs.xyz - centre).max()), 1e-12)

    def motion(xyz: FloatArray, axes: FloatArray) -> FloatArray:
        shifts, turns = axes[:, :3], axes[:, 3:]
        return np.hstack([shifts, np.cross((xyz - centre) / size, shifts) + turns / size])

    return motion


def rigid_modes_of(model: Model) -> FloatArray:
    """Return the rigid-body motions that the model leaves free, mass-orthonormal, (n, r).

    Of a frame it is the supports and springs to ground that decide, whatever an update made of
    the matrices; of a model from files, the strain energy.

    Examples:
        >>> rigid = modal.rigid_modes_of(model)
        >>> np.allclose(rigid.T @ model.mass @ rigid, np.eye(3))
        True
    """
    motion, structure = _motions(model.dofs), model.structure
    if structure is None:
        basis = rigid_body_vectors(model.dofs)
        basis = orthonormal(basis, basis.T @ (model.mass @ basis))
        candidates = basis
        if basis.shape[1] > 0:  # those without energy
            scale = np.abs(model.stiffness).sum(axis=0) @ np.square(basis)
            energy = basis.T @ (model.stiffness @ basis) / np.sqrt(np.outer(scale, scale))
            values, turn = la.eigh(0.5 * (energy + energy.T))
            free = turn[:, np.abs(values) < _ZERO_ENERGY] / np.sqrt(scale)[:, None]
            candidates = np.asarray(basis @ free)
    else:
        rests_on = structure.interpolation if structure.frame.springs else ()
        candidates = structure.once("free motions", rests_on, lambda: structure.loose(motion))
    return mass_orthonormal(model, candidates)


def rigid_continuation(dofs: Dofs, rigid: FloatArray) -> _Motion:
    """Return how rigid-body motions move further dofs, from their positions (k, 3) and axes (k, 6).

    Arguments:
        dofs: where the motions are known.
        rigid: combinations of motions of a rigid body, (n, r).
    """
    motion = _motions(dofs)
    combined = np.linalg.lstsq(motion(dofs.xyz, dofs.motions), rigid)[0]  # there may be none
    return lambda xyz, axes: np.asarray(motion(xyz, axes) @ combined)


def mass_orthonormal(model: Model, vectors: FloatArray) -> FloatArray:
    """Return a mass-orthonormal basis of some motions, dependent ones left out, (n, r)."""
    return orthonormal(vectors, vectors.T @ model.mass_times(vectors))


def orthonormal(vectors: FloatArray, gram: FloatArray, apart: float = 1e-10) -> FloatArray:
    """Return an orthonormal basis of vectors by their products, but for dependent ones, (n, r)."""
    if vectors.shape[1] == 0:
        return vectors
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    values, turn = la.eigh(gram / np.outer(scale, scale))
    keep = values > apart * values[-1]
    return np.asarray((vectors / scale) @ (turn[:, keep] / np.sqrt(values[keep])))


def rigid_share(model: Model, shapes: FloatArray, rigid: FloatArray) -> FloatArray:
    """Return the share of each shape's kinetic energy that is rigid-body motion, 0..1, (m,).

    Arguments:
        shapes, rigid: mass-normalised, (n, m) and (n, r).
    """
    return np.asarray(np.square(model.mass_times(rigid).T @ shapes).sum(axis=0))
