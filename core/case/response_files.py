"""Read frequency responses and signals: of reader plugins and tables."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from femubench.core.case.files import LARGEST_FILE
from femubench.core.case.matrices import reading_with
from femubench.core.case.tables import SUFFIXES, Complex, read_table
from femubench.core.display import count_noun
from femubench.core.errors import InputError
from femubench.core.fem.sensors import DIRECTIONS, Sensors
from femubench.core.files import check_regular, open_regular
from femubench.core.modal.frf import FrequencyResponses, Quantity
from femubench.core.modal.signals import TimeSignals
from femubench.core.roles import Reader

_QUANTITY: Quantity = "accelerance"  # where a file does not say: what an accelerometer measures
_LABELS = "labels such as 12:z, a name and a direction"
_NO_LABELS = f"{_LABELS}: --variables responses=NAME,references=NAME, or --sensors, row by row"
_ANYWHERE = ("accelerometer", "force")  # alone, they need no place: shapes are at the others
_AXIS = re.compile(r"(frequency|freq|time|t)(?:\s*[\[(].*|_?(?:hz|s))?", re.IGNORECASE)
_FORCE = re.compile(r"(?:force|hammer)(?:[ :_]+|$)", re.IGNORECASE)
_UNIT = re.compile(r"(.*?)\s*[\[(]([^\])]*)[\])]")
_UNITS: dict[str, tuple[str, float]] = {
    "n": ("force", 1.0), "kn": ("force", 1e3), "lbf": ("force", 4.4482216),
    "g": ("accelerance", 9.80665), "m/s2": ("accelerance", 1.0), "m/s²": ("accelerance", 1.0),
    "m/s": ("mobility", 1.0), "mm/s": ("mobility", 1e-3), "m": ("receptance", 1.0),
    "mm": ("receptance", 1e-3),
}  # fmt: skip

Responses = FrequencyResponses | TimeSignals


def read_responses(
    file: Path,
    readers: Collection[Reader] = (),
    known: Sensors | None = None,
    names: Mapping[str, str] | None = None,
) -> Responses:
    """Return the frequency responses of a file, or its signals over time.

    Arguments:
        file: of a format that a reader plugin knows, or a table.
        readers: reader plugins that may offer ``read_responses``.
        known: sensors whose labels need not say a direction, or that have the order of a file
            without labels.
        names: of variables, where these are not the common ones.

    Raises:
        InputError: when the file holds neither, or numbers that cannot be.
    """
    check_regular(file, LARGEST_FILE)
    name = file.name.lower()
    able = [reader for reader in readers if hasattr(reader, "read_responses")]
    reader: Any = next((r for r in able if any(name.endswith(s) for s in r.suffixes)), None)
    if names and not hasattr(reader, "read_named_responses"):
        what = "has no variables by name"
        raise InputError(what, file=file, expected=".mat, .npz or .h5 with --variables")
    if reader is not None:
        with reading_with(reader, file):
            named = (file, names) if names else (file,)
            found = (reader.read_named_responses if names else reader.read_responses)(*named)
        if not isinstance(found, Responses):
            what = f"{reader.name} gave {type(found).__name__}"
            raise InputError(what, file=file, expected="FrequencyResponses or TimeSignals")
    elif name.endswith(SUFFIXES):
        found = _of_table(file)
    elif name.endswith(".npz"):
        found = _of_arrays(file)
    else:
        suffixes = ", ".join([*(s for r in able for s in r.suffixes), *SUFFIXES])
        raise InputError("unknown kind of file", file=file, expected=suffixes)
    return _checked(file, _labelled(file, found, known))


def _checked(file: Path, found: Responses) -> Responses:
    """Return what was read, whose numbers are finite and whose lines rise."""
    if isinstance(found, TimeSignals):
        holes = (~np.isfinite(found.values[record]) for record in found.records)
        partly = any((some.any(axis=0) & ~some.all(axis=0)).any() for some in holes)
        if partly or not np.isfinite(found.force_values).all():
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


def holds_responses(columns: Sequence[str]) -> bool:
    """Tell whether a table with these columns is one of frequency responses or of time."""
    return _AXIS.fullmatch(columns[0]) is not None and not {"mode"} & set(columns)


def _of_table(file: Path) -> Responses:
    """Return the channels of a table: ``frequency`` or ``time``, and a column a channel."""
    table = read_table(file)
    first, *columns = table.columns
    axis = _AXIS.fullmatch(first)
    if axis is None or not columns:
        expected = "frequency or time, then a column a channel"
        raise InputError("unknown columns", file=file, line=1, key=first[:60], expected=expected)
    rows = []
    for row in table.rows:
        cells = [row.value(column) for column in table.columns]
        if cells[0] is None or isinstance(cells[0], Complex):
            raise row.error(first, "not a number", "a number")
        rows.append([_number(cell) for cell in cells])
    numbers = np.array(rows, dtype=complex).reshape(-1, len(table.columns))
    if axis[1].lower().startswith("t"):
        step = np.diff(numbers[:, 0].real)
        if not len(step) or step.min() <= 0.0 or np.ptp(step) > 0.01 * step.mean():
            expected = "even steps in s, two rows or more"
            raise InputError("uneven steps", file=file, key="time", expected=expected)
        rate, values = float(1.0 / step.mean()), np.asarray(numbers[:, 1:].real)
        return TimeSignals(Sensors.unplaced(columns), rate, values)
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
    sensors, forces = Sensors.unplaced(outputs), Sensors.unplaced(inputs)
    return FrequencyResponses(sensors, forces, np.asarray(numbers[:, 0].real), channels, _QUANTITY)


def _number(cell: float | Complex | None) -> complex:
    """Return the value of a cell, nan of an empty one."""
    if isinstance(cell, Complex):
        return complex(*cell)
    return complex(np.nan if cell is None else cell)


def _of_arrays(file: Path) -> FrequencyResponses:
    """Return what `responses_npz` wrote: a case of ours is read without plugins."""
    try:
        with (
            open_regular(file, LARGEST_FILE) as stream,
            np.load(stream, allow_pickle=False) as held,
        ):
            names = [tuple(held[side].tolist()) for side in ("responses", "references")]
            first, second = map(Sensors.unplaced, names)
            hz, values, quantity = (held[key] for key in ("frequencies", "values", "quantity"))
            more = str(quantity[0]), held.get("deviations")
            return FrequencyResponses(first, second, hz, values, *more)  # type: ignore[arg-type]
    except Exception as error:  # whatever a broken file makes of this reader
        what = f"cannot be read: {' '.join(str(error).split())[:200]}"
        raise InputError(what, file=file, expected="responses in arrays by name") from None


def _labelled(file: Path, found: Responses, known: Sensors | None) -> Responses:
    """Return what was read with forces apart from motions, and with a direction to every label."""
    if isinstance(found, FrequencyResponses):
        sides = (found.responses, found.references)
        responses, references = _both_sides(file, sides, known)
        return replace(found, responses=responses, references=references)
    found = _between_rests(file, found)
    named = [_parse_channel(label) for label in found.sensors.labels]
    acting = np.array([kind == "force" for kind, _, _ in named], dtype=bool)
    quantities = {kind for kind, _, _ in named if kind != "force"} - {""} or {found.quantity}
    if len(quantities) > 1 or acting.all():
        what = "no motion" if acting.all() else f"{' and '.join(sorted(quantities))} in one file"
        raise InputError(what, file=file, expected="motions of one kind, in m/s2, m/s or m")
    values = found.values * [factor for _, factor, _ in named]
    labels = [label or f"?{k}" for k, (_, _, label) in enumerate(named)]
    named_so, own = replace(found.sensors, labels=tuple(labels)), found.forces
    sensors = named_so.take(np.flatnonzero(~acting))
    if acting.any():
        own = Sensors.unplaced(labels[k] for k in np.flatnonzero(acting))
        found = replace(found, force_values=values[:, acting])
    sensors, own = _both_sides(file, (sensors, own), known)
    quantity: Any = quantities.pop()
    return replace(found, sensors=sensors, values=values[:, ~acting], forces=own, quantity=quantity)


def _between_rests(file: Path, found: TimeSignals) -> TimeSignals:
    """Return what lies between the samples that a channel ``rest`` marks, each as a record."""
    marks = np.array([label.strip().lower() == "rest" for label in found.sensors.labels])
    level = np.abs(found.values[:, marks]).max(axis=1, initial=0.0)
    kept, others = np.flatnonzero(2.0 * level <= level.max()), np.flatnonzero(~marks)
    if not marks.any():
        return found
    if len(kept) in (0, len(level)):
        raise InputError("no rests between motions", file=file, key="rest", expected="1 at rest")
    starts = np.flatnonzero((np.diff(kept, prepend=-2) > 1) | np.isin(kept, found.starts))
    values, force = found.values[np.ix_(kept, others)], found.force_values
    force, first = force[kept[: len(force)]], tuple(starts.tolist())
    sensors = found.sensors.take(others)
    return replace(found, sensors=sensors, values=values, force_values=force, starts=first)


def _parse_channel(name: str) -> tuple[str, float, str]:
    """Return kind, factor to SI units and label of a channel, such as ``force 3:z [N]``."""
    text, unit = name.strip(), ""
    if (match := _UNIT.fullmatch(text)) is not None:
        text, unit = match[1].strip(), match[2].strip().lower().replace("^", "")
    kind, factor = _UNITS.get(unit, ("", 1.0))
    if (match := _FORCE.match(text)) is not None:
        kind, text = "force", text[match.end() :]
    return kind, factor, text


def _both_sides(
    file: Path, sides: tuple[Sensors, Sensors], known: Sensors | None
) -> tuple[Sensors, Sensors]:
    """Return motions and forces; one side may do without labels where known sensors are the other.

    So may a force alone, and an accelerometer alone of several forces.
    """
    found = []
    for side, other, name in zip(sides, sides[::-1], _ANYWHERE, strict=True):
        count, unnamed = len(side), side.labels[:1] and side.labels[0].startswith("?")
        alone = count == 1 and (name == "force" or len(other) > 1)
        if unnamed and (alone or (known is not None and len(known) == len(other) != count)):
            more = (f"{name} {k}" for k in range(2, count + 1))
            found.append(Sensors.unplaced([name, *more], "x"))
        else:
            found.append(side if not count and len(other) else _sensors(file, side, known))
    return found[0], found[1]


def _sensors(file: Path, side: Sensors, known: Sensors | None) -> Sensors:
    """Return sensors: known ones, or at unknown places along what their labels say."""
    labels, count = side.labels, len(side)
    twice = [label for k, label in enumerate(labels) if label in labels[:k]]
    if not labels or twice:
        what = f"the label {twice[0][:40]!r} is listed twice" if labels else "no labels"
        raise InputError(what, file=file, expected="every label once")
    if labels[0].startswith("?"):
        if known is None or len(known) != count:
            what = f"{count_noun(count, 'channel')} without labels"
            raise InputError(what, file=file, expected=_NO_LABELS)
        labels, side = known.labels, known
    rows = {} if known is None else {label: i for i, label in enumerate(known.labels)}
    xyz, directions = side.xyz.copy(), list(side.directions)
    for k, label in enumerate(labels):
        node, _, own = label.rpartition(":")
        if directions[k]:
            continue
        row = rows.get(label, rows.get(node))
        if row is not None:
            xyz[k] = known.xyz[row] if known is not None else xyz[k]
            directions[k] = known.directions[row] if known is not None else ""
        directions[k] = directions[k] or own
        known_way = directions[k] != own or own.lstrip("-") in DIRECTIONS
        if not known_way or not label.isprintable():
            raise InputError(f"{label[:40]!r} says no direction", file=file, expected=_LABELS)
    return Sensors(labels, xyz, tuple(directions))


def join_files(files: Sequence[Path], parts: Sequence[Responses]) -> Responses:
    """Return what several files hold of one state: records after one another, or all responses.

    Raises:
        InputError: where they do not belong together: other lines, quantities or places, a response
            that two of them have.
    """
    signals = [part for part in parts if isinstance(part, TimeSignals)]
    held = [part for part in parts if isinstance(part, FrequencyResponses)]
    if len(parts) == 1 or not held:
        return parts[0] if len(parts) == 1 else TimeSignals.joined(signals)
    if signals:
        what, expected = "records over time and frequency responses", "files of one kind"
        raise InputError(what, file=files[0], expected=expected)
    every = [Sensors.united([part.responses for part in held])]
    every += [Sensors.united([part.references for part in held])]
    joined = held[0].spread(*every)
    for file, part in zip(files[1:], held[1:], strict=True):
        more, lines = part.spread(*every), joined.frequencies
        own, twice = (np.isfinite(one.values).all(axis=0) for one in (more, joined))
        what = expected = ""
        if part.quantity != joined.quantity:
            what, expected = part.quantity, f"{joined.quantity}, as {files[0]} has"
        elif len(part.frequencies) != len(lines) or not np.allclose(part.frequencies, lines):
            what, expected = (dict(one.rows())["lines"] for one in (part, joined))
            what, expected = f"lines: {what}", f"{expected}, as {files[0]} has"
        elif len(pair := np.argwhere(own & twice)):
            labels = (side.labels[k] for side, k in zip(every, pair[0], strict=True))
            what = "the response at {} to {} is in a file before it, too".format(*labels)
            expected = "every pair once; of repeats `bench init --modes A --modes B`"
        if what:
            raise InputError(what, file=file, expected=expected)
        known = None
        if joined.deviations is not None and more.deviations is not None:
            known = np.where(own, more.deviations, joined.deviations)
        values = np.where(own, more.values, joined.values)
        joined = replace(joined, values=values, deviations=known)
    return joined


def responses_npz(measured: FrequencyResponses) -> bytes:
    """Return frequency responses as a NumPy file that `read_responses` reads."""
    held, stds = BytesIO(), measured.deviations
    more: dict[str, Any] = {} if stds is None else {"deviations": stds}
    np.savez_compressed(
        held,
        frequencies=measured.frequencies,
        values=measured.values,
        responses=np.array(measured.responses.labels),
        references=np.array(measured.references.labels),
        quantity=np.array([measured.quantity]),
        **more,
    )
    return held.getvalue()


def read_places(file: Path) -> Sensors:
    """Return the sensors of a table label,x,y,z,direction; a direction may be that of the label."""
    table = read_table(file)
    table.check_columns(("label", "x", "y", "z"), ("direction",))
    stated = "direction" in table.columns
    return Sensors(
        tuple(row.text("label") for row in table.rows),
        np.array([row.vector() for row in table.rows], dtype=float).reshape(-1, 3),
        tuple(row.direction() if stated and row.cells["direction"] else "" for row in table.rows),
    )


def locate_sensors(measured: Responses, known: Sensors, file: Path) -> Responses:
    """Return responses whose sensors lie where a table says.

    Arguments:
        known: a label without a direction of its own may be the part before the colon.

    Raises:
        InputError: when a sensor of the responses is not in the table.
    """
    places = dict(zip(known.labels, known.xyz, strict=True))

    def moved(sensors: Sensors) -> Sensors:
        xyz = []
        for label in sensors.labels:
            place = places.get(label, places.get(label.rpartition(":")[0]))
            if place is None and label.partition(" ")[0] not in _ANYWHERE:
                expected = f"a row for {label!r}"
                raise InputError("a sensor has no place", file=file, key="label", expected=expected)
            xyz.append([np.nan] * 3 if place is None else place)
        return replace(sensors, xyz=np.array(xyz, dtype=float).reshape(-1, 3))

    if isinstance(measured, TimeSignals):
        return replace(measured, sensors=moved(measured.sensors), forces=moved(measured.forces))
    forces = moved(measured.references)
    return replace(measured, responses=moved(measured.responses), references=forces)
