"""How soft a structure is at most: strain over kinetic energy of smooth displacement fields."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femubench.core.fem.model import Dofs, Model
from femubench.core.modal.rigid import rigid_body_vectors
from femubench.core.typing import FloatArray

_DEPENDENT = 1e-8  # of the largest: below it a field is a combination of others
_FLOOR = 1e-14  # of the highest eigenvalue among the fields: below it there is only rounding


def softest_smooth_field(model: Model, rigid: FloatArray, weighted: FloatArray) -> float | None:
    """Return the lowest eigenvalue among motions as rigid and bent bodies, in rad^2/s^2.

    It is an upper bound of the lowest one that is left once the rigid motions are out.

    None where no field moves the structure, as without places of the dofs.

    Arguments:
        rigid, weighted: mass-orthonormal motions to leave out, and the mass times these, (n, r).

    Source: Rayleigh and Ritz.
    """
    if not np.isfinite(model.dofs.xyz).all():
        return None
    fields = np.hstack([rigid_body_vectors(model.dofs), _quadratic_fields(model.dofs)])
    before = np.einsum("ij,ij->j", fields, fields)
    fields -= rigid @ (weighted.T @ fields)
    fields = fields[:, np.einsum("ij,ij->j", fields, fields) > _DEPENDENT * before]
    mass = fields.T @ model.mass_times(fields)
    stiffness = fields.T @ model.stiffness_times(fields)
    size = np.diagonal(mass).copy()
    moving = size > 0.0
    if not moving.any():
        return None
    root = np.sqrt(size[moving])
    mass, stiffness = (
        part[np.ix_(moving, moving)] / np.outer(root, root) for part in (mass, stiffness)
    )
    values, turn = la.eigh(mass)
    kept = values > _DEPENDENT * values[-1]
    unit = turn[:, kept] / np.sqrt(values[kept])
    energies = la.eigvalsh(unit.T @ stiffness @ unit)
    positive = energies[energies > _FLOOR * energies[-1]]
    return float(positive[0]) if len(positive) else None


def _quadratic_fields(dofs: Dofs) -> FloatArray:
    """Return the dofs' part in bending and twist, without these in stretch, (n, p)."""
    motions = dofs.motions
    centred = (dofs.xyz - dofs.xyz.mean(axis=0)).T
    x = centred / max(float(np.abs(centred).max()), 1e-12)
    axes = range(3)
    soft = [(i, i, along) for i in axes for along in axes if i != along]
    soft += [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
    for fields in (soft, [(i, i, i) for i in axes]):
        columns = [part for field in fields for part in _field(x, motions, *field)]
        moving = [column for column in columns if np.abs(column).max() > 0.0]
        if moving:
            return np.array(moving).T
    return np.zeros((len(dofs), 0))


def _field(
    x: FloatArray, motions: FloatArray, first: int, second: int, along: int
) -> tuple[FloatArray, FloatArray]:
    """Return displacements x_first x_second along an axis, and the rotations of their slopes.

    Lines turn with their own slope: about the next axis by that along the one after, and back.
    """
    after, before = (along + 1) % 3, (along + 2) % 3
    slope = np.zeros_like(x)
    slope[first] += x[second]
    slope[second] += x[first]
    turn = motions[:, 3 + after] * slope[before] - motions[:, 3 + before] * slope[after]
    return motions[:, along] * (x[first] * x[second]), turn
