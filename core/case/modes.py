"""Read measured modes: the table modes.csv, and what reader plugins hand over."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

from femubench.core.case.schema import SMALLEST
from femubench.core.case.tables import PLACES, RESERVED, Complex, CsvTable, read_table
from femubench.core.errors import InputError
from femubench.core.fem.mesh import ON_MEMBER
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.complex_modes import phase_loss, real_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import FloatArray

FREQUENCY_STD = 0.005  # of the frequency, where the table gives none
FIT_STD = "fit_std"  # column: deviations of a fit alone, in place of frequency_std
_SAME_AXIS = 0.999999  # cosine
LARGEST_SCALE = 10.0  # a larger ratio of readings is one of scales, not of what sensors see
_MOST_NUMBERS = 20_000_000  # modes times sensors
NO_SENSORS = Sensors((), np.zeros((0, 3)), ())


def read_modes(
    file: Path, sensors: Sensors, shape_std: float, without: Collection[str] = ()
) -> Measurement:
    """Return the modes of a CSV file.

    Arguments:
        file: mode,frequency,frequency_std or fit_std,damping and a column a sensor, optionally
            modal_mass and LABEL_std.
        sensors: whose labels the columns bear; a sensor without a column was not measured.
        shape_std: deviation of a shape, of the largest reading, where the table gives none.

    Raises:
        InputError: for an unknown column, a mode listed twice, a number that cannot be.
    """
    table = read_table(file)
    labels = sensors.labels
    known = {*RESERVED, FIT_STD}
    known.update(name for s in (*labels, *without) for name in (s, f"{s}_std"))
    stated = FIT_STD if FIT_STD in table.columns else "frequency_std"
    more = [column[:60] for column in table.columns if column not in known]
    if more and not labels:
        expected = f"{', '.join(RESERVED)}; for columns of shapes {PLACES}"
        raise InputError("unknown column", file=file, line=1, key=more[0], expected=expected)
    table.check_columns(("mode", "frequency"), known)
    if not table.rows:
        raise InputError("no modes", file=file, expected="a row for every mode")
    if len(table.rows) * len(labels) > _MOST_NUMBERS:
        what = f"{len(table.rows)} modes at {len(labels)} sensors are too many numbers"
        raise InputError(what, file=file, expected=f"at most {_MOST_NUMBERS}")
    numbers: dict[int, None] = {}
    columns: list[tuple[float, ...]] = []
    for row in table.rows:
        number = row.whole("mode")
        if number in numbers or number < 1:
            what = f"mode {number} is listed twice" if number else "mode 0"
            raise row.error("mode", what, "a whole number >= 1 of its own")
        numbers[number] = None
    for row in table.rows:
        frequency = row.number("frequency", "a number > 0 in Hz", lambda v: v >= SMALLEST)
        if frequency is None:
            raise row.error("frequency", "empty cell", "a number > 0 in Hz")
        std = row.number(stated, "a number >= 0 in Hz, or nothing", _not_negative)
        std = FREQUENCY_STD * frequency if std is None else std
        ratio = row.number("damping", "a ratio >= 0 and < 1, or nothing", lambda v: 0 <= v < 1)
        kg = row.number(RESERVED[4], "a number > 0 in kg, or nothing", lambda v: v >= SMALLEST)
        rest = (np.nan if cell is None else cell for cell in (ratio, kg))
        columns.append((frequency, std, *rest))
    frequencies, frequency_std, damping, modal_mass = np.array(columns).T
    shapes, shape_stds, lost = _shapes(table, labels)
    return Measurement(
        sensors=sensors,
        numbers=tuple(numbers),
        frequencies=frequencies,
        frequency_std=frequency_std,
        damping=damping,
        shapes=shapes,
        shape_std=with_default_std(shapes, shape_stds, shape_std),
        out_of_phase=lost,
        modal_mass=modal_mass if RESERVED[4] in table.columns else None,
    )


def _not_negative(value: float) -> bool:
    return value >= 0.0


def _shapes(
    table: CsvTable, labels: tuple[str, ...]
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Return real shapes, (n_sensors, m), deviations, nan where none is given, and what is lost."""
    size = (len(labels), len(table.rows))
    shapes, std = np.full(size, np.nan, dtype=complex), np.full(size, np.nan)
    complex_modes = np.zeros(len(table.rows), dtype=bool)
    for m, row in enumerate(table.rows):
        for s, label in enumerate(labels):
            value = row.value(label)
            if isinstance(value, Complex):
                shapes[s, m] = complex(*value)
                complex_modes[m] = True
            elif value is not None:
                shapes[s, m] = value
            if f"{label}_std" not in labels:
                deviation = row.number(f"{label}_std", "a number >= 0, or nothing", _not_negative)
                std[s, m] = np.nan if deviation is None else deviation
        measured = np.abs(shapes[np.isfinite(shapes[:, m]), m])
        if len(measured) and measured.max() < SMALLEST:
            raise row.error("mode", "the shape is zero at every sensor", "a shape, or empty cells")
    real = np.where(complex_modes, real_modes(shapes), shapes.real)
    return real, std, phase_loss(shapes) if complex_modes.any() else None


def with_default_std(shapes: FloatArray, std: FloatArray, share: float) -> FloatArray:
    """Return deviations with a share of the largest reading of all modes where there is none.

    Arguments:
        shapes, std: (n_sensors, m), nan where missing; a mode without any shape keeps nan.
        share: the deviation relative to `reach`.
    """
    return np.where(np.isnan(std), share * reach(shapes)[None, :], std)


def reach(shapes: FloatArray) -> FloatArray:
    """Return the reading of which the deviations of every mode are a share, (m,).

    That is the largest of all modes: a mode that the sensors hardly see is not measured the
    better for it. Modes may have scales of their own, so it is at most `LARGEST_SCALE` times that
    of the mode.

    Arguments:
        shapes: (n_sensors, m), nan where missing; a mode without any shape gets nan.
    """
    own = np.max(np.abs(np.nan_to_num(shapes)), axis=0, initial=0.0)
    own = np.where(own > 0.0, own, np.nan)
    every = np.max(np.nan_to_num(own), initial=0.0)
    return np.asarray(np.minimum(every, LARGEST_SCALE * own))


def with_scatter(measurement: Measurement, shares: tuple[float, float]) -> Measurement:
    """Return a measurement whose deviations hold what differs from one test to the next as well.

    Arguments:
        measurement: with the deviations of its fit.
        shares: of frequencies, and of shapes relative to `reach`.
    """
    found = measurement.widen(shares[0] * measurement.frequencies)
    std = np.hypot(found.shape_std, shares[1] * reach(found.shapes)[None, :])
    return replace(found, shape_std=std)


def match_modes(read: Measurement, file: Path, sensors: Sensors, share: float) -> Measurement:
    """Return the modes of a file that a plugin has read, on the sensors of the case.

    Raises:
        InputError: when the file holds no modes, or none of its sensors is one of the case.
    """
    if not len(read):
        raise InputError("no modes", file=file, expected="frequencies and mode shapes")
    rows = {label: i for i, label in enumerate(read.sensors.labels)}
    shapes, std = np.full((2, len(sensors), len(read)), np.nan)
    found = [(s, rows[label]) for s, label in enumerate(sensors.labels) if label in rows]
    if not found and len(sensors) and len(rows):
        expected = f"labels as in the file, e.g. {read.sensors.labels[0]!r}"
        raise InputError("no shape belongs to a sensor of the case", file=file, expected=expected)
    for s, row in found:
        shapes[s], std[s] = read.shapes[row], read.shape_std[row]
    usual = FREQUENCY_STD * read.frequencies
    return replace(
        read,
        sensors=sensors,
        frequency_std=np.where(np.isnan(read.frequency_std), usual, read.frequency_std),
        shapes=shapes,
        shape_std=with_default_std(shapes, std, share),
    )


def observe_at(measurement: Measurement, sensors: Sensors) -> Measurement:
    """Return a measurement as other sensors would have seen it.

    What was measured at the same point along the same axis is taken over, turned where the axis
    looks the other way; the shapes at other sensors are missing.
    """
    own = measurement.sensors
    if own is sensors or not len(own):
        return replace(measurement, sensors=sensors)
    shapes, std = np.full((2, len(sensors), len(measurement)), np.nan)
    for s, (xyz, axis) in enumerate(zip(sensors.xyz, sensors.axes, strict=True)):
        signs = own.axes @ axis
        near = np.linalg.norm(own.xyz - xyz, axis=1) < ON_MEMBER
        rows = np.flatnonzero(near & (np.abs(signs) > _SAME_AXIS))
        if len(rows):
            shapes[s] = signs[rows[0]] * measurement.shapes[rows[0]]
            std[s] = measurement.shape_std[rows[0]]
    return replace(measurement, sensors=sensors, shapes=shapes, shape_std=std)


def select_measured(sensors: Sensors, shapes: FloatArray) -> Sensors:
    """Return the sensors at which some mode has a shape."""
    return sensors.take(np.flatnonzero(np.isfinite(shapes).any(axis=1)))
