"""What a test of a known model gives, without error."""

from __future__ import annotations

from typing import Any

import numpy as np

from femubench import Measurement, Model, Sensors, solve_modes
from femubench.core.fem.frame import Frame
from femubench.core.modal.eigen import enough_modes


def sensors_along(frame: Frame, parts: int = 2) -> Sensors:
    """Return z at all joints, and between so many parts of every member."""
    points = [joint.xyz for joint in frame.joints]
    for member in frame.members:
        a, b = (np.array(frame.joint(name).xyz) for name in member.ends)
        points += [tuple((1.0 - s) * a + s * b) for s in np.arange(1, parts) / parts]
    labels = tuple(f"s{k}" for k in range(len(points)))
    return Sensors(labels, np.array(points), ("z",) * len(points))


def modes_at(
    truth: Model,
    sensors: Sensors,
    count: int,
    *,
    hertz: Any = None,
    hertz_std: float = 1e-3,
    shape_std: float = 0.015,
) -> Measurement:
    """Return the lowest elastic modes of a model, each scaled to a largest reading of 1.

    Arguments:
        hertz: frequencies in place of its own, (count,).
        hertz_std: deviation as a share of every frequency.
        shape_std: of the readings.
    """
    modes = solve_modes(truth, enough_modes(truth, count)).elastic.take(np.arange(count))
    shapes = np.asarray(truth.observe(sensors) @ modes.shapes)
    shapes = shapes / np.abs(shapes).max(axis=0, initial=1e-300)
    found = modes.natural_frequencies if hertz is None else np.asarray(hertz)
    missing, std = np.full(count, np.nan), np.full(shapes.shape, shape_std)
    numbers = tuple(range(1, count + 1))
    return Measurement(sensors, numbers, found, hertz_std * found, missing, shapes, std)
