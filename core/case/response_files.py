"""Read frequency responses and signals: of reader plugins, tables and NumPy files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any, get_args

import numpy as np

from femubench.core.case.files import LARGEST_FILE
from femubench.core.case.matrices import reading_with
from femubench.core.case.tables import SUFFIXES, Complex, read_table
from femubench.core.errors import InputError
from femubench.core.fem.sensors import DIRECTIONS, Sensors
from femubench.core.files import check_regular, open_regular
from femubench.core.modal.frf import FrequencyResponses, Quantity
from femubench.core.modal.signals import TimeSignals
from femubench.core.roles import Reader
from femubench.core.typing import AnyArray

_ARRAYS = ".npz"
_QUANTITY: Quantity = "accelerance"  # where a file does not say: what an accelerometer measures
_LABELS = "labels such as 12:z, a name and a direction"

Responses = FrequencyResponses | TimeSignals


def read_responses(
    file: Path, readers: Sequence[Reader] = (), known: Sensors | None = None
) -> Responses:
    """Return the frequency responses of a file, or its signals over time.

    Arguments:
        file: of a format that a reader plugin knows, ``.csv`` or ``.npz``.
        readers: reader plugins that may offer ``read_responses``.
        known: sensors whose labels need not say a direction.

    Raises:
        InputError: when the file holds neither, or numbers that cannot be.
    """
    check_regular(file, LARGEST_FILE)
    name = file.name.lower()
    able = [reader for reader in readers if hasattr(reader, "read_responses")]
    reader: Any = next((r for r in able if any(name.endswith(s) for s in r.suffixes)), None)
    if reader is not None:
        with reading_with(reader, file):
            found = reader.read_responses(file)
        if not isinstance(found, Responses):
            what = f"{reader.name} gave {type(found).__name__}"
            raise InputError(what, file=file, expected="FrequencyResponses or TimeSignals")
    elif name.endswith(SUFFIXES):
        found = _of_table(file, known)
    elif name.endswith(_ARRAYS):
        found = _of_arrays(file, _arrays(file), known)
    else:
        suffixes = ", ".join([*(s for r in able for s in r.suffixes), ".csv", _ARRAYS])
        raise InputError("unknown kind of file", file=file, expected=suffixes)
    return _checked(file, found)


def _checked(file: Path, found: Responses) -> Responses:
    """Return what was read, whose numbers are finite and whose lines rise."""
    if isinstance(found, TimeSignals):
        if not np.isfinite(found.values).all():
            raise InputError("a sample is not finite", file=file, expected="numbers")
        return found
    rising = np.isfinite(found.frequencies).all() and (np.diff(found.frequencies) > 0.0).all()
    if not len(found.frequencies) or not rising or found.frequencies[0] < 0.0:
        what = "the frequencies do not rise"
        raise InputError(what, file=file, expected="frequencies >= 0 in Hz, rising")
    bad = ~np.isfinite(found.values)
    if (bad.any(axis=0) & ~bad.all(axis=0)).any():
        o, i = (int(k[0]) for k in np.nonzero(bad.any(axis=0) & ~bad.all(axis=0)))
        labels = found.responses.labels[o], found.references.labels[i]
        what = f"the response at {labels[0]} to {labels[1]} has a value that is not finite"
        raise InputError(what, file=file, expected="numbers in the whole of it")
    if bad.all():
        raise InputError("no response was measured", file=file, expected="finite numbers")
    return found


def _of_table(file: Path, known: Sensors | None) -> Responses:
    """Return the channels of a table: ``frequency`` or ``time``, and a column a channel."""
    table = read_table(file)
    first, *columns = table.columns
    if first not in ("frequency", "time") or not columns:
        expected = "frequency or time, then a column a channel"
        raise InputError("unknown columns", file=file, line=1, key=first[:60], expected=expected)
    rows = []
    for row in table.rows:
        cells = [row.value(column) for column in table.columns]
        if cells[0] is None or isinstance(cells[0], Complex):
            raise row.error(first, "not a number", "a number")
        rows.append([_number(cell) for cell in cells])
    numbers = np.array(rows, dtype=complex).reshape(-1, len(table.columns))
    if first == "time":
        step = np.diff(numbers[:, 0].real)
        if not len(step) or step.min() <= 0.0 or np.ptp(step) > 0.01 * step.mean():
            expected = "even steps in s, two rows or more"
            raise InputError("uneven steps", file=file, key="time", expected=expected)
        sensors = _sensors(file, columns, known)
        return TimeSignals(sensors, float(1.0 / step.mean()), np.asarray(numbers[:, 1:].real))
    pairs = [column.partition("/") for column in columns]
    for column, (response, slash, reference) in zip(columns, pairs, strict=True):
        if not (response and slash and reference):
            expected = "RESPONSE/FORCE, e.g. 12:z/1:z"
            raise InputError("which force?", file=file, line=1, key=column[:60], expected=expected)
    outputs = list(dict.fromkeys(response for response, _, _ in pairs))
    inputs = list(dict.fromkeys(reference for _, _, reference in pairs))
    channels = np.full((len(numbers), len(outputs), len(inputs)), np.nan, dtype=complex)
    for k, (response, _, reference) in enumerate(pairs):
        channels[:, outputs.index(response), inputs.index(reference)] = numbers[:, 1 + k]
    sensors, forces = _sensors(file, outputs, known), _sensors(file, inputs, known)
    return FrequencyResponses(sensors, forces, np.asarray(numbers[:, 0].real), channels, _QUANTITY)


def _number(cell: float | Complex | None) -> complex:
    """Return the value of a cell, nan of an empty one."""
    if isinstance(cell, Complex):
        return complex(*cell)
    return complex(np.nan if cell is None else cell)


def _arrays(file: Path) -> Mapping[str, Any]:
    """Return the variables of a file of arrays."""
    try:
        with (
            open_regular(file, LARGEST_FILE) as stream,
            np.load(stream, allow_pickle=False) as held,
        ):
            return {name: held[name] for name in held.files}
    except Exception as error:  # whatever a broken file makes of these readers
        what = f"cannot be read: {' '.join(str(error).split())[:200]}"
        raise InputError(what, file=file, expected="arrays by name") from None


def _of_arrays(file: Path, held: Mapping[str, Any], known: Sensors | None) -> Responses:
    """Return what arrays of these names say.

    ``frequencies`` (n_f), ``responses`` and ``references`` (labels), ``values`` (n_f, n_responses,
    n_references), ``quantity``; or ``rate`` in Hz, ``sensors`` (labels), ``signals`` (n_samples,
    n_sensors).
    """

    def array(name: str, kinds: str) -> AnyArray:
        if name not in held:
            there = ", ".join(key for key in held if not key.startswith("__"))[:200]
            raise InputError("missing array", file=file, key=name, expected=f"it among {there}")
        value = np.asarray(held[name])
        if value.dtype.kind not in kinds:
            raise InputError(f"is of type {value.dtype}", file=file, key=name, expected="numbers")
        return value

    def labels(name: str) -> list[str]:
        if name not in held:
            array(name, "U")
        flat = np.asarray(held[name]).ravel()
        return [str(item).strip() for item in flat]

    if "signals" in held:
        values, names = array("signals", "fiu").astype(float), labels("sensors")
        rate = float(array("rate", "fiu").mean()) if np.size(held.get("rate", ())) else 0.0
        if values.ndim != 2 or values.shape[1] != len(names) or not 0.0 < rate < np.inf:
            expected = f"(n_samples, {len(names)}) and a rate > 0 in Hz"
            raise InputError("wrong shape", file=file, key="signals", expected=expected)
        return TimeSignals(_sensors(file, names, known), rate, values)
    hz = array("frequencies", "fiu").astype(float).ravel()
    outputs, inputs = labels("responses"), labels("references")
    values = array("values", "fiuc").astype(complex)
    if values.shape != (len(hz), len(outputs), len(inputs)):
        expected = f"({len(hz)}, {len(outputs)}, {len(inputs)})"
        raise InputError(f"is {values.shape}", file=file, key="values", expected=expected)
    quantity: Any = ", ".join(labels("quantity")) if "quantity" in held else _QUANTITY
    if quantity not in get_args(Quantity):
        expected = ", ".join(get_args(Quantity))
        raise InputError(f"{quantity!r}", file=file, key="quantity", expected=expected)
    return FrequencyResponses(
        _sensors(file, outputs, known), _sensors(file, inputs, known), hz, values, quantity
    )


def _sensors(file: Path, labels: Sequence[str], known: Sensors | None) -> Sensors:
    """Return sensors: known ones, or at unknown places along what their labels say."""
    twice = [label for k, label in enumerate(labels) if label in labels[:k]]
    if not labels or twice:
        what = f"the label {twice[0][:40]!r} is listed twice" if labels else "no labels"
        raise InputError(what, file=file, expected="every label once")
    rows = {} if known is None else {label: i for i, label in enumerate(known.labels)}
    xyz, directions = np.full((len(labels), 3), np.nan), []
    for k, label in enumerate(labels):
        direction = label.rpartition(":")[2]
        if known is not None and label in rows:
            xyz[k], direction = known.xyz[rows[label]], known.directions[rows[label]]
        elif direction.lstrip("-") not in DIRECTIONS or not label.isprintable():
            raise InputError(f"{label[:40]!r} says no direction", file=file, expected=_LABELS)
        directions.append(direction)
    return Sensors(tuple(labels), xyz, tuple(directions))


def responses_npz(measured: FrequencyResponses) -> bytes:
    """Return frequency responses as a NumPy file that `read_responses` reads."""
    held = BytesIO()
    np.savez_compressed(
        held,
        frequencies=measured.frequencies,
        values=measured.values,
        responses=np.array(measured.responses.labels),
        references=np.array(measured.references.labels),
        quantity=np.array([measured.quantity]),
    )
    return held.getvalue()


def locate_sensors(measured: Responses, file: Path) -> Responses:
    """Return responses whose sensors lie where a table says.

    Arguments:
        measured: what was read.
        file: a table label,x,y,z,direction; a label without a direction of its own may be the
            part before the colon.

    Raises:
        InputError: when a sensor of the responses is not in the table.
    """
    table = read_table(file)
    table.check_columns(("label", "x", "y", "z"), ("direction",))
    places = {row.text("label"): row.vector() for row in table.rows}

    def moved(sensors: Sensors) -> Sensors:
        xyz = []
        for label in sensors.labels:
            place = places.get(label, places.get(label.rpartition(":")[0]))
            if place is None:
                expected = f"a row for {label!r}"
                raise InputError("a sensor has no place", file=file, key="label", expected=expected)
            xyz.append(place)
        return replace(sensors, xyz=np.array(xyz, dtype=float))

    if isinstance(measured, TimeSignals):
        return replace(measured, sensors=moved(measured.sensors))
    forces = moved(measured.references)
    return replace(measured, responses=moved(measured.responses), references=forces)
