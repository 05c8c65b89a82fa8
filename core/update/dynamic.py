"""Measured shapes expanded mode by mode with the dynamic stiffness, for models of any size."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femubench.core.errors import NotApplicable
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import DENSE_LIMIT
from femubench.core.modal.expansion import expand_by_dynamics
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import FloatArray, SparseArray
from femubench.core.update.promise import force_scale

_DEPENDENT = 1e-10


def expand_measured_shapes(
    model: Model, measurement: Measurement, rigid: FloatArray | None = None
) -> FloatArray:
    """Return shapes that meet every reading and leave the smallest force residual, (n, m).

    A sensor without a reading in one mode still counts in the others.

    Arguments:
        model: any model; small ones are solved densely.
        measurement: modes with shapes.
        rigid: rigid-body modes to which the shapes shall be orthogonal with the mass, (n, r).

    Raises:
        NotApplicable: when a mode has no reading at all.
        ModelError: when K - lambda M of a large model is singular.

    Source: Ahmadian, Gladwell & Ismail (1997), equation (15).

    Examples:
        >>> shapes = update.expand_measured_shapes(model, measurement)
        >>> np.allclose(readings @ shapes, measurement.shapes)
        True
    """
    rows = model.observe(measurement.sensors)
    # Rows of unit length that read the momentum of a shape.
    momentum = model.mass_times(np.zeros((model.size, 0)) if rigid is None else rigid)
    at_rest = sp.csr_array((momentum / np.linalg.norm(momentum, axis=0)).T)
    shapes = np.zeros((model.size, len(measurement)))
    for j, eigenvalue in enumerate(measurement.eigenvalues):
        known = np.isfinite(measurement.shapes[:, j])
        readings = measurement.shapes[known, j]
        if not np.any(readings):
            raise NotApplicable(f"measured mode {measurement.numbers[j]} has no shape")
        readings = np.append(readings / np.abs(readings).max(), np.zeros(at_rest.shape[0]))
        met = sp.csr_array(sp.vstack([rows[known], at_rest]))
        if model.size <= DENSE_LIMIT:
            one = expand_by_dynamics(model, met, readings[:, None], np.array([eigenvalue]))
            shapes[:, j] = one[:, 0]
        else:
            shapes[:, j] = expand_one_by_dynamics(model, met, readings, float(eigenvalue))
    return shapes


def expand_one_by_dynamics(
    model: Model, sensor_rows: SparseArray, readings: FloatArray, eigenvalue: float
) -> FloatArray:
    """Return one shape by equation (15) with one sparse factorisation, (n,).

    With r = S (K - lambda M) phi the shape is linear in r, and the shortest r that meets the
    readings lies in the span of as many vectors as there are sensors. S scales forces and
    moments to one unit.

    Arguments:
        sensor_rows: readings from dofs, (n_sensors, n).
        readings: (n_sensors,).
        eigenvalue: measured, in rad^2/s^2; not one of the model's own.

    Raises:
        ModelError: when K - lambda M is singular.
    """
    scale = force_scale(model)
    shifted = ShiftedModel(model, eigenvalue)
    influence = shifted.solve(sensor_rows.T.toarray()) / scale[:, None]
    left, singular, right = la.svd(influence, full_matrices=False)
    keep = singular > _DEPENDENT * singular[0]
    force = left[:, keep] @ ((right[keep] @ readings) / singular[keep])
    return np.asarray(shifted.solve(force / scale))
