"""The texts of a case folder: tables of sensors and modes, `case.toml`."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from io import StringIO
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.case.frame_keys import Keys
from femubench.core.case.frame_tables import KEYS, columns_of
from femubench.core.case.modes import reach, with_default_std
from femubench.core.case.schema import LARGEST, SMALLEST
from femubench.core.case.tables import RESERVED
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.measurement import Measurement

if TYPE_CHECKING:
    from tomlkit.items import Item, Table

SHAPE_STD = 0.015


def number(value: float) -> str:
    """Return the shortest text that reads back to the same number; nothing for nan."""
    return "" if np.isnan(value) else repr(float(value))


def csv_bytes(header: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    """Return a table of comma-separated cells in UTF-8."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue().encode()


def part_csv(part: str, entries: Sequence[Keys]) -> bytes:
    """Return the table of joints or members.

    Arguments:
        part: ``joints`` or ``members``.
        entries: each as it would stand in `case.toml`.
    """
    used = {key for entry in entries for key in entry}
    keys = [key for key in KEYS[part] if key in used]
    rows = (
        [
            number(cell) if isinstance(cell, float) else cell
            for key in keys
            for cell in _spread(key, entry.get(key, ""))
        ]
        for entry in entries
    )
    return csv_bytes([column for key in keys for column in columns_of(key)], rows)


def _spread(key: str, value: Any) -> Sequence[Any]:  # noqa: ANN401 - what TOML can hold
    width = len(columns_of(key))
    if width == 1:
        return [value]
    return value or [""] * width


def sensors_csv(sensors: Sensors) -> bytes:
    """Return the table label,x,y,z,direction."""
    columns = zip(sensors.labels, sensors.xyz, sensors.directions, strict=True)
    rows = [[label, *(number(v) for v in xyz), way] for label, xyz, way in columns]
    return csv_bytes(["label", "x", "y", "z", "direction"], rows)


def modes_csv(measurement: Measurement, share: float, stated: str = RESERVED[2]) -> bytes:
    """Return the table of modes, with a column LABEL_std where deviations are no common share.

    Arguments:
        share: the deviation of shapes relative to the largest reading.
        stated: name of the column with the deviations of the frequencies.
    """
    m = measurement
    std = np.where(_is_share(m, share), np.nan, m.shape_std)
    own = [s for s in range(len(m.sensors)) if np.isfinite(std[s]).any()]
    labels = m.sensors.labels
    known = [] if m.modal_mass is None else [m.modal_mass]
    header = [*RESERVED[:2], stated, *RESERVED[3 : 4 + len(known)], *labels]
    header += [f"{labels[s]}_std" for s in own]
    scalars = zip(m.numbers, m.frequencies, m.frequency_std, m.damping, *known, strict=True)
    rows = [
        [int(mode), *(number(v) for v in (*values, *m.shapes[:, i], *std[own, i]))]
        for i, (mode, *values) in enumerate(scalars)
    ]
    return csv_bytes(header, rows)


def covariance_csv(measurement: Measurement) -> bytes:
    """Return the table of the covariance of the frequencies in Hz^2."""
    covariance, numbers = measurement.frequency_covariance, measurement.numbers
    assert covariance is not None
    pairs = zip(numbers, covariance, strict=True)
    rows = [[mode, *(number(value) for value in row)] for mode, row in pairs]
    return csv_bytes(["mode", *map(str, numbers)], rows)


def _is_share(m: Measurement, share: float) -> Any:  # noqa: ANN401 - a bool array
    return m.shape_std == with_default_std(m.shapes, np.full(m.shapes.shape, np.nan), share)


def common_share(measurements: Sequence[Measurement], known: float | None) -> float:
    """Return the deviation of shapes, of the largest reading, that fits the most of them.

    Arguments:
        known: what the case's own file says, which wins where others fit as well.
    """
    candidates = [*([] if known is None else [known]), SHAPE_STD]
    ratios = Counter(ratio for m in measurements for ratio in _ratios(m))
    candidates += [ratio for ratio, _ in ratios.most_common(4)]
    fits = [sum(int(_is_share(m, share).sum()) for m in measurements) for share in candidates]
    return candidates[int(np.argmax(fits))]


def _ratios(m: Measurement) -> list[float]:
    """Return the deviations over the reading of which they are a share, also rounded."""
    with np.errstate(all="ignore"):
        ratios = (m.shape_std / reach(m.shapes)).ravel()
    good = [float(r) for r in ratios[(ratios > 10 * SMALLEST) & (ratios < LARGEST / 10)]]
    return [float(f"{r:.12g}") for r in good] + good


def toml_bytes(keys: Keys, comment: Sequence[str]) -> bytes:
    """Return a `case.toml`: tables at the top levels, whatever lies deeper on one line.

    Arguments:
        keys: plain data, tables and lists of tables at the top and in ``model``.
    """
    import tomlkit

    document = tomlkit.document()
    for line in comment:
        clean = "".join(c if c.isprintable() else " " for c in line)
        document.add(tomlkit.comment(clean))
    if comment:
        document.add(tomlkit.nl())
    for name, value in keys.items():
        document.add(name, _nested(value, 3 if name == "model" else 1))
    text = "\n".join(line.rstrip() for line in tomlkit.dumps(document).split("\n"))
    # tomlkit sets headers apart in some places and not in others
    return re.sub(r"\n*\n(\[\[?[^\n]*\n)", r"\n\n\1", text).strip("\n").encode() + b"\n"


def _nested(value: Any, depth: int) -> Item:  # noqa: ANN401 - plain data
    import tomlkit

    if depth and isinstance(value, dict):
        return _table(value, depth - 1)
    if depth and isinstance(value, list) and value and isinstance(value[0], dict):
        entries = tomlkit.aot()
        for entry in value:
            entries.append(_table(entry, 0))
        return entries
    # In an array, tables stand on one line.
    item: Item = tomlkit.item(value, _parent=tomlkit.array())
    return item


def _table(keys: Keys, depth: int) -> Table:
    import tomlkit

    table = tomlkit.table()
    for key, value in keys.items():
        table.add(key, _nested(value, depth))
    return table
