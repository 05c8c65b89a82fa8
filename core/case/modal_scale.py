"""The mass of a structure that was not weighed, by the modal scale of its test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.modal.correlation import modal_scale_factor
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import partners_of

_CALIBRATION = 0.05  # of force over motion, which all modes have in common
_SHAPE = 0.1  # least scatter of ln of the ratio from mode to mode: of what a model's shapes miss


def weigh_by_scale(model: Model, measurement: Measurement) -> Measurement:
    """Return a measurement with a total mass where modal masses say it and scales do not.

    Modal masses are those of a model with the same shapes times the ratio of both masses: its mean
    over the modes, with the deviation of the calibration and of the modes' scatter.

    Source: Ewins (2000), Modal Testing, on scaling by a point receptance.
    """
    kg = measurement.modal_mass
    if measurement.total_mass is not None or kg is None:
        return measurement
    try:
        modes, partner = partners_of(model, measurement)
    except ModelError:
        return measurement
    shaped = np.isfinite(measurement.shapes).any(axis=0)
    there = np.flatnonzero((partner >= 0) & shaped & np.isfinite(kg))
    if not len(there):
        return measurement
    readings = model.observe(measurement.sensors) @ modes.shapes[:, partner[there]]
    scale = modal_scale_factor(measurement.shapes[:, there], readings)
    ratios = np.log(kg[there] / np.square(scale))
    scatter = max(float(ratios.std()), _SHAPE) / np.sqrt(len(there))
    mass = model.total_mass * float(np.exp(ratios.mean()))
    return replace(measurement, total_mass=(mass, mass * float(np.hypot(_CALIBRATION, scatter))))
