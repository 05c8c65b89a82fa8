"""Frequency responses, and motions over time, in files that hold variables by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np

from femubench import InputError, Sensors
from femubench.modal import FrequencyResponses, Quantity, TimeSignals
from femubench.plugins.readers.modal_variables import named_variables
from femubench.plugins.readers.reading import words_of

# What a variable may be called, without case and underscores; the first is its key in --variables.
_MOTIONS = {
    "accelerance": ("acceleration", "accelerations", "acc", "accel", "a"),
    "mobility": ("velocity", "velocities", "vel", "v"),
    "receptance": ("displacement", "displacements", "disp", "x"),
}
_LABELS: dict[str, tuple[str, ...]] = {
    "responses": ("responses", "sensors", "labels", "channels", "channelnames"),
    "references": ("references", "points", "hitpoints", "forcelabels", "drives"),
    "quantity": ("quantity",),
}
_OVER_TIME: Mapping[str, tuple[str, ...]] = {
    "time": ("time", "t", "times"),
    "rate": ("rate", "fs", "samplerate", "samplingrate", "samplingfrequency", "samplefrequency"),
    "force": ("force", "forces", "hammer", "input", "inputs", "u", "f"),
    "rest": ("rest", "rests", "atrest"),
    "motion": (
        "motion", "motions", "signals", "response", "output", "outputs", "y", "data",
        *(name for key, names in _MOTIONS.items() for name in (key, *names)),
    ),
    **_LABELS,
}  # fmt: skip
_OVER_FREQUENCY: Mapping[str, tuple[str, ...]] = {
    "frequencies": ("frequencies", "frequency", "freq", "freqs", "f", "fn", "hz"),
    "values": ("values", "h", "h1", "frf", "frfs", "tf", *_MOTIONS),
    "deviations": ("deviations", "deviation", "std", "stds"),
    **_LABELS,
}
EXPECTED = (
    "variables frequencies and values (lines x responses x forces), or time (or rate), motion "
    "(samples x sensors) and force; bench identify --variables motion=NAME,force=NAME,... says "
    "which is which"
)


def holds_responses(variables: Mapping[str, Any]) -> bool:
    """Tell whether there are motions, or responses over frequency, and what they run over."""
    return bool(_found(variables, {}, Path()))


def _found(variables: Mapping[str, Any], names: Mapping[str, str], path: Path) -> dict[str, Any]:
    """Return the variables by key, nothing where there are not all that it takes."""
    every = {**_OVER_TIME, **_OVER_FREQUENCY}
    named_variables(variables, {key: every[key] for key in every if key in names}, names, path)
    for known, needed in ((_OVER_TIME, "motion"), (_OVER_FREQUENCY, "values")):
        own = {key: name for key, name in names.items() if key in known}
        found = named_variables(variables, known, own, path)
        if needed in found and {"time", "rate", "frequencies"} & set(found):
            return found
    return {}


def read_response_variables(
    variables: Mapping[str, Any], path: Path, names: Mapping[str, str]
) -> FrequencyResponses | TimeSignals:
    """Return the responses that are among variables.

    Arguments:
        names: from time, rate, motion, force, frequencies, values, responses, references and
            quantity to the name of a variable, where that is not a common one.

    Raises:
        InputError: where variables cannot be guessed, or sizes do not fit.
    """
    if found := _found(variables, names, path):
        return (_over_time if "motion" in found else _over_frequency)(found, path)
    there = ", ".join(f"{k} {np.shape(v)}" for k, v in list(variables.items())[:10])
    what = f"no responses that can be guessed among {there or 'no variables'}"
    raise InputError(what, file=path, expected=EXPECTED)


def _numbers(found: Mapping[str, Any], key: str, path: Path) -> Any:  # noqa: ANN401 - an array
    value = np.asarray(found[key])
    if value.dtype.kind not in "fiucb" or not value.size:
        raise InputError("no numbers", file=path, key=key, expected=EXPECTED)
    return value.astype(complex if value.dtype.kind == "c" else float)


def _by_lines(found: Mapping[str, Any], key: str, lines: int, path: Path) -> Any:  # noqa: ANN401
    """Return numbers with the axis of so many lines first, then one or two others."""
    value = np.squeeze(_numbers(found, key, path))
    axes = [axis for axis, size in enumerate(value.shape) if size == lines]
    if not axes or value.ndim > 3:
        what = f"is {' x '.join(map(str, value.shape)) or 'a number'}"
        expected = f"an axis of {lines}; --variables {key}=NAME says another one"
        raise InputError(what, file=path, key=key, expected=expected)
    moved = np.moveaxis(value, axes[0], 0)
    return moved[:, None] if moved.ndim == 1 else moved


def _side(found: Mapping[str, Any], key: str, count: int, path: Path) -> Sensors:
    """Return the labels of a side; places and directions are for others to know."""
    labels = words_of(found[key]) if key in found and count else [f"?{k}" for k in range(count)]
    if len(labels) != count:
        what = f"{len(labels)} labels of {count} channels"
        raise InputError(what, file=path, key=key, expected=f"--variables {key}=NAME of as many")
    return Sensors.unplaced(labels)


def _quantity(found: Mapping[str, Any], key: str, path: Path) -> Quantity:
    """Return what a motion is, by a variable or by the name of its own."""
    name = found[f"{key} is called"]
    guess = next((q for q, names in _MOTIONS.items() if name in (q, *names)), "accelerance")
    said: Any = words_of(found["quantity"])[0] if "quantity" in found else guess
    if said not in get_args(Quantity):
        expected = ", ".join(get_args(Quantity))
        raise InputError(f"{said!r}", file=path, key="quantity", expected=expected)
    return said  # type: ignore[no-any-return]


def _over_frequency(found: Mapping[str, Any], path: Path) -> FrequencyResponses:
    hz = _numbers(found, "frequencies", path).real.reshape(-1)
    given = [key for key in ("values", "deviations") if key in found]
    parts = [_by_lines(found, key, len(hz), path) for key in given]
    if parts[0].ndim < 3:  # the responses to one force, or of one response to several
        roving = np.size(found.get("references", ())) == parts[0].shape[1] > 1
        parts = [np.expand_dims(part, 1 if roving else 2) for part in parts]
    values, *stds = parts
    if stds and stds[0].shape != values.shape:
        what = f"{stds[0].shape} for values {values.shape}"
        raise InputError(what, file=path, key="deviations", expected="one for every value")
    first = _side(found, "responses", values.shape[1], path)
    second = _side(found, "references", values.shape[2], path)
    quantity = _quantity(found, "values", path)
    return FrequencyResponses(
        first, second, hz, values.astype(complex), quantity, np.real(stds[0]) if stds else None
    )


def _over_time(found: Mapping[str, Any], path: Path) -> TimeSignals:
    """Return the records: one, or where force or motion have one more axis, one a column of it."""
    if "time" in found:
        time = _numbers(found, "time", path).real.reshape(-1)
        step, lines = np.diff(time), len(time)
        rate = 1.0 / step.mean() if lines > 1 and np.ptp(step) <= 0.01 * step.mean() else 0.0
    else:
        rate, lines = float(found["rate"].mean()), max(np.shape(found["motion"]))
    if not 0.0 < rate < np.inf:
        expected = "even steps in s, or samples a second"
        raise InputError("uneven steps or no rate", file=path, key="time", expected=expected)
    motion, force = _by_lines(found, "motion", lines, path).real, np.zeros((lines, 0))
    if "force" in found:
        force = _by_lines(found, "force", lines, path).real
    count = force.shape[1]
    if motion.ndim < 3 and motion.shape[1] == count > 1 == np.size(found.get("responses", ())):
        motion = motion[:, None]  # one accelerometer, and a record for every hit point
    if motion.ndim == 3 and motion.shape[1] == count != motion.shape[2]:
        motion = motion.transpose(0, 2, 1)
    apart = motion.ndim == 3
    motion = motion if apart else motion[:, :, None]
    if force.ndim > 2 or (apart and count > 1 and motion.shape[2] != count):
        what = f"force {force.shape} and motion {motion.shape}"
        expected = "samples x records, and samples x sensors x records"
        raise InputError(what, file=path, key="force", expected=expected)
    sensors = _side(found, "responses", motion.shape[1], path)
    points = 1 if apart and np.size(found.get("references", ())) == 1 else count
    forces, quantity = _side(found, "references", points, path), _quantity(found, "motion", path)
    if "rest" in found:  # one more channel, which cuts all of them
        rest = _by_lines(found, "rest", lines, path).real[:, :1, None]
        motion = np.concatenate([motion, np.repeat(rest, motion.shape[2], axis=2)], axis=1)
        sensors = Sensors.united([sensors, Sensors.unplaced(["rest"])])
    parts = []
    for k in range(motion.shape[2]):
        column = slice(k, k + 1) if apart and count > 1 else slice(None)
        some = column if points > 1 else slice(None)
        own = Sensors(forces.labels[some], forces.xyz[some], forces.directions[some])
        parts.append(TimeSignals(sensors, rate, motion[:, :, k], own, force[:, column], quantity))
    return TimeSignals.joined(parts)
