"""Motions over time of a structure that nobody measured the force on."""

from __future__ import annotations

from dataclasses import dataclass

from femubench.core.display import Shown, count_noun
from femubench.core.fem.sensors import Sensors
from femubench.core.typing import FloatArray


@dataclass(frozen=True, repr=False)
class TimeSignals(Shown):
    """Measured motions at even steps of time.

    Arguments:
        sensors: where and along what was measured; coordinates nan where unknown.
        rate: samples a second, in Hz.
        values: in any unit that all sensors share, (n_samples, n_sensors).

    Examples:
        >>> signals = modal.TimeSignals(measurement.sensors, 512.0, np.zeros((5120, 13)))
        >>> print(signals.rows()[1][1])
        10 s at 512 Hz
    """

    sensors: Sensors
    rate: float
    values: FloatArray

    def rows(self) -> list[tuple[str, str]]:
        """Return what was measured, and for how long."""
        count = len(self.values)
        return [
            ("", f"{count_noun(count, 'sample')} at {count_noun(len(self.sensors), 'sensor')}"),
            ("length", f"{count / self.rate:.6g} s at {self.rate:.6g} Hz"),
        ]
