"""The promise of the matrix methods, measured: a model has given modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.errors import SelfCheckFailed
from femubench.core.fem.model import Model
from femubench.core.typing import FloatArray

ALLOWED = 1e-8
# A sum of k rounded products is off by less than k eps times the sum of their sizes; rows of
# assembled beams have up to about this many entries.
ROUNDED_TERMS = 32.0


def force_scale(model: Model) -> FloatArray:
    """Return factors that give forces and moments one unit, (n,)."""
    diagonal = np.abs(model.stiffness.diagonal())
    return np.asarray(1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)))


@dataclass(frozen=True)
class Residuals:
    """How far given shapes and eigenvalues are from modes of a model.

    Arguments:
        forces: K phi - lambda M phi relative to lambda M phi, the largest.
        frequencies: Rayleigh quotient relative to lambda, the largest.
        masses: phi_i' M phi_j - delta_ij, the largest.
        rounding: what rounding alone can make of ``forces``: large on very fine meshes.
    """

    forces: float
    frequencies: float
    masses: float
    rounding: float


def measure_residuals(model: Model, shapes: FloatArray, eigenvalues: FloatArray) -> Residuals:
    """Return the residuals of modes in a model.

    Arguments:
        model: any model.
        shapes: mass-orthonormal, (n, m).
        eigenvalues: in rad^2/s^2, (m,).
    """
    scale = force_scale(model)[:, None]
    momentum, force = model.mass_times(shapes), model.stiffness_times(shapes)
    size = np.linalg.norm(scale * momentum * eigenvalues, axis=0)
    gross = np.linalg.norm(scale * (np.abs(model.stiffness) @ np.abs(shapes)), axis=0)
    rayleigh = np.einsum("ij,ij->j", shapes, force) / np.einsum("ij,ij->j", shapes, momentum)
    return Residuals(
        float((np.linalg.norm(scale * (force - momentum * eigenvalues), axis=0) / size).max()),
        float(np.abs(rayleigh / eigenvalues - 1.0).max()),
        float(np.abs(shapes.T @ momentum - np.eye(len(eigenvalues))).max()),
        float(ROUNDED_TERMS * np.finfo(float).eps * (gross / size).max()),
    )


def check_used_modes(model: Model, shapes: FloatArray, eigenvalues: FloatArray) -> Residuals:
    """Return the residuals of the used modes if the model has these modes.

    They are allowed 1e-8, or the rounding error of K phi where a mesh is so fine that K phi
    cannot be evaluated as closely as that.

    Arguments:
        model: the updated model.
        shapes: expanded measured shapes, mass-orthonormal, (n, m).
        eigenvalues: measured, in rad^2/s^2, (m,).

    Raises:
        SelfCheckFailed: when they are not modes of the model.
    """
    found = measure_residuals(model, shapes, eigenvalues)
    allowed = max(ALLOWED, found.rounding)
    for promise, measured in (
        ("used modes reproduced, K phi = lambda M phi", found.forces),
        ("used frequencies reproduced", found.frequencies),
        ("used shapes mass-orthonormal", found.masses),
    ):
        if not measured <= allowed:
            raise SelfCheckFailed(promise, measured, allowed)
    return found
