"""Motions over time, in one record or several, and the forces that were measured with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from femubench.core.display import Shown, count_noun
from femubench.core.errors import InputError
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.frf import Quantity
from femubench.core.typing import FloatArray


@dataclass(frozen=True, repr=False)
class TimeSignals(Shown):
    """Measured motions at even steps of time, with the forces where they were measured.

    Arguments:
        sensors: where and along what was measured; coordinates nan where unknown.
        rate: samples a second, in Hz.
        values: in any unit that all sensors share, (n_samples, n_sensors), records one after the
            other; nan in the whole of a record in which a sensor was not used.
        forces: where and along what forces act.
        force_values: in one unit, (n_samples, n_forces), zero where a point is not driven.
        quantity: what the motion is over force.
        starts: first samples of the records.

    Examples:
        >>> signals = modal.TimeSignals(measurement.sensors, 512.0, np.zeros((5120, 13)))
        >>> print(signals.rows()[1][1])
        10 s at 512 Hz
    """

    sensors: Sensors
    rate: float
    values: FloatArray
    forces: Sensors = Sensors((), np.zeros((0, 3)), ())  # noqa: RUF009 - frozen
    force_values: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    quantity: Quantity = "accelerance"
    starts: tuple[int, ...] = (0,)

    def rows(self) -> list[tuple[str, str]]:
        """Return what was measured, and for how long."""
        count = len(self.values)
        what = f"{count_noun(count, 'sample')} at {count_noun(len(self.sensors), 'sensor')}"
        what += f", {count_noun(len(self.forces), 'force')}" if len(self.forces) else ""
        what += f", {len(self.starts)} records" if len(self.starts) > 1 else ""
        return [("", what), ("length", f"{count / self.rate:.6g} s at {self.rate:.6g} Hz")]

    @property
    def records(self) -> list[slice]:
        """Return the samples of every record."""
        return [slice(*ends) for ends in pairwise((*self.starts, len(self.values)))]

    @classmethod
    def joined(cls, parts: Sequence[TimeSignals]) -> TimeSignals:
        """Return the records of one state as one, on all their sensors and forces.

        Raises:
            InputError: for other rates or quantities.

        Examples:
            >>> signals = modal.TimeSignals(measurement.sensors, 512.0, np.zeros((5120, 13)))
            >>> len(modal.TimeSignals.joined([signals, signals]).records)
            2
        """
        kinds = {f"{part.quantity} at {part.rate:.6g} Hz" for part in parts}
        if len(kinds) > 1:
            what = f"records of {' and '.join(sorted(kinds))}"
            raise InputError(what, expected="one kind at one rate")
        ends = np.cumsum([0, *(len(part.values) for part in parts)]).tolist()
        sides: list[Any] = []
        for side, column, empty in (("sensors", "values", np.nan), ("forces", "force_values", 0.0)):
            every = [getattr(part, side) for part in parts]
            united = Sensors.united(every)
            values = np.full((ends[-1], len(united)), empty)
            for part, one, rows in zip(parts, every, pairwise(ends), strict=True):
                if len(one):
                    where = [united.labels.index(label) for label in one.labels]
                    values[slice(*rows), where] = getattr(part, column)
            sides += [united, values]
        starts = [
            end + start for end, part in zip(ends, parts, strict=False) for start in part.starts
        ]
        sensors, values, forces, acting = sides
        kind = parts[0].quantity
        return cls(sensors, parts[0].rate, values, forces, acting, kind, tuple(starts))
