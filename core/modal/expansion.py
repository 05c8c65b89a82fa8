"""Expansion of measured shapes to all dofs of a model."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femubench.core.errors import NotApplicable
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import dense_matrices
from femubench.core.typing import BoolArray, FloatArray, SparseArray


def find_measured_rows(shapes: FloatArray) -> BoolArray:
    """Return which sensors have a reading in every mode, (n_sensors,).

    Raises:
        NotApplicable: when fewer sensors than modes are left.
    """
    complete = np.isfinite(shapes).all(axis=1)
    if complete.sum() < shapes.shape[1]:
        raise NotApplicable(
            f"expansion needs at least {shapes.shape[1]} sensors measured in every used mode, "
            f"there are {int(complete.sum())}"
        )
    return np.asarray(complete)


def same_length(measured: FloatArray, analytical: FloatArray) -> FloatArray:
    """Return measured shapes scaled and signed like their analytical partners, (n_sensors, m)."""
    scale = np.linalg.norm(analytical, axis=0) / np.linalg.norm(measured, axis=0)
    sign = np.sign(np.einsum("ij,ij->j", measured, analytical))
    return np.asarray(measured * scale * np.where(sign == 0.0, 1.0, sign))


def procrustes_rotation(measured: FloatArray, analytical: FloatArray) -> FloatArray:
    """Return the orthogonal R that turns measured into analytical shapes best, (m, m).

    Arguments:
        measured, analytical: shapes at the sensors, (n_sensors, m), scaled alike.

    Source: Ahmadian, Gladwell & Ismail (1997), equation (16). With measured' analytical = U S V'
    the minimiser is R = U V' (Golub & Van Loan); the paper prints its transpose.
    """
    return np.asarray(la.orthogonal_procrustes(measured, analytical)[0])


def expand_by_rotation(
    measured: FloatArray, at_sensors: FloatArray, full: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return shapes at all dofs as rotated analytical shapes, and the rotation.

    Arguments:
        measured: shapes at the sensors, (n_sensors, m), any scale.
        at_sensors: the paired analytical shapes at the sensors, (n_sensors, m).
        full: the same at all dofs, mass-normalised, (n, m).

    Source: Ahmadian, Gladwell & Ismail (1997), equations (16)-(17).

    Examples:
        >>> full = modes.shapes[:, [3, 4, 5]]
        >>> shapes, rotation = modal.expand_by_rotation(measurement.shapes, readings @ full, full)
        >>> np.allclose(rotation @ rotation.T, np.eye(3))
        True
    """
    rotation = procrustes_rotation(same_length(measured, at_sensors), at_sensors)
    return np.asarray(full @ rotation.T), rotation


def expand_by_serep(measured: FloatArray, at_sensors: FloatArray, full: FloatArray) -> FloatArray:
    """Return shapes at all dofs as least-squares combinations of analytical ones, (n, m).

    Source: O'Callahan, Avitabile & Riemer (1989), system equivalent reduction expansion process.

    Examples:
        >>> full = modes.shapes[:, :6]
        >>> np.allclose(modal.expand_by_serep(readings @ full, readings @ full, full), full)
        True
    """
    return np.asarray(full @ la.lstsq(at_sensors, measured)[0])


def expand_by_dynamics(
    model: Model, sensor_rows: SparseArray, measured: FloatArray, eigenvalues: FloatArray
) -> FloatArray:
    """Return shapes that meet the readings and leave the smallest force residual, (n, m).

    Arguments:
        model: a small model (it is solved densely).
        sensor_rows: readings from dofs, (n_sensors, n).
        measured: readings, (n_sensors, m).
        eigenvalues: measured, in rad^2/s^2, (m,).

    Source: Ahmadian, Gladwell & Ismail (1997), equation (15). Displacements and rotations are
    scaled by the square root of the stiffness diagonal, so that the residual has one unit.

    Examples:
        >>> shapes = modal.expand_by_dynamics(
        ...     model, readings, measurement.shapes, measurement.eigenvalues
        ... )
        >>> np.allclose(readings @ shapes, measurement.shapes)
        True
    """
    mass, stiffness = dense_matrices(model)
    rows = np.asarray(sensor_rows.toarray())
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diagonal(stiffness)), 1e-300))
    _, singular, right = la.svd(rows * scale)
    rank = int(np.sum(singular > 1e-10 * singular[0]))
    null = right[rank:].T
    shapes = np.zeros((model.size, len(eigenvalues)))
    for j, eigenvalue in enumerate(eigenvalues):
        dynamic = (stiffness - eigenvalue * mass) * np.outer(scale, scale)
        particular = la.lstsq(rows * scale, measured[:, j])[0]
        free = la.lstsq(dynamic @ null, -dynamic @ particular)[0]
        shapes[:, j] = scale * (particular + null @ free)
    return shapes
