"""What a measurement makes one ask before any fit: units, modes twice, frequencies swapped."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.optimize import linear_sum_assignment

from femubench.core.fem.model import Model
from femubench.core.modal.correlation import mac
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.core.modal.frf import DERIVATIVES
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import LEAST_SENSORS, WINDOW, pair_measured
from femubench.core.modal.receptances import PredictedResponses

# f_measured / f_predicted where a number was typed in another unit: frequencies go with the root of
# E / rho and with the depth of sections, and fall with the square of lengths.
_SLIPS = {
    1e9**0.5: "as if E had been typed in GPa, where Pa is expected",
    1e6: "as if coordinates were in mm, where m is expected",
    1e3: "as if E had been typed in MPa, where Pa is expected, or every length in mm, where m is",
    60.0: "as if they were in 1/min, where Hz is expected",
    2.0 * np.pi: "as if they were in rad/s, where Hz is expected",
    1e-3**0.5: "as if density had been typed in g/cm3, where kg/m3 is expected",
    1e-3: "as if they were in kHz, where Hz is expected, or sizes of sections in mm, where m is",
    1e-6: "as if density had been typed in t/mm3, where kg/m3 is expected",
}
_NEAR = 1.5  # models are hardly more than half wrong, and no two slips are as close
_SAME_MAC, _SAME_FREQUENCY = 0.999, 1e-3  # of one mode that two rows hold; relative
_ALIKE = 0.8  # MAC of a pair by shape alone
_FEWEST = 4  # modes, of whose order something can be said
# What responses are times as large as where motions over N in m, m/s or m/s2 are expected.
_UNITS = {1.0: "", 1e3: "mm, or over kN", 1e6: "micrometres", 1.0 / 9.80665: "g"}
_LOUD = np.log(4.0)  # half of the lines are off by more: no model that is of use is
_MOVES = 0.03  # of the largest response at a line
_BOTH = np.log(2.0)  # how much better the two together must be than one
_CLEARED = 0.5  # of it, at most what is left when kind or unit is another


def question_measurement(model: Model, measurement: Measurement) -> tuple[str, ...]:
    """Return what seems wrong with units, numbers and order of measured modes, one sentence each.

    Arguments:
        measurement: the modes and responses that a user may see.

    Raises:
        ModelError: when the model has no modes.
    """
    m = measurement
    found = [] if m.responses is None else _question_responses(model, m)
    for k, number in enumerate(m.numbers):
        close = np.abs(m.frequencies[:k] / m.frequencies[k] - 1.0) < _SAME_FREQUENCY
        same = close & (mac(m.shapes[:, :k], m.shapes[:, [k]])[:, 0] > _SAME_MAC)
        if len(m.sensors) >= LEAST_SENSORS and same.any():
            first = m.numbers[int(np.argmax(same))]
            found.append(f"modes {first} and {number} are one mode: leave one out of the table")
    modes = elastic_modes(model, 2 * len(m) + _FEWEST)
    readings = np.asarray(model.observe(m.sensors) @ modes.shapes)
    predicted = modes.natural_frequencies
    paired = pair_measured(m, modes, readings).index >= 0
    if 2 * paired.sum() >= len(m):
        return tuple(found)
    shaped = np.isfinite(m.shapes).sum(axis=0) >= LEAST_SENSORS
    rows = columns = np.arange(min(len(m), len(predicted)))
    if shaped.any():
        likeness = np.nan_to_num(mac(m.shapes, readings)) * shaped[:, None]
        rows, columns = linear_sum_assignment(likeness, maximize=True)
        alike = likeness[rows, columns] > _ALIKE
        rows, columns = rows[alike], columns[alike]
    if len(rows) == 0:
        return tuple(found)
    ratio = float(np.exp(np.median(np.log(m.frequencies[rows] / predicted[columns]))))
    apart = [np.subtract.outer(f, f) for f in (m.frequencies[rows], predicted[columns])]
    if not 1.0 / WINDOW < ratio < WINDOW:
        slips = [what for size, what in _SLIPS.items() if 1.0 / _NEAR < ratio / size < _NEAR]
        cause = slips[0] if slips else "a unit is wrong, or it is another structure"
        found.append(f"measured frequencies are {ratio:.3g} times those of the model, {cause}")
    elif len(rows) >= _FEWEST and np.sign(apart[0] * apart[1]).sum() < 0.0:  # Kendall's tau
        found.append("frequencies fall where those of the same shapes in the model rise, as if the "
                     "rows of frequencies and shapes had different orders")  # fmt: skip
    return tuple(found)


def _question_responses(model: Model, measurement: Measurement) -> list[str]:
    """Return what kind or unit responses seem to have, where it is not the stated one.

    Half of the lines say it: by how much they differ from the model's, and whether it goes with a
    power of the frequency. Resonances elsewhere move the other half at most.
    """
    given = measurement.responses
    assert given is not None
    given = given.at_lines(given.frequencies > 0.0)
    if given.quantity == "free decay" or not len(given.frequencies):
        return []
    predicted = PredictedResponses.of(model, replace(measurement, responses=given)).receptances
    size = np.abs(given.receptances)
    # Of every line what moves in both: what symmetry keeps still in one of them says nothing.
    there = np.ones(size.shape, dtype=bool)
    for level in (np.nan_to_num(size), np.abs(predicted)):
        there &= level > _MOVES * level.max(axis=(1, 2), keepdims=True)
    if not there.any():
        return []
    ratio = np.log(size[there] / np.abs(predicted[there]))
    omega = np.broadcast_to(2.0 * np.pi * given.frequencies[:, None, None], size.shape)[there]
    own, kinds = DERIVATIVES[given.quantity], ("receptance", "mobility", "accelerance")
    left = {
        (k, unit): float(np.median(np.abs(ratio - (k - own) * np.log(omega) - np.log(unit))))
        for k, unit in product(range(len(kinds)), _UNITS)
        if _UNITS[unit] != "g" or kinds[k] == "accelerance"
    }
    # In a narrow band a kind and a unit together are nearly another kind.
    kind, unit = min(left, key=lambda c: left[c] + _BOTH * (c[0] != own and c[1] != 1.0))
    if left[own, 1.0] < _LOUD or left[kind, unit] > _CLEARED * left[own, 1.0]:
        return []
    words, keys = [], []
    if kind != own:
        words, keys = [f"{kinds[kind]}, not {given.quantity},"], [f'quantity = "{kinds[kind]}"']
    if unit != 1.0:
        words, keys = [*words, f"in {_UNITS[unit]}"], [*keys, f"factor = {1.0 / unit:.6g}"]
    level = 20.0 / np.log(10.0) * left[own, 1.0]
    return [
        f"half of the used responses are {level:.0f} dB or more from those of the model, as if "
        f"they were {' '.join(words).rstrip(',')}: {', '.join(keys)} in responses of [measurement] "
        "takes them so"
    ]
