"""Functions of universal files (dataset 58): frequency responses, and motions over time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femubench import InputError, Sensors
from femubench.modal import FrequencyResponses, TimeSignals
from femubench.plugins.readers.reading import DIRECTIONS
from femubench.plugins.readers.universal_datasets import Dataset, read_datasets

_TIME, _RESPONSE = 1, 4  # types of a function
_QUANTITIES = {8: "receptance", 11: "mobility", 12: "accelerance"}
_FORCES = (0, 9, 13)  # unknown, reaction, excitation
_FORCE = "force"
_MOST_NUMBERS = 50_000_000  # lines times channels
_SAME_AXIS = 1e-6  # of the step
_KEY = "dataset 58"
_EMPTY = "dataset 58 with frequency responses (type 4) or time responses (type 1)"

Place = tuple[int, str]


@dataclass(frozen=True)
class _Function:
    """One function: what was measured where, and its values in SI units."""

    response: Place
    reference: Place | None
    quantity: str
    x: NDArray[np.float64]
    values: NDArray[np.complex128]


def read_functions(path: Path, positions: Sensors | None) -> FrequencyResponses | TimeSignals:
    """Return the frequency responses of a file, or its signals where there are no responses.

    Arguments:
        positions: sensors ``node:direction`` whose coordinates are known.

    Raises:
        InputError: when the file is broken, holds neither, or its functions do not belong together.
    """
    length = force = 1.0
    datasets: list[Dataset] = []
    for dataset in read_datasets(path, (58, 164)):
        if dataset["type"] == 164:
            length, force = float(dataset["length"]), float(dataset["force"])
        else:
            datasets.append(dataset)
    if not all(math.isfinite(factor) and factor > 0.0 for factor in (length, force)):
        raise InputError("unclear units", file=path, key="dataset 164", expected="factors > 0")
    for kind in (_RESPONSE, _TIME):
        wanted = [dataset for dataset in datasets if dataset["func_type"] == kind]
        if wanted:
            functions = [_function(path, dataset, length, force) for dataset in wanted]
            known = (
                {} if positions is None else dict(zip(positions.labels, positions.xyz, strict=True))
            )
            return (_responses if kind == _RESPONSE else _signals)(path, functions, known)
    found = ", ".join(sorted({f"type {dataset['func_type']}" for dataset in datasets}))
    what = f"no function that is of use, only {found}" if found else "no functions"
    raise InputError(what, file=path, expected=_EMPTY)


def _function(path: Path, dataset: Dataset, length: float, force: float) -> _Function:
    kind = dataset["func_type"]
    response, sign = _place(path, dataset, "rsp")
    reference = None
    ordinate = dataset["ordinate_spec_data_type"]
    acts = kind == _TIME and ordinate in _FORCES[1:]
    quantity = _FORCE if acts else _QUANTITIES.get(ordinate, "accelerance")
    x = np.asarray(dataset["x"], dtype=float)
    values = np.asarray(dataset["data"], dtype=complex)
    where = f"{response[0]}:{response[1]}"
    if len(values) != dataset["num_pts"] or len(x) != len(values):
        what = f"the function at {where} has {len(values)} of {dataset['num_pts']} values"
        raise InputError(what, file=path, key=_KEY, expected="a whole function")
    if not (np.isfinite(values).all() and np.isfinite(x).all()):
        what = f"the function at {where} has a value that is not finite"
        raise InputError(what, file=path, key=_KEY, expected="finite numbers")
    if kind == _RESPONSE:
        if dataset["orddenom_spec_data_type"] not in _FORCES:
            what = f"the function at {where} is not per force"
            raise InputError(what, file=path, key=_KEY, expected="motion over force")
        reference, other = _place(path, dataset, "ref")
        sign *= other
        turned = [place[1].startswith("r") for place in (response, reference)]
        # Lengths of the motion, and of the moment's arm.
        values = values * length ** (sum(turned) - 1) * force
    signed: NDArray[np.complex128] = np.asarray(sign * values, dtype=complex)
    return _Function(response, reference, quantity, x, signed)


def _place(path: Path, dataset: Dataset, what: str) -> tuple[Place, float]:
    """Return node and direction without sign, and the sign."""
    number, node = int(dataset[f"{what}_dir"]), int(dataset[f"{what}_node"])
    if not 1 <= abs(number) <= len(DIRECTIONS):
        said = f"the function at node {node} has the direction {number}"
        expected = "1 to 6 for x, y, z, rx, ry, rz, with a sign"
        raise InputError(said, file=path, key=_KEY, expected=expected)
    return (node, DIRECTIONS[abs(number) - 1]), math.copysign(1.0, number)


def _shared_axis(path: Path, functions: Sequence[_Function]) -> NDArray[np.float64]:
    """Return the abscissa that all functions have."""
    x = functions[0].x
    if len(x) < 2 or not (np.diff(x) > 0.0).all():
        what = "the axis of a function does not rise"
        raise InputError(what, file=path, key=_KEY, expected="two values or more, rising")
    step = float(np.diff(x).min())
    for function in functions:
        if len(function.x) != len(x) or np.abs(function.x - x).max() > _SAME_AXIS * step * len(x):
            node, direction = function.response
            what = f"the function at {node}:{direction} has another axis than the first one"
            expected = f"{len(x)} values from {x[0]:g} to {x[-1]:g}"
            raise InputError(what, file=path, key=_KEY, expected=expected)
    return x


def _sensors(places: Sequence[Place], known: Mapping[str, Any]) -> Sensors:
    nowhere = (math.nan, math.nan, math.nan)
    labels = tuple(f"{node}:{direction}" for node, direction in places)
    xyz = np.array([known.get(label, nowhere) for label in labels], dtype=float)
    return Sensors(labels, xyz.reshape(-1, 3), tuple(direction for _, direction in places))


def _listed(found: Iterator[Place | None]) -> list[Place]:
    return list(dict.fromkeys(place for place in found if place is not None))


def _responses(
    path: Path, functions: Sequence[_Function], known: Mapping[str, Any]
) -> FrequencyResponses:
    x = _shared_axis(path, functions)
    quantities = {function.quantity for function in functions}
    if len(quantities) > 1:
        what = f"functions of {' and '.join(sorted(quantities))} side by side"
        raise InputError(what, file=path, key=_KEY, expected="one quantity")
    outputs = _listed(function.response for function in functions)
    inputs = _listed(function.reference for function in functions)
    if len(x) * len(outputs) * len(inputs) > _MOST_NUMBERS:
        what = f"{len(x)} lines of {len(outputs)} responses to {len(inputs)} forces"
        raise InputError(what, file=path, expected=f"at most {_MOST_NUMBERS} numbers")
    values = np.full((len(x), len(outputs), len(inputs)), complex(math.nan, 0.0))
    for function in functions:
        assert function.reference is not None
        o, i = outputs.index(function.response), inputs.index(function.reference)
        if np.isfinite(values[0, o, i]):
            node, direction = function.response
            force = "{}:{}".format(*function.reference)
            what = f"the response at {node}:{direction} to the force at {force} is there twice"
            expected = "every response once: records of one state are files of their own"
            raise InputError(what, file=path, key=_KEY, expected=expected)
        values[:, o, i] = function.values
    quantity: Any = quantities.pop()
    return FrequencyResponses(
        _sensors(outputs, known), _sensors(inputs, known), x, values, quantity
    )


def _signals(path: Path, functions: Sequence[_Function], known: Mapping[str, Any]) -> TimeSignals:
    """Return motions and forces over time; a channel that comes again begins a record."""
    x = _shared_axis(path, functions)
    step = (x[-1] - x[0]) / (len(x) - 1)
    if np.abs(np.diff(x) - step).max() > 0.01 * step:
        raise InputError("uneven steps of time", file=path, key=_KEY, expected="even steps")
    quantities = {function.quantity for function in functions} - {_FORCE}
    if len(quantities) != 1:
        what = f"motions over time of {' and '.join(sorted(quantities)) or 'none'}"
        raise InputError(what, file=path, key=_KEY, expected="one quantity")
    records: list[dict[bool, dict[Place, Any]]] = []
    after_motion = True
    for function in functions:
        acting = function.quantity == _FORCE
        full = acting and after_motion and bool(records) and bool(records[-1][True])
        if not records or full or function.response in records[-1][acting]:
            records.append({False: {}, True: {}})
        records[-1][acting][function.response] = function.values.real
        after_motion = not acting
    quantity: Any = quantities.pop()
    parts = []
    for record in records:
        sides = (_sensors(list(record[acting]), known) for acting in (False, True))
        columns = (
            np.array(list(record[acting].values())).reshape(-1, len(x)).T
            for acting in (False, True)
        )
        (motions, forces), (values, force_values) = sides, columns
        parts.append(TimeSignals(motions, 1.0 / step, values, forces, force_values, quantity))
    return TimeSignals.joined(parts)
