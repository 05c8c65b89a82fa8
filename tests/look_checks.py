"""What the tests of the plain look share."""

from __future__ import annotations

import numpy as np

from femubench.core.fem.frame import Frame
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.look import look as core_look
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.schema.diagnosis import LookWarning
from femubench.diagnosis import list_effects


def look(
    model: Model, measurement: Measurement, band: tuple[float, float] | None = None
) -> tuple[LookWarning, ...]:
    """Return what a diagnosis would show: the looks of all effects included."""
    return core_look.look(model, measurement, band, list_effects())


def midpoints(frame: Frame) -> Sensors:
    """Return z at all joints and at the middle of all members."""
    points = [joint.xyz for joint in frame.joints]
    for member in frame.members:
        a, b = (np.array(frame.joint(name).xyz) for name in member.ends)
        x, y, z = (0.5 * (a + b)).tolist()
        points.append((x, y, z))
    labels = tuple(f"s{k}" for k in range(len(points)))
    return Sensors(labels, np.array(points), ("z",) * len(points))


def measured(model: Model, count: int = 5, sensors: Sensors | None = None) -> Measurement:
    """Return elastic modes of a model as if measured, 0.2 % and 1.5 %."""
    sensors = midpoints(model.frame_structure.frame) if sensors is None else sensors
    modes = elastic_modes(model, count)
    shapes = np.asarray(model.observe(sensors) @ modes.shapes[:, :count])
    shapes = shapes / np.abs(shapes).max(axis=0, initial=1e-300)
    frequencies = modes.natural_frequencies[:count]
    std, damping = 0.002 * frequencies, np.full(count, np.nan)
    numbers = tuple(range(1, count + 1))
    noise = np.full(shapes.shape, 0.015)
    return Measurement(sensors, numbers, frequencies, std, damping, shapes, noise)


def texts(warnings: tuple[LookWarning, ...], word: str) -> list[LookWarning]:
    return [warning for warning in warnings if word in warning.what]
