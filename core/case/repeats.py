"""Frequencies of a test that was repeated, and the covariance of their errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from femubench.core.case.schema import LARGEST, SMALLEST
from femubench.core.case.tables import CsvTable, read_table
from femubench.core.errors import InputError
from femubench.core.modal.correlated_errors import shrunk_correlation
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import FloatArray

_FEWEST = 3
_SAME_STD = 1e-9  # relative
_ROUNDING = 1e-12  # of an eigenvalue of a correlation matrix
_STATED = 0.05  # share of the correlations that is shrunk away without a word


def with_repeats(measurement: Measurement, file: Path) -> tuple[Measurement, tuple[str, ...]]:
    """Return a measurement with the means of repeats, and what to say of them.

    The covariance is that of the means: the scatter of one repeat over the number of repeats.

    Arguments:
        measurement: whose modes the table bears as columns.
        file: a column a mode, called by its number, with its frequency in Hz; a row a repeat.

    Raises:
        InputError: for an unknown mode, a frequency that cannot be, or too few repeats.
    """
    table = read_table(file)
    columns = _columns(table, measurement, ("repeat",))
    expected = "a number > 0 in Hz, or nothing"
    rows = [
        [row.number(name, expected, lambda v: SMALLEST <= v <= LARGEST) for name in columns]
        for row in table.rows
    ]
    cells = np.array(rows, dtype=float).reshape(len(rows), len(columns))
    whole = cells[np.isfinite(cells).all(axis=1)]
    count = len(whole)
    if count < _FEWEST:
        what = f"{count} repeats with all {len(columns)} modes"
        raise InputError(what, file=file, expected=f"{_FEWEST} at least")
    correlation, share = shrunk_correlation(whole)
    std = whole.std(axis=0, ddof=1) / np.sqrt(count)
    found = _with(measurement, list(columns.values()), whole.mean(axis=0), std, correlation)
    stated = f"{file.name}: means of {count} repeats of {len(columns)} modes"
    if count < len(rows):
        stated += f" ({len(rows) - count} more lack a mode)"
    if share > _STATED and len(columns) > 1:
        stated += (
            f"; so few tell their correlations only roughly, which were shrunk by "
            f"{100.0 * share:.0f} %"
        )
    return found, (f"{stated}.",)


def with_covariance(measurement: Measurement, file: Path) -> Measurement:
    """Return a measurement whose frequencies have a covariance.

    Arguments:
        measurement: whose modes the table bears as columns and as rows.
        file: ``mode`` and a column a mode, called by its number; in Hz^2.

    Raises:
        InputError: for an unknown mode, or what is no covariance.
    """
    table = read_table(file)
    table.check_columns(("mode",), table.columns)
    columns = _columns(table, measurement, ("mode",))
    rows = {row.cells["mode"]: row for row in table.rows}
    if list(rows) != list(columns) or len(rows) != len(table.rows):
        expected = f"one row a column, in this order: {', '.join(columns)}"
        raise InputError(f"rows {', '.join(rows)}"[:200], file=file, key="mode", expected=expected)
    cells = [[row.number(name) for name in columns] for row in table.rows]
    covariance = np.array(cells, dtype=float)
    std = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    bad = ~np.isfinite(covariance).all() or not (std >= SMALLEST).all()
    size = std[:, None] * std
    if bad or not np.allclose(covariance / size, (covariance / size).T, rtol=0.0, atol=1e-6):
        what = "not a symmetric matrix with a positive diagonal"
        raise InputError(what, file=file, expected="a covariance in Hz^2")
    correlation = 0.5 * (covariance + covariance.T) / size
    if np.linalg.eigvalsh(correlation)[0] <= _ROUNDING:
        raise InputError("not positive definite", file=file, expected="a covariance in Hz^2")
    places = list(columns.values())
    own = measurement.frequency_std[places]
    std = np.where(np.abs(std - own) <= _SAME_STD * own, own, std)
    return _with(measurement, places, measurement.frequencies[places], std, correlation)


def _columns(table: CsvTable, measurement: Measurement, other: tuple[str, ...]) -> dict[str, int]:
    """Return from the columns that are modes to their places in the measurement."""
    known = {str(number): i for i, number in enumerate(measurement.numbers)}
    table.check_columns((), (*known, *other))
    found = {name: known[name] for name in table.columns if name in known}
    if not found:
        expected = f"columns {', '.join(known)}"[:200]
        raise InputError("no mode", file=table.file, line=1, expected=expected)
    return found


def _with(
    measurement: Measurement,
    places: list[int],
    frequencies: FloatArray,
    std: FloatArray,
    correlation: FloatArray,
) -> Measurement:
    """Return a measurement with other frequencies and errors of some modes."""
    hertz, deviation = measurement.frequencies.copy(), measurement.frequency_std.copy()
    whole = np.eye(len(measurement))
    hertz[places], deviation[places] = frequencies, std
    whole[np.ix_(places, places)] = correlation
    np.fill_diagonal(whole, 1.0)
    return replace(
        measurement,
        frequencies=hertz,
        frequency_std=deviation,
        frequency_correlation=whole if np.abs(whole - np.eye(len(whole))).any() else None,
    )
