"""Which frequency responses of a case are given, and which are held out: what the keys must be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from femubench.core.case.faults import BadKey, KeyPath
from femubench.core.case.schema import BAND, ResponsesSpec
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.frf import FrequencyResponses, ResponseSplit, in_bands
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import FloatArray

_KEY: KeyPath = ("measurement", "responses")


def split_responses(
    measured: FrequencyResponses, spec: ResponsesSpec, tested: Measurement, held_out: set[int]
) -> tuple[FrequencyResponses, ResponseSplit]:
    """Return responses at sensors of a case, with deviations, and which of them are given.

    The side with more sensors, driven or read, comes first, as reciprocity allows.

    Arguments:
        spec: the key `responses`.
        held_out: labels of its modes that no strategy may see.

    Raises:
        BadKey: where the keys say nothing of these responses, or give away a held-out mode.
    """
    if measured.quantity == "free decay" or measured.decay:
        what = "free decays" if measured.quantity == "free decay" else "an exponential window"
        raise BadKey(_KEY, f"the responses are those of {what}", "motions over force, no window")
    measured = measured.taken_as(spec.quantity or measured.quantity, spec.factor)
    turned = len(measured.references) > len(measured.responses)
    found = _at_sensors(measured.transpose() if turned else measured, tested.sensors)
    split = ResponseSplit(spec.used, spec.held_out, spec.held_out_sensors)
    for j, label in enumerate(split.held_out_sensors):
        driven = label in found.references.labels  # reciprocity would give what it reads
        if driven or label not in found.responses.labels:
            what = f"{'a force acts at' if driven else 'no response of'} {label[:40]!r}"
            expected = f"one of {', '.join(found.responses.labels[:20])}, driven by none"
            raise BadKey((*_KEY, "held_out_sensors", j), what, expected)
    for path, band in _bands(split):
        if not in_bands(found.frequencies, [band]).any():
            there = "{:.6g} to {:.6g} Hz".format(*found.frequencies[[0, -1]])
            raise BadKey(path, "no line lies in the band", f"a part of {there}")
    for number, hertz in zip(tested.numbers, tested.frequencies, strict=True):
        if number in held_out and in_bands(np.array([hertz]), split.used)[0]:
            what = f"the used lines have the resonance of held-out mode {number} ({hertz:.6g} Hz)"
            raise BadKey((*_KEY, "used"), what, "bands without it, or the mode in used")
    if not np.isfinite(split.given(found).values).any():
        raise BadKey((*_KEY, "used"), "no response is given", "a sensor that is not held out")
    return replace(found, deviations=_deviations(found, spec)), split


def _bands(split: ResponseSplit) -> Iterator[tuple[KeyPath, tuple[float, float]]]:
    """Yield every band with its key; raises BadKey where one is empty or meets another."""
    seen: list[tuple[float, float]] = []
    for key in ("used", "held_out"):
        for j, (low, high) in enumerate(getattr(split, key)):
            path = (*_KEY, key, j)
            if low >= high:
                raise BadKey(path, "the band is empty", BAND)
            if any(low <= top and bottom <= high for bottom, top in seen):
                raise BadKey(path, "the band meets another one", "bands apart")
            seen.append((low, high))
            yield path, (low, high)


def _at_sensors(measured: FrequencyResponses, sensors: Sensors) -> FrequencyResponses:
    """Return responses at sensors of the case alone, whose places and directions hold."""
    rows = {label: row for row, label in enumerate(sensors.labels)}
    found = measured.take(k for k, name in enumerate(measured.responses.labels) if name in rows)
    unknown = [label for label in measured.references.labels if label not in rows]
    if unknown or not len(found.responses):
        what = f"force {unknown[0][:40]!r} acts at" if unknown else "the file has"
        expected = f"labels as in sensors, e.g. {', '.join(sensors.labels[:3])}"
        raise BadKey(("measurement", "frfs"), f"{what} no sensor of the case", expected)
    sides = (found.responses, found.references)
    ours = [sensors.take(rows[label] for label in side.labels) for side in sides]
    return replace(found, responses=ours[0], references=ours[1])


def _deviations(found: FrequencyResponses, spec: ResponsesSpec) -> FloatArray:
    """Return the stated standard deviations, or else those of the file, like the values."""
    stated = found.deviations if spec.std is None else spec.std * np.abs(found.values)
    key, expected = "floor", "a number > 0, in the unit of the responses"
    if spec.std is None:
        key, expected = "std", "a share of the magnitude, e.g. 0.01"
    if stated is None:
        raise BadKey((*_KEY, key), "the file has no deviations", expected)
    own = np.asarray(np.hypot(stated, spec.floor))
    if not ((stated >= 0.0) & (own > 0.0) & (own < np.inf))[np.isfinite(found.values)].all():
        raise BadKey((*_KEY, key), "a response has no deviation above 0", expected)
    return own
