"""Sensors mounted the other way round, with a wrong sensitivity, or with exchanged cables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import ClassVar, Literal

import numpy as np

from femubench import Measurement, Model
from femubench.effect import Parameter, Suspect

_GAIN = Parameter("gain", "", 1.0, neutral=1.0, lower=0.2, upper=5.0)


class SensorGain:
    """One sensor reads too much or too little, by the same factor in all modes."""

    name: ClassVar[str] = "sensor-gain"
    side: ClassVar[Literal["data"]] = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return every sensor that was read."""
        return _suspect_each(measurement, "reads with a wrong gain", _correct_gain, _GAIN)


class SensorSign:
    """One sensor reads with the wrong sign in all modes."""

    name: ClassVar[str] = "sensor-sign"
    side: ClassVar[Literal["data"]] = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return every sensor that was read."""
        return _suspect_each(measurement, "reads with the wrong sign", _correct_sign)


class SensorsSwapped:
    """Two sensors have each other's readings in all modes."""

    name: ClassVar[str] = "sensors-swapped"
    side: ClassVar[Literal["data"]] = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return every pair of sensors that were read."""
        return [
            Suspect(
                f"sensor:{one}+{two}",
                f"sensors {one} and {two} are swapped",
                partial(self._corrected, (one, two)),
            )
            for one, two in combinations(_read_sensors(measurement), 2)
        ]

    def _corrected(
        self, labels: tuple[str, str], model: Model, measurement: Measurement, value: float
    ) -> tuple[Model, Measurement]:
        return model, swap_readings(measurement, labels)


def _suspect_each(
    measurement: Measurement,
    wrong: str,
    correct: Callable[[str, Model, Measurement, float], tuple[Model, Measurement]],
    parameter: Parameter | None = None,
) -> list[Suspect]:
    """Return the same suspicion of every sensor that was read."""
    return [
        Suspect(f"sensor:{label}", f"sensor {label} {wrong}", partial(correct, label), parameter)
        for label in _read_sensors(measurement)
    ]


def _correct_gain(
    label: str, model: Model, measurement: Measurement, value: float
) -> tuple[Model, Measurement]:
    return model, multiply_readings(measurement, label, 1.0 / value)


def _correct_sign(
    label: str, model: Model, measurement: Measurement, value: float
) -> tuple[Model, Measurement]:
    return model, multiply_readings(measurement, label, -1.0)


def _read_sensors(measurement: Measurement) -> tuple[str, ...]:
    """Return the sensors that were read in one mode at least, if there are two of them."""
    read = np.asarray(np.isfinite(measurement.shapes).any(axis=1))
    labels = measurement.sensors.labels
    found = tuple(label for label, known in zip(labels, read, strict=True) if known)
    return found if len(found) > 1 else ()


def multiply_readings(measurement: Measurement, label: str, factor: float) -> Measurement:
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


def swap_readings(measurement: Measurement, labels: tuple[str, str]) -> Measurement:
    """Return a measurement with the readings of two sensors exchanged."""
    order = np.arange(len(measurement.sensors))
    i, j = (measurement.sensors.labels.index(label) for label in labels)
    order[[i, j]] = j, i
    return replace(
        measurement, shapes=measurement.shapes[order], shape_std=measurement.shape_std[order]
    )
