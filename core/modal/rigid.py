"""Rigid-body motions: their shapes from geometry, and how much of a mode lies in them."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femubench.core.measurement import DIRECTIONS
from femubench.core.model import Dofs, Model
from femubench.core.typing import FloatArray

_ZERO_ENERGY = 1e-12


def rigid_body_vectors(dofs: Dofs) -> FloatArray:
    """Return the rigid-body motions of labelled dofs, (n, r) with r up to six.

    Three translations and three rotations about the centroid, those that move nothing left out.
    """
    centred = dofs.xyz - dofs.xyz.mean(axis=0)
    size = max(float(np.abs(centred).max()), 1e-12)
    x, y, z = (centred / size).T
    zero, one = np.zeros_like(x), np.ones_like(x)
    motions = {
        "x": (one, zero, zero, zero, z, -y),
        "y": (zero, one, zero, -z, zero, x),
        "z": (zero, zero, one, y, -x, zero),
        "rx": (zero, zero, zero, one / size, zero, zero),
        "ry": (zero, zero, zero, zero, one / size, zero),
        "rz": (zero, zero, zero, zero, zero, one / size),
    }
    table = np.array([motions[name] for name in DIRECTIONS])  # direction, motion, dof
    if dofs.axes is None:
        index = np.array([DIRECTIONS.index(name) for name in dofs.direction])
        vectors = table[index, :, np.arange(len(dofs))]
    else:
        vectors = np.einsum("nd,dmn->nm", dofs.axes, table)
    moving = np.abs(vectors).max(axis=0) > 0.0
    return np.asarray(vectors[:, moving])


def rigid_modes_of(model: Model) -> FloatArray:
    """Return the rigid-body motions that the model leaves free, mass-orthonormal, (n, r).

    A motion is free where it costs no strain energy: supports and springs to ground take some
    away. Low-rank changes are left out of the judgement, since it is the structure that is
    asked, not what an update made of it.
    """
    vectors = rigid_body_vectors(model.dofs)
    structure = model.structure
    mass, stiffness = (model.mass, model.stiffness) if structure is None else structure.matrices()
    vectors = _orthonormal(vectors, vectors.T @ (mass @ vectors))
    if vectors.shape[1] == 0:
        return vectors
    force = stiffness @ vectors
    scale = np.abs(stiffness).sum(axis=0) @ np.square(vectors)
    energy = vectors.T @ force / np.sqrt(np.outer(scale, scale))
    values, turn = la.eigh(0.5 * (energy + energy.T))
    free = turn[:, np.abs(values) < _ZERO_ENERGY] / np.sqrt(scale)[:, None]
    candidates = vectors @ free
    return _orthonormal(candidates, candidates.T @ (mass @ candidates))


def _orthonormal(vectors: FloatArray, gram: FloatArray) -> FloatArray:
    if vectors.shape[1] == 0:
        return vectors
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    values, turn = la.eigh(gram / np.outer(scale, scale))
    keep = values > 1e-10 * values[-1]
    return np.asarray((vectors / scale) @ (turn[:, keep] / np.sqrt(values[keep])))


def rigid_share(model: Model, shapes: FloatArray, rigid: FloatArray) -> FloatArray:
    """Return the share of each shape's kinetic energy that is rigid-body motion, 0..1, (m,)."""
    if rigid.shape[1] == 0:
        return np.zeros(shapes.shape[1])
    weighted = model.mass @ shapes
    norm = np.einsum("ij,ij->j", shapes, weighted)
    share = np.square(rigid.T @ weighted).sum(axis=0)
    return np.asarray(share / np.where(norm > 0.0, norm, 1.0))
