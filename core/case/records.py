"""Records of one state of a structure that were identified, as the tables of a case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from femubench.core.case.modes import FIT_STD, read_modes
from femubench.core.case.table_text import SHAPE_STD, covariance_csv, modes_csv, sensors_csv
from femubench.core.case.tables import RESERVED, read_table
from femubench.core.errors import InputError
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.correlated_errors import shrunk_correlation
from femubench.core.modal.correlation import modal_scale_factor
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import pair_modes

TABLES = ("modes.csv", "sensors.csv", "covariance.csv", "references.csv")
MODES, SENSORS, COVARIANCE, REFERENCES = TABLES
_LEAST_MAC, _WINDOW = 0.8, 1.1  # of one mode in two records of one state
_FEWEST = 3  # records that say something of correlations


def record_tables(
    measurement: Measurement, references: Sensors | None = None, *, fitted: bool = True
) -> dict[str, bytes]:
    """Return the tables of a case that hold what was identified, by name.

    Arguments:
        references: what every response was measured to, the forces or with a roving hammer the
            accelerometers; None where there is none.
        fitted: whether the deviations are those of a fit alone.
    """
    table = modes_csv(measurement, np.nan, FIT_STD if fitted else RESERVED[2])
    tables = {MODES: table, SENSORS: sensors_csv(measurement.sensors)}
    if measurement.frequency_correlation is not None:
        tables[COVARIANCE] = covariance_csv(measurement)
    if references is not None:
        tables[REFERENCES] = sensors_csv(references)
    return tables


def folder_tables(folder: Path) -> dict[str, bytes]:
    """Return the tables of a folder that `bench identify` has written.

    Raises:
        InputError: when there are no modes in it.
    """
    if not (folder / MODES).is_file():
        expected = f"a folder that `bench identify FILE --output {folder}` writes, or a file"
        raise InputError(f"no {MODES} in this folder", file=folder, expected=expected)
    return {name: (folder / name).read_bytes() for name in TABLES if (folder / name).is_file()}


def read_record(folder: Path) -> Measurement:
    """Return the modes of such a folder, places of sensors nan where they are empty."""
    folder_tables(folder)
    table = read_table(folder / SENSORS)
    table.check_columns(("label", "x", "y", "z", "direction"))
    cells = [[row.number(name) for name in "xyz"] for row in table.rows]
    sensors = Sensors(
        tuple(row.text("label") for row in table.rows),
        np.array(cells, dtype=float).reshape(-1, 3),
        tuple(row.direction() for row in table.rows),
    )
    return read_modes(folder / MODES, sensors, SHAPE_STD)


def mean_record(records: Sequence[Measurement], files: Sequence[Path]) -> tuple[Measurement, str]:
    """Return the means of the modes that all records have, and what to say of their scatter.

    The deviations are those of the means: the scatter from record to record, taken to be the same
    share for all modes since few records tell it of none alone, over the root of their number.

    Arguments:
        records: two or more, of one state, on the same sensors.

    Raises:
        InputError: for other sensors, or records that share no mode.
    """
    first, count = records[0], len(records)
    hertz, shapes = [first.frequencies], [first.shapes]
    kept = np.ones(len(first), dtype=bool)
    for record, file in zip(records[1:], files[1:], strict=True):
        rows = {label: i for i, label in enumerate(record.sensors.labels)}
        if apart := sorted(set(rows) ^ set(first.sensors.labels)):
            what = f"not the sensors of {files[0]}: {', '.join(apart[:6])} in one of them only"
            expected = "the same sensors; parts of one test: `bench identify A B --output FOLDER`"
            raise InputError(what, file=file, expected=expected)
        own = record.shapes[[rows[label] for label in first.sensors.labels]]
        ways = (first.frequencies, first.shapes, record.frequencies, own)
        index = pair_modes(*ways, least_mac=_LEAST_MAC, window=_WINDOW).index
        kept &= index >= 0
        hertz.append(record.frequencies[index])
        shapes.append(own[:, index] * modal_scale_factor(first.shapes, own[:, index]))
    if not kept.any():
        expected = "records of one state: compare their tables"
        raise InputError("no mode is in all records", file=files[-1], expected=expected)
    f, s = np.array(hertz)[:, kept], np.array(shapes)[:, :, kept]
    mean, shape = f.mean(axis=0), s.mean(axis=0)
    largest = np.nanmax(np.abs(shape), axis=0)
    errors, ratio = (f / mean - 1.0, (s - shape) / largest), count / (count - 1.0)
    scatter = [float(np.sqrt(ratio * np.nanmean(np.square(error)))) for error in errors]
    picked, root = first.select(np.array(first.numbers)[kept].tolist()), np.sqrt(count)
    found = replace(
        picked,
        frequencies=mean,
        frequency_std=np.maximum(scatter[0] * mean, picked.frequency_std) / root,
        shapes=shape,
        shape_std=np.maximum(scatter[1] * largest, picked.shape_std) / root,
        frequency_correlation=shrunk_correlation(f)[0] if count >= _FEWEST else None,
    )
    shares = "frequencies scatter by {:.2g} % and shapes by {:.2g} %".format(
        *(100.0 * share for share in scatter)
    )
    said = f"means of {count} records of one state, {len(found)} modes in all of them"
    return found, f"{said}; from record to record {shares}"
