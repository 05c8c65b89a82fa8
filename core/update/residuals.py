"""Measured minus predicted modal data of a model, with sensitivities in scaled parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from femubench.core.errors import NotApplicable
from femubench.core.fem.model import Model
from femubench.core.fem.model_parameters import find_updated_mass
from femubench.core.fem.slopes import MatrixSlopes
from femubench.core.modal.correlated_errors import undone
from femubench.core.modal.correlation import find_seen_modes, modal_scale_factor
from femubench.core.modal.eigen import Modes, enough_modes, solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import pair_measured
from femubench.core.modal.sensitivity import eigenvalue_sensitivities, shape_sensitivities
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

Residual = Literal["eigenvalue", "relative-eigenvalue", "frequency"]
# Two vectors with a cosine above this to the same third one cannot be orthogonal to each other.
_SAME_MODE = 0.75


@dataclass(frozen=True)
class Targets:
    """What is fitted, and how it is weighted.

    Arguments:
        residual: the modal quantity of a mode: absolute eigenvalues (2 pi f)^2, as Horton et al.
            use, eigenvalues relative to the measured ones, or frequencies in Hz.
        statistical: weight every datum by its inverse standard deviation; else by 1.
        shapes: take mode shapes at the sensors as data too (statistical weighting only).
        weigh: take the measured total mass as a datum, where there is one.
    """

    measurement: Measurement
    residual: Residual = "eigenvalue"
    statistical: bool = False
    shapes: bool = False
    weigh: bool = False
    scattered: ClassVar[bool] = False

    @cached_property
    def norm(self) -> float:
        """Return the norm of the weighted modal quantities."""
        return float(np.linalg.norm(self.weight * self.target))

    def predict(self, model: Model, previous: Prediction | None, mass: float) -> Prediction:
        """Return the prediction of a model of a mass, its pairs continued from a previous one."""
        return predict(self, model, previous, mass=mass)

    @cached_property
    def target(self) -> FloatArray:
        """Return the measured modal quantities z_m, (m,)."""
        return self.quantity(self.measurement.eigenvalues)

    def quantity(self, eigenvalues: FloatArray) -> FloatArray:
        """Return z of eigenvalues in rad^2/s^2, one a measured mode, (m,)."""
        if self.residual == "eigenvalue":
            return eigenvalues
        if self.residual == "relative-eigenvalue":
            return np.asarray(eigenvalues / self.measurement.eigenvalues)
        root = np.sqrt(np.abs(eigenvalues)) / (2.0 * np.pi)
        return np.asarray(np.copysign(root, eigenvalues))

    def slope(self, eigenvalues: FloatArray) -> FloatArray:
        """Return dz / d eigenvalue, (m,)."""
        if self.residual == "eigenvalue":
            return np.ones(len(eigenvalues))
        if self.residual == "relative-eigenvalue":
            return np.asarray(1.0 / self.measurement.eigenvalues)
        return np.asarray(1.0 / (4.0 * np.pi * np.sqrt(np.abs(eigenvalues))))

    @cached_property
    def weight(self) -> FloatArray:
        """Return the square roots of the weights of the modal quantities, (m,).

        Raises:
            NotApplicable: when a statistical weight has no standard deviation to rest on.
        """
        if not self.statistical:
            return np.ones(len(self.measurement))
        std = self.measurement.frequency_std
        if not (np.isfinite(std) & (std > 0.0)).all():
            raise NotApplicable("not every measured frequency has a standard deviation")
        measured = self.measurement.eigenvalues
        return np.asarray(1.0 / (self.slope(measured) * 4.0 * np.pi * np.sqrt(measured) * std))

    def independent(self, rows: FloatArray, there: BoolArray) -> FloatArray:
        """Return weighted frequencies, or their slopes, as independent data.

        Arguments:
            rows: along the first axis, (m, ...).
            there: which of the modes have a partner, (m,).
        """
        correlation = self.measurement.frequency_correlation
        if correlation is None or not self.statistical or not there.any():
            return rows
        result = rows.copy()
        result[there] = undone(correlation[there][:, there], rows[there])
        return result

    @cached_property
    def shape_weight(self) -> FloatArray:
        """Return 1/sigma of every shape component, 0 where there is none, (n_sensors, m)."""
        shapes, std = self.measurement.shapes, self.measurement.shape_std
        known = np.isfinite(shapes) & np.isfinite(std) & (std > 0.0) & find_seen_modes(shapes)
        return np.where(known, 1.0 / np.where(known, std, 1.0), 0.0)


@dataclass(frozen=True)
class Prediction:
    """A model's answer to the data: one eigenvalue solution, sensitivities on demand.

    Arguments:
        partner: which of them belongs to every measured mode; -1 where none does, (m,).
        observer: sensor readings from dofs, sparse (n_sensors, n).
        mass: in kg.
    """

    data: Targets
    model: Model
    modes: Modes
    partner: IntArray
    observer: SparseArray
    mass: float

    @cached_property
    def residual(self) -> FloatArray:
        """Return weighted measured minus predicted data, nan without a partner, (n_rows,)."""
        data, lost = self.data, self.partner < 0
        eigenvalues = self.modes.eigenvalues[self.partner]
        rows = data.weight * (data.target - data.quantity(eigenvalues))
        parts = [np.where(lost, np.nan, data.independent(rows, ~lost))]
        if data.shapes:
            misfit = data.shape_weight * (np.nan_to_num(data.measurement.shapes) - self._scaled)
            parts.append(np.where(lost, np.nan, misfit).T.ravel())
        if data.weigh and data.measurement.total_mass is not None:
            mass, std = data.measurement.total_mass
            parts.append(np.array([(mass - self.mass) / std]))
        return np.concatenate(parts)

    @cached_property
    def _at_sensors(self) -> FloatArray:
        return np.asarray((self.observer @ self.modes.shapes)[:, self.partner])

    @cached_property
    def _factor(self) -> FloatArray:
        shapes, weight = self.data.measurement.shapes, self.data.shape_weight
        return np.asarray(modal_scale_factor(shapes, self._at_sensors, np.square(weight)))

    @property
    def _scaled(self) -> FloatArray:
        return np.asarray(self._at_sensors * self._factor)

    def jacobian(self, slopes: MatrixSlopes, masses: Callable[[], FloatArray]) -> FloatArray:
        """Return d (weighted prediction) / d parameter, 0 without partner, (n_rows, p).

        Arguments:
            masses: gives d mass / d parameter in kg, (p,), where the mass is a datum.
        """
        data = self.data
        paired = self.modes.take(self.partner)
        slope = eigenvalue_sensitivities(self.model, paired, slopes)
        scale = data.weight * data.slope(paired.eigenvalues) * (self.partner >= 0)
        rows = np.where(scale[:, None] > 0.0, slope * scale[:, None], 0.0)
        parts = [data.independent(rows, self.partner >= 0)]
        if data.shapes:
            parts.append(self._shape_rows(slopes))
        if data.weigh and data.measurement.total_mass is not None:
            parts.append(masses()[None, :] / data.measurement.total_mass[1])
        return np.vstack(parts)

    def _shape_rows(self, slopes: MatrixSlopes) -> FloatArray:
        """Return the sensitivities of s phi with the modal scale factor's own, (n_s m, p)."""
        data = self.data
        observe = self.observer
        rows = np.zeros((len(self.partner), observe.shape[0], slopes.count))
        for j, index in enumerate(self.partner):
            weight, seen = data.shape_weight[:, j], self._at_sensors[:, j]
            if index < 0 or not weight.any():
                continue
            turn = observe @ shape_sensitivities(self.model, self.modes, index, slopes)
            square = np.square(weight)
            rest = np.nan_to_num(data.measurement.shapes[:, j]) - 2.0 * self._factor[j] * seen
            factor_slope = (square * rest) @ turn / (square @ np.square(seen))
            slope = self._factor[j] * turn + np.outer(seen, factor_slope)
            rows[j] = weight[:, None] * slope
        return rows.reshape(-1, slopes.count)


def predict(
    data: Targets, model: Model, previous: Prediction | None = None, *, mass: float | None = None
) -> Prediction:
    """Return the prediction of a model, its modes paired with the measured ones.

    Pairs are formed by shape and frequency; a measured mode that finds no partner that way keeps
    the mode that continues its previous partner.

    Arguments:
        previous: the prediction at the iteration before, on the same dofs.
        mass: of the model in kg; None for that of its members.

    Raises:
        ModelError: when the eigenvalue problem has no solution.
    """
    count = enough_modes(model, len(data.measurement))
    modes = solve_modes(model, count)
    if previous is None or (
        model.structure is not None and any(map(np.any, model.structure.interpolation))
    ):
        observer = model.observe(data.measurement.sensors)
    else:  # what lies between two nodes moves with them as before
        observer = previous.observer
    partner = pair_measured(data.measurement, modes, observer @ modes.shapes).index
    if previous is not None:
        partner = _followed(partner, model, modes, previous)
    mass = find_updated_mass(model) if mass is None else mass
    return Prediction(data, model, modes, partner, observer, mass)


def _followed(partner: IntArray, model: Model, modes: Modes, previous: Prediction) -> IntArray:
    """Return the partners with lost ones continued from the previous iteration."""
    result = partner.copy()
    for row in np.flatnonzero((partner < 0) & (previous.partner >= 0)):
        before = model.mass_times(previous.modes.shapes[:, previous.partner[row]][:, None])[:, 0]
        likeness = np.abs(before @ modes.shapes)
        likeness[modes.rigid] = 0.0
        likeness[result[result >= 0]] = 0.0
        best = int(likeness.argmax())
        if likeness[best] > _SAME_MODE:
            result[row] = best
    return result


def common_rows(first: FloatArray, second: FloatArray) -> BoolArray:
    """Tell which data two predictions with these residuals have a partner for, (n_rows,)."""
    return np.isfinite(first) & np.isfinite(second)
