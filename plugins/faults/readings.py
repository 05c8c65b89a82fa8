"""Readings of sensors, exchanged and multiplied."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femubench import Measurement


def read_sensors(measurement: Measurement) -> tuple[str, ...]:
    """Return the sensors that were read in one mode at least, if there are two of them."""
    read = np.asarray(np.isfinite(measurement.shapes).any(axis=1))
    labels = measurement.sensors.labels
    found = tuple(label for label, known in zip(labels, read, strict=True) if known)
    return found if len(found) > 1 else ()


def multiplied(measurement: Measurement, label: str, factor: float) -> Measurement:
    """Return a measurement with the readings of one sensor times a factor.

    What amplifies a reading amplifies its noise; what diminishes it need not diminish that.
    """
    own = np.array([other == label for other in measurement.sensors.labels])[:, None]
    noise = max(abs(factor), 1.0)
    return replace(
        measurement,
        shapes=measurement.shapes * np.where(own, factor, 1.0),
        shape_std=measurement.shape_std * np.where(own, noise, 1.0),
    )


def swapped(measurement: Measurement, labels: tuple[str, str]) -> Measurement:
    """Return a measurement with the readings of two sensors exchanged."""
    order = np.arange(len(measurement.sensors))
    i, j = (measurement.sensors.labels.index(label) for label in labels)
    order[[i, j]] = j, i
    return replace(
        measurement, shapes=measurement.shapes[order], shape_std=measurement.shape_std[order]
    )
