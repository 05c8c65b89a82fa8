"""Measured modes at all dofs of a model, with the displacement gap that tells where it is wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.inference.settings import settings
from femubench.core.look.modes import Seen
from femubench.core.modal.pairing import LEAST_SENSORS
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import FloatArray


@dataclass(frozen=True)
class Expansion:
    """Measured modes at all dofs.

    Arguments:
        shapes: u with u' M u = 1, (n, m).
        gaps: u - v, where v is the static response of the model to the inertia of u, (n, m).
        eigenvalues: measured, in rad^2/s^2, (m,).
    """

    shapes: FloatArray
    gaps: FloatArray
    eigenvalues: FloatArray


def expand(seen: Seen) -> Expansion:
    """Return the measured modes that have a shape, expanded by the error in constitutive relation.

    Of all shapes u that meet the readings within their noise, the one whose error has the least
    strain energy, |u - v|^2 in the metric of K with K v = lambda M u. With A = K - lambda M and
    readings y = S u the gap is u - v = A^-1 S' c, u = A^-1 K (u - v); the forces c are fitted
    with the weight at which the misfit is that of noise (Morozov's discrepancy principle).

    Source: Ladeveze & Chouaki (1999), Application of a posteriori error estimation for structural
    model updating, Inverse Problems 15; the solution by readings is the dual of theirs by dofs.
    """
    m = seen.measurement
    rows = seen.model.observe(m.sensors)
    columns = []
    for j, eigenvalue in enumerate(seen.eigenvalues):
        known = np.isfinite(m.shapes[:, j])
        if known.sum() < LEAST_SENSORS:
            continue
        reading = m.shapes[known, j]
        size = float(np.abs(reading).max())
        std = m.shape_std[known, j]
        std = np.where(np.isfinite(std) & (std > 0.0), std, settings.reachable_shape_std * size)
        sensors = np.asarray(rows[np.flatnonzero(known)].toarray()) / std[:, None]
        if size > 0.0:
            columns.append(_expanded(seen, sensors, reading / std, float(eigenvalue)))
    if not columns:
        none = np.zeros((seen.model.size, 0))
        return Expansion(none, none, np.zeros(0))
    shapes, gaps, values = zip(*columns, strict=True)
    return Expansion(np.column_stack(shapes), np.column_stack(gaps), np.array(values))


def _expanded(
    seen: Seen, sensors: FloatArray, reading: FloatArray, eigenvalue: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return shape and gap of one mode, and the eigenvalue.

    Arguments:
        seen: model and modes.
        sensors: readings from dofs in standard deviations, (n_sensors, n).
        reading: in standard deviations, (n_sensors,).
        eigenvalue: measured, in rad^2/s^2.
    """
    model = seen.model
    # As near as that to one of the model, K - lambda M is as good as singular.
    step = settings.negligible
    near = np.abs(seen.modes.eigenvalues / eigenvalue - 1.0).min(initial=1.0) < 0.5 * step
    solve = _Solver(model, eigenvalue * (1.0 + step) if near else eigenvalue)
    patterns = solve(sensors.T)
    energy = patterns.T @ model.stiffness_times(patterns)
    values, turn = la.eigh(0.5 * (energy + energy.T))
    values, parts = np.maximum(values, 0.0), turn.T @ reading
    weight = _discrepancy(values, parts)
    gap = patterns @ (turn @ (weight * parts / (1.0 + weight * values)))
    shape = solve(model.stiffness_times(gap[:, None]))[:, 0]
    scale = 1.0 / np.sqrt(float(shape @ model.mass_times(shape[:, None])[:, 0]))
    return scale * shape, scale * gap, eigenvalue


class _Solver:
    """Solve (K - lambda M) x = b, refined once, since the factors are not pivoted."""

    def __init__(self, model: Model, eigenvalue: float) -> None:
        self.model, self.eigenvalue = model, eigenvalue
        self.shifted = ShiftedModel(model, eigenvalue)

    def __call__(self, right: FloatArray) -> FloatArray:
        near = self.shifted.solve(right)
        left = (
            right - self.model.stiffness_times(near) + self.eigenvalue * self.model.mass_times(near)
        )
        return near + self.shifted.solve(left)


def _discrepancy(values: FloatArray, parts: FloatArray) -> float:
    """Return the weight of the readings at which the misfit is that of noise.

    Arguments:
        values: eigenvalues of the sensitivity of the readings to the forces, (n_sensors,).
        parts: readings along its eigenvectors in standard deviations, (n_sensors,).
    """
    largest = float(values.max(initial=0.0))
    if largest == 0.0:
        raise ModelError("no sensor sees any motion that the model can make")
    low, high = (np.log(w / largest) for w in (settings.negligible, settings.far))
    expected = max(len(parts) - 1.0, 1.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        misfit = np.square(parts / (1.0 + np.exp(middle) * values)).sum()
        low, high = (middle, high) if misfit > expected else (low, middle)
    return float(np.exp(high))
