"""The data of a diagnosis as one vector of residuals, for many candidate models at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import linear_sum_assignment

from femubench.core.errors import NotApplicable
from femubench.core.modal.close_modes import clusters_of, turn_towards
from femubench.core.modal.correlated_errors import root_of, undone
from femubench.core.modal.correlation import UNSEEN, find_seen_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import WINDOW
from femubench.core.typing import FloatArray, IntArray

# Far from the truth a frequency is no sharper a label of a mode than this.
_LABEL = 0.03
_WINDOW = WINDOW**2  # a candidate may be as far from its best fit as that from the mode
_LAST = 1e9  # chi-square of a partner outside of the window


@dataclass(frozen=True)
class Data:
    """Used modes as residuals in standard deviations: frequencies, shapes, mass.

    Frequencies whose errors go together are turned so that the residuals are independent.

    Arguments:
        bias: relative corrections of predicted frequencies by elastic mode, for the mesh, (k,).
        still: number of modes of zero frequency of the model that they were found on, which come
            first there; what gives these a frequency moves no other mode on in the list. None
            where every candidate counts its own.
        shape_label: as far off as this part of its largest reading a shape tells a mode no better,
            where modes are paired.
    """

    measurement: Measurement
    bias: FloatArray
    still: int | None = None
    shape_label: float = 0.0

    def __post_init__(self) -> None:
        std = self.measurement.frequency_std
        if not (np.isfinite(std) & (std > 0.0)).all():
            raise NotApplicable("not every used frequency has a standard deviation")

    def __len__(self) -> int:
        return len(self.measurement) + len(self.shape_rows[0]) + (self.mass is not None)

    def is_as(self, other: Data) -> bool:
        """Tell whether other data are of the same measurement and compared in the same way."""
        own, others = ((d.still, d.shape_label) for d in (self, other))
        same = self.measurement is other.measurement and own == others
        return same and np.array_equal(self.bias, other.bias)

    @property
    def mass(self) -> tuple[float, float] | None:
        """Return the weighed mass and its standard deviation in kg."""
        return self.measurement.total_mass

    @cached_property
    def weight(self) -> FloatArray:
        """Return 1/sigma of every shape component, 0 where there is none, (n_sensors, m)."""
        shapes, std = self.measurement.shapes, self.measurement.shape_std
        known = np.isfinite(shapes) & np.isfinite(std) & (std > 0.0)
        known &= (known.sum(axis=0) > 1) & find_seen_modes(shapes)
        return np.where(known, 1.0 / np.where(known, std, 1.0), 0.0)

    @cached_property
    def shapes(self) -> FloatArray:
        """Return the measured shapes with 0 where there is none, (n_sensors, m)."""
        return np.where(self.weight > 0.0, self.measurement.shapes, 0.0)

    @cached_property
    def shape_rows(self) -> tuple[IntArray, IntArray]:
        """Return (mode, sensor) of every shape datum."""
        mode, sensor = np.nonzero(self.weight.T > 0.0)
        return mode, sensor

    @cached_property
    def std(self) -> FloatArray:
        """Return the standard deviation of every datum, (n_data,)."""
        mode, sensor = self.shape_rows
        mass = [] if self.mass is None else [self.mass[1]]
        return np.concatenate(
            [self.measurement.frequency_std, 1.0 / self.weight[sensor, mode], mass]
        )

    @property
    def scale_count(self) -> int:
        """Return the number of shape scales that the data themselves must fix."""
        return int((self.weight > 0.0).any(axis=0).sum())

    @cached_property
    def closeness(self) -> float:
        """Return the relative distance below which a test cannot tell two frequencies apart."""
        m = self.measurement
        return float(np.median(m.frequency_std / m.frequencies)) if self.scale_count else 0.0

    @cached_property
    def _complete(self) -> tuple[IntArray, FloatArray]:
        """Return the sensors at which all measured shapes are known, and the shapes there."""
        known = self.weight > 0.0
        columns = known.any(axis=0)
        rows = np.flatnonzero(known[:, columns].all(axis=1))
        return rows, self.shapes[np.ix_(rows, columns)]

    def turns(
        self, frequencies: FloatArray, readings: FloatArray, rigid: float
    ) -> list[tuple[IntArray, FloatArray]]:
        """Return the groups of close modes of a candidate and how to turn each to what was seen.

        Of modes that lie closer together than the test can tell, only the space that they span has
        a meaning: any shapes in it are as good.

        Arguments:
            frequencies: predicted, Hz, (q,).
            readings: at the sensors, (n_sensors, q).
            rigid: what counts as zero in Hz.
        """
        sensors, measured = self._complete
        moving = np.flatnonzero(frequencies > rigid)
        found = []
        for group in clusters_of(frequencies[moving], self.closeness):
            turn = turn_towards(readings[np.ix_(sensors, moving[group])], measured)
            if turn is not None:
                found.append((moving[group], turn))
        return found

    def align(self, frequencies: FloatArray, readings: FloatArray, rigid: float) -> FloatArray:
        """Return readings with close modes turned to the measured shapes, for every candidate.

        Arguments:
            frequencies: predicted, Hz, ascending, (g, q).
            readings: at the sensors, (g, n_sensors, q).
            rigid: what counts as zero in Hz.
        """
        low, high = frequencies[:, :-1], frequencies[:, 1:]
        close = (low > rigid) & (high - low <= self.closeness * low)
        rows = np.flatnonzero(close.any(axis=1) & (self.closeness > 0.0))
        if len(rows) == 0:
            return readings
        result = readings.copy()
        for g in rows:
            for group, turn in self.turns(frequencies[g], readings[g], rigid):
                result[g][:, group] = readings[g][:, group] @ turn
        return result

    def pair(self, frequencies: FloatArray, readings: FloatArray) -> IntArray:
        """Return the predicted partner of every measured mode for every candidate, (g, m).

        Which mode fits best, where `pair_measured` asks which is the same and may find none: the
        assignment with the least chi-square; frequencies count with a deviation of at least
        3 %, since a candidate may be far from its best fit. Modes more than a factor of four apart,
        the square of the window of `pair_modes`, are partners only where nothing else is left.

        Arguments:
            frequencies: predicted, Hz, (g, q).
            readings: predicted shapes at the sensors, (g, n_sensors, q).

        Raises:
            NotApplicable: when there are fewer predicted modes than measured ones.
        """
        measured = self.measurement.frequencies
        if frequencies.shape[1] < len(measured):
            what = f"the model has {frequencies.shape[1]} modes, the data have {len(measured)}"
            raise NotApplicable(f"{what}; expected a finer mesh, or fewer modes in the data")
        label = np.hypot(self.measurement.frequency_std / measured, _LABEL)
        gap = frequencies[:, None, :] / measured[:, None] - 1.0
        cost = np.square(gap / label[:, None])
        cost += np.where((gap > _WINDOW - 1.0) | (gap < 1.0 / _WINDOW - 1.0), _LAST, 0.0)
        blur = self.shape_label * np.abs(self.shapes).max(axis=0, initial=0.0)
        square = np.square(self.weight) / (1.0 + np.square(blur * self.weight))
        seen = np.einsum("sm,gsq->gmq", square * self.shapes, readings)
        norm = np.einsum("sm,gsq->gmq", square, np.square(readings))
        total = np.einsum("sm,sm->m", square, np.square(self.shapes))
        floor = 1e-12 * norm.max(axis=2, keepdims=True, initial=0.0) + 1e-300
        cost += total[:, None] - np.square(seen) / np.maximum(norm, floor)
        best = cost.argmin(axis=2)
        ordered = np.sort(best, axis=1)
        for g in np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1)):
            best[g] = linear_sum_assignment(cost[g])[1]
        return np.asarray(best)

    def scale(self, readings: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return paired shapes times their modal scale factor, and the factors.

        Arguments:
            readings: of the partners, (g, n_sensors, m).
        """
        seen = np.einsum("sm,gsm->gm", np.square(self.weight) * self.shapes, readings)
        factor = seen * self._inverse_norm(readings)
        return readings * factor[:, None, :], factor

    def _inverse_norm(self, readings: FloatArray) -> FloatArray:
        """Return 1 / p'Wp of shapes at the sensors, 0 where they are rounding alone, (g, m)."""
        square = np.square(self.weight)
        norm = np.einsum("sm,gsm->gm", square, np.square(readings))
        largest = np.square(readings).max(axis=(1, 2), initial=0.0)[:, None]
        seen = norm > np.square(UNSEEN) * largest * square.sum(axis=0)
        return np.asarray(np.where(seen, 1.0 / np.where(seen, norm, 1.0), 0.0))

    def residual(
        self, frequencies: FloatArray, readings: FloatArray, mass: FloatArray
    ) -> FloatArray:
        """Return measured minus predicted in standard deviations, (g, n_data).

        Arguments:
            frequencies: of the partners in Hz, (g, m).
            readings: of the partners, (g, n_sensors, m).
            mass: of the structure in kg, (g,).
        """
        m = self.measurement
        mode, sensor = self.shape_rows
        scaled, _ = self.scale(readings)
        misfit = self.weight * (self.shapes - scaled)
        apart = (m.frequencies - frequencies) / m.frequency_std
        if m.frequency_correlation is not None:
            apart = undone(m.frequency_correlation, apart.T).T
        parts = [apart, misfit[:, sensor, mode]]
        if self.mass is not None:
            parts.append((self.mass[0] - mass[:, None]) / self.mass[1])
        return np.concatenate(parts, axis=1)

    def slope(
        self, frequency: FloatArray, readings: FloatArray, turn: FloatArray, mass: FloatArray
    ) -> FloatArray:
        """Return the derivative of the prediction in standard deviations, (n_data, p).

        Arguments:
            frequency: d f / d x of the partners in Hz, (m, p).
            readings: of the partners, (n_sensors, m).
            turn: d readings / d x, (n_sensors, m, p).
            mass: d mass / d x in kg, (p,).
        """
        square = np.square(self.weight)
        mode, sensor = self.shape_rows
        scaled, factor = self.scale(readings[None])
        rest = self.shapes - 2.0 * scaled[0]
        slip = np.einsum("sm,smp->mp", square * rest, turn)
        slip = slip * self._inverse_norm(readings[None])[0][:, None]
        change = factor[0][None, :, None] * turn + readings[:, :, None] * slip[None]
        change = self.weight[:, :, None] * change
        apart = frequency / self.measurement.frequency_std[:, None]
        if self.measurement.frequency_correlation is not None:
            apart = undone(self.measurement.frequency_correlation, apart)
        parts = [apart, change[sensor, mode]]
        if self.mass is not None:
            parts.append(mass[None, :] / self.mass[1])
        return np.vstack(parts)

    def by_mode(self, rows: FloatArray) -> FloatArray:
        """Return residuals or slopes with those of frequencies as of each mode by itself.

        Arguments:
            rows: as `residual` of one candidate or `slope` gives them, (n_data, ...).
        """
        correlation = self.measurement.frequency_correlation
        if correlation is None:
            return rows
        m = len(self.measurement)
        return np.concatenate([np.tensordot(root_of(correlation), rows[:m], 1), rows[m:]])

    def predict(
        self, frequencies: FloatArray, readings: FloatArray, rigid: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return frequencies corrected for the mesh, and readings without rigid-body motions.

        Motions of zero frequency have no shapes of their own: any basis of them is as good, and
        rounding would choose one.

        Arguments:
            frequencies: ascending, (g, q).
            readings: at the sensors, (g, n_sensors, q).
            rigid: what counts as zero in Hz.
        """
        still = np.abs(frequencies) <= rigid
        hertz = np.where(still, 0.0, self.correct_for_mesh(frequencies, rigid))
        return hertz, np.where(still[:, None], 0.0, readings)

    def correct_for_mesh(self, frequencies: FloatArray, rigid: float) -> FloatArray:
        """Return frequencies with the correction for the mesh, counted from the first elastic one.

        The first elastic one is that of the model on which the corrections were found.

        Arguments:
            frequencies: predicted, ascending, (g, q).
            rigid: what counts as zero in Hz.
        """
        if self.still is None:
            order = np.cumsum(frequencies > rigid, axis=1) - 1
        else:
            order = np.broadcast_to(np.arange(frequencies.shape[1]), frequencies.shape) - self.still
        known = (order >= 0) & (order < len(self.bias))
        if len(self.bias) == 0:
            return frequencies
        factor = self.bias[np.clip(order, 0, len(self.bias) - 1)]
        return np.asarray(frequencies * (1.0 + np.where(known, factor, 0.0)))
