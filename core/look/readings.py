"""Whether the measurement makes sense for the model: deviations, sensors, missed modes."""

from __future__ import annotations

import numpy as np

from femubench.core.inference.settings import settings
from femubench.core.look.modes import Seen
from femubench.core.modal.pairing import LEAST_SENSORS, pair_modes
from femubench.core.modal.questions import question_measurement
from femubench.core.schema.diagnosis import LookWarning
from femubench.core.typing import FloatArray, IntArray


def look_at_deviations(seen: Seen) -> list[LookWarning]:
    """Return standard deviations of frequencies that no test has."""
    m = seen.measurement
    relative = m.frequency_std / m.frequencies
    low, high = settings.usual_std
    odd = ~((relative >= low) & (relative <= high))
    if not odd.any():
        return []
    modes = ", ".join(str(m.numbers[k]) for k in np.flatnonzero(odd))
    what = (
        f"The standard deviation of the frequency of mode {modes} is "
        f"{_range(100.0 * relative[odd])} %, where tests reach 0.001 % at best: every verdict "
        "rests on it."
    )
    return [LookWarning(what, "all", "")]


def _range(values: FloatArray) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.2g}" if low == high or np.isnan(low) else f"{low:.2g} to {high:.2g}"


def look_at_units(seen: Seen) -> list[LookWarning]:
    """Return what seems wrong with units, numbers and order of the modes."""
    asked = question_measurement(seen.model, seen.measurement)
    return [LookWarning(f"{what[0].upper()}{what[1:]}", "all", "") for what in asked]


def look_at_sensors(seen: Seen) -> list[LookWarning]:
    """Return sensors at one place and direction, and sensors with a gain of their own."""
    return _twins(seen) + _outliers(seen)


def _twins(seen: Seen) -> list[LookWarning]:
    sensors = seen.measurement.sensors
    if len(sensors) < 2:
        return []
    axes = sensors.axes
    near = np.abs(sensors.xyz[:, None] - sensors.xyz[None]).max(axis=2) <= settings.negligible
    along = np.abs(np.einsum("ik,jk->ij", axes, axes)) > 0.5
    first, second = np.nonzero(np.triu(near & along, 1))
    return [
        LookWarning(
            f"Sensors {sensors.labels[i]} and {sensors.labels[j]} measure the same motion.",
            sensors.labels[j],
            "",
        )
        for i, j in zip(first, second, strict=True)
    ]


def _outliers(seen: Seen) -> list[LookWarning]:
    """Return sensors whose readings are a multiple of what the others and the model make them.

    One sensor at a time is left out, and what it should read follows from the others through a
    combination of the paired modes of the model (SEREP). The worst one is set aside, then the
    rest is looked at again, since one wrong sensor spoils what is expected of its neighbours.
    """
    m = seen.measurement
    index = _partners(seen)
    columns = np.flatnonzero(index >= 0)
    if len(columns) < settings.least_modes:
        return []
    rows = np.flatnonzero(np.isfinite(m.shapes[:, columns]).all(axis=1))
    found = []
    for _ in range(max(len(rows) // 4, 1)):
        worst = _worst(seen, rows, columns, index[columns])
        if worst is None:
            break
        row, gain = worst
        suspect = "sign" if gain < 0.0 else "gain"
        what = (
            f"Sensor {m.sensors.labels[row]} reads {gain:.2g} times what the other sensors and "
            f"the model expect in every mode: its {suspect} may be wrong."
        )
        found.append(LookWarning(what, m.sensors.labels[row], ""))
        rows = rows[rows != row]
    return found


def _partners(seen: Seen) -> IntArray:
    """Return the partner of every measured mode, as one wrong sensor cannot spoil it, (m,).

    Where shapes pair badly each sensor in turn is left out, and the pairing that all modes
    together like best is taken.
    """
    best = seen.pairing
    likeness = np.nan_to_num(best.mac, nan=0.0)
    if len(likeness) == 0 or likeness.min() >= settings.alike_readings**2:
        return best.index
    m, predicted = seen.measurement, seen.modes.natural_frequencies
    for row in range(min(len(m.sensors), settings.block)):
        rest = np.arange(len(m.sensors)) != row
        pairing = pair_modes(m.frequencies, m.shapes[rest], predicted, seen.readings[rest])
        if np.nansum(pairing.mac) > np.nansum(best.mac):
            best = pairing
    return best.index


def _worst(
    seen: Seen, rows: IntArray, columns: IntArray, partners: IntArray
) -> tuple[int, float] | None:
    """Return the sensor that is most out of line and its gain, None where all are in line.

    A wrong gain is the same in all modes, and it stands alone. What the model lacks changes
    several sensors, and each mode differently.

    Arguments:
        seen: model and measurement.
        rows: sensors to look at.
        columns: measured modes that have a partner.
        partners: their partners.
    """
    if len(rows) < max(len(columns) + 2, LEAST_SENSORS):
        return None
    measured = seen.measurement.shapes[np.ix_(rows, columns)]
    expected = _left_out(seen.readings[np.ix_(rows, partners)], measured)
    noise = np.nan_to_num(seen.measurement.shape_std[np.ix_(rows, columns)], nan=0.0)
    noise = np.maximum(noise, settings.minor * np.abs(measured).max(axis=0))
    inner = np.einsum("sm,sm->s", measured, expected)
    norm = np.einsum("sm,sm->s", expected, expected)
    size = np.einsum("sm,sm->s", measured, measured)
    gain = inner / np.maximum(norm, 1e-300)
    alike = np.abs(inner) > settings.alike_readings * np.sqrt(norm * size)
    factor = settings.wrong_factor
    # So large that the smallest wrong gain would stand out of the noise.
    off = (1.0 - 1.0 / factor) * np.abs(expected)
    clear = (off > settings.visible_deviations * noise).sum(axis=1) >= settings.least_modes
    misfit = np.square((measured - expected) / noise).sum(axis=1)
    alone = misfit > settings.lone_misfit * np.median(misfit)
    odd = clear & alike & alone & ((gain < 1.0 / factor) | (gain > factor))
    if not odd.any():
        return None
    worst = int(np.where(odd, misfit, -1.0).argmax())
    return int(rows[worst]), float(gain[worst])


def _left_out(basis: FloatArray, measured: FloatArray) -> FloatArray:
    """Return what each sensor should read by the fit to all others, (n_sensors, m).

    With the hat matrix H it is (H y - h y) / (1 - h) (Cook & Weisberg 1982, section 2.2).
    """
    left, singular, _ = np.linalg.svd(basis, full_matrices=False)
    left = left[:, singular > 1e-8 * singular.max(initial=0.0)]
    own = np.square(left).sum(axis=1)[:, None]
    fitted = left @ (left.T @ measured)
    alone = own > 1.0 - settings.negligible  # nobody else sees what it sees
    return np.where(alone, measured, (fitted - own * measured) / np.where(alone, 1.0, 1.0 - own))


def look_at_band(seen: Seen, band: tuple[float, float]) -> list[LookWarning]:
    """Return whether the model has modes in a band where every mode was found, and was not.

    Arguments:
        band: in Hz; the measurement holds every mode of the structure inside.
    """
    # So near to the end of a band a mode may lie outside.
    border = settings.gross_error
    low, high = band[0] * (1.0 + border), band[1] * (1.0 - border)
    frequencies = seen.modes.natural_frequencies
    inside = np.flatnonzero((frequencies > low) & (frequencies < high))
    m = seen.measurement.frequencies
    measured = int(((m >= band[0]) & (m <= band[1])).sum())
    alone = [k for k in inside if k not in seen.pairing.index]
    if not alone:
        return []
    which = ", ".join(f"{k + 1} at {frequencies[k]:.4g} Hz" for k in alone)
    what = (
        f"The model has {len(inside)} modes well inside the band {band[0]:g} to {band[1]:g} Hz, "
        f"where {measured} were found; without a partner: mode {which}."
    )
    return [LookWarning(what, "all", "")]
