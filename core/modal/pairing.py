"""Which mode of a model belongs to which measured mode: by shape and frequency, never by index."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from femubench.core.fem.model import Model
from femubench.core.modal.correlation import find_seen_modes, mac
from femubench.core.modal.eigen import Modes, enough_modes, solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import FloatArray, IntArray

# Two shapes with a MAC below one half have more in what differs than in what they share; any
# third shape can then be as near to either.
LEAST_MAC = 0.5
# Shapes at one sensor always have a MAC of 1, at two sensors half of all random pairs exceed 0.5:
# below three common sensors a shape says nothing, and the frequency alone decides.
LEAST_SENSORS = 3
# A nominal model that is more than a factor of two off has no claim to describe the mode.
WINDOW = 2.0
# Frequency alone is weaker evidence: a wider window would pair a mode that the model lacks
# with the next one up, and that one with its next, in a chain.
WINDOW_WITHOUT_SHAPE = 1.4
# One MAC point is worth four points of ln(f_p / f_m): shapes decide, and frequencies decide
# between shapes that the sensors can hardly tell apart.
FREQUENCY_WEIGHT = 0.25
# Any gain by shape outweighs all gains by frequency alone.
_WITHOUT_SHAPE = 1e-4
_IN_ORDER = 1e-3
_TINY = 1e-9  # an admissible pair, however poor, is better than none


@dataclass(frozen=True)
class Pairing:
    """The partners of measured modes.

    Arguments:
        index: column of the predicted mode, -1 where there is none, (m,).
        mac: of the pair; nan where there is none or the shapes could not be compared, (m,).
    """

    index: IntArray
    mac: FloatArray

    def __len__(self) -> int:
        return len(self.index)


def pair_modes(
    measured_frequencies: FloatArray,
    measured_shapes: FloatArray,
    predicted_frequencies: FloatArray,
    predicted_shapes: FloatArray,
    *,
    least_mac: float = LEAST_MAC,
    window: float = WINDOW,
    window_without_shape: float = WINDOW_WITHOUT_SHAPE,
) -> Pairing:
    """Return the partner of every measured mode, by one linear assignment.

    A mode with a shape at three sensors or more pairs by (1 - MAC) + 0.25 |ln(f_p / f_m)|, where
    MAC >= 0.5 and the frequencies lie within a factor of two. A mode with fewer sensors, or with
    a frequency alone, pairs by |ln(f_p / f_m)| within a factor of 1.4, and only among what modes
    with shapes leave. An imaginary frequency (negative here) pairs by shape alone, as if at the
    edge of the window. A mode that the sensors do not see has no shape.

    Arguments:
        measured_frequencies: Hz, (m,).
        measured_shapes: (n_sensors, m), real or complex; nan where missing.
        predicted_frequencies: Hz, negative for imaginary ones, (p,).
        predicted_shapes: at the same sensors, (n_sensors, p).
        least_mac: smallest MAC of a pair.
        window, window_without_shape: largest ratio of the two frequencies; where shapes cannot be
            compared.

    Examples:
        >>> pairs = modal.pair_modes(
        ...     measurement.frequencies,
        ...     measurement.shapes,
        ...     modes.natural_frequencies[:8],
        ...     readings @ modes.shapes[:, :8],
        ... )
        >>> print(pairs.index)
        [3 4 5]
    """
    measured = np.asarray(measured_frequencies, dtype=float)
    predicted = np.asarray(predicted_frequencies, dtype=float)
    m, p = len(measured), len(predicted)
    if m == 0 or p == 0:
        return Pairing(np.full(m, -1), np.full(m, np.nan))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(np.log(predicted)[None, :] - np.log(measured)[:, None])
    distance = np.where(np.isfinite(ratio), ratio, np.inf)
    shaped = find_seen_modes(measured_shapes)[:, None]
    likeness = np.where(
        find_seen_modes(predicted_shapes), mac(measured_shapes, predicted_shapes), 0.0
    )
    common = np.isfinite(measured_shapes).T.astype(int) @ np.isfinite(predicted_shapes).astype(int)
    by_shape = shaped & np.asarray(common >= LEAST_SENSORS)
    edge = float(np.log(window))
    apart = np.where((predicted < 0.0)[None, :], edge, distance)
    admissible = (likeness >= least_mac) & (apart <= edge)
    cost = 1.0 - likeness + FREQUENCY_WEIGHT * np.where(admissible, apart, 0.0)
    worst = 1.0 - least_mac + FREQUENCY_WEIGHT * edge
    far = float(np.log(window_without_shape))
    within = distance <= far
    near = far - np.where(within, distance, far)
    # Of two modes above two others, either may go with either at the same sum of distances: a
    # trace of their squares keeps the order.
    by_distance = _WITHOUT_SHAPE * near * (1.0 + _IN_ORDER * (2.0 * far - near))
    gain = np.where(
        by_shape,
        np.where(admissible, worst - cost + _TINY, -1.0),
        np.where(within, by_distance + _TINY, -1.0),
    )
    # One column of gain 0 a measured mode: to stay alone is always possible.
    rows, columns = linear_sum_assignment(np.hstack([gain, np.zeros((m, m))]), maximize=True)
    index = np.full(m, -1, dtype=np.int64)
    taken = columns < p
    index[rows[taken]] = columns[taken]
    rows = np.arange(len(index))
    score = likeness[rows, index]
    known = (index >= 0) & by_shape[rows, index]
    return Pairing(index, np.where(known, score, np.nan))


def pair_measured(measurement: Measurement, modes: Modes, readings: FloatArray) -> Pairing:
    """Return the partner of every measured mode among the modes of a model, rigid ones left out.

    Arguments:
        measurement: the modes to pair, in one assignment.
        modes: of the model, p of them; the indices of the pairing count all of them.
        readings: the same at the sensors, (n_sensors, p).

    Examples:
        >>> readings = model.observe(measurement.sensors) @ modes.shapes
        >>> (modal.pair_measured(measurement, modes, readings).index >= 0).all().item()
        True
    """
    elastic = np.flatnonzero(~modes.rigid)
    found = pair_modes(
        measurement.frequencies,
        measurement.shapes,
        modes.natural_frequencies[elastic],
        np.asarray(readings)[:, elastic],
    )
    return replace(found, index=np.append(elastic, -1)[found.index])


def partners_of(model: Model, measurement: Measurement) -> tuple[Modes, IntArray]:
    """Return enough modes of a model and every measured mode's partner among them, -1 for none."""
    modes = solve_modes(model, enough_modes(model, len(measurement)))
    readings = model.observe(measurement.sensors) @ modes.shapes
    return modes, pair_measured(measurement, modes, readings).index
