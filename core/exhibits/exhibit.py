"""The exhibit of a job: what its model predicts, for drawing."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from femubench.core.case.case import Case, Modification
from femubench.core.exhibits.element_change import difference_picture, relative_changes
from femubench.core.exhibits.shelf import Exhibits
from femubench.core.exhibits.stage import (
    MOST_NODES,
    drive_sensor,
    highest_measured,
    node_motions,
    node_positions,
    rounded,
    stage_of,
)
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.correlation import mac, modal_scale_factor
from femubench.core.modal.eigen import Modes, modes_of
from femubench.core.modal.frf import modal_sum, receptance
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import pair_modes
from femubench.core.typing import FloatArray

MOST_MODES = 12
MOST_CHANGED = 8  # of one modification
_SHAPE_DECIMALS = 3  # of the largest component
_ABOVE = 1.2  # modes up to this times the highest measured frequency are shown
_POINTS = 400
_DAMPING = 0.005  # where none was measured


def exhibit_of(
    case: Case, model: Model, parameters: Sequence[Mapping[str, Any]] = ()
) -> dict[str, Any] | None:
    """Return what a model predicts, in plain data.

    Arguments:
        case: what it is compared with.
        model: an updated model of the case.
        parameters: of the update, as a result has them.

    Returns None for a model that is too large to draw.

    Raises:
        ModelError: when the model cannot be solved or observed.
    """
    if len(node_positions(case.model)) > MOST_NODES:
        return None
    elements = relative_changes(case.model, model, parameters)
    by_entries = elements is None or model.stiffness_change is not None
    return {
        **_modes(case, model),
        "receptance": _receptances(case, model),
        "elements": elements,
        "difference": difference_picture(case.model, model) if by_entries else None,
    }


def _modes(case: Case, model: Model) -> dict[str, Any]:
    """Return the modes near the measured ones with their shapes, and the MAC matrix."""
    elastic = modes_of(model).elastic
    tested = case.measurement.select((*case.used, *case.held_out))
    at_sensors = np.asarray(model.observe(tested.sensors) @ elastic.shapes)
    frequencies = elastic.natural_frequencies
    partner = pair_modes(tested.frequencies, tested.shapes, frequencies, at_sensors).index
    most = _ABOVE * float(tested.frequencies.max(initial=0.0))
    wanted = [int(k) for k in partner if k >= 0]
    wanted += [k for k in np.flatnonzero(frequencies <= most).tolist() if k not in wanted]
    shown = sorted(wanted[:MOST_MODES])
    number = {int(k): n for k, n in zip(partner, tested.numbers, strict=True) if k >= 0}
    motion = node_motions(model, case.model, elastic.shapes[:, shown])
    largest = np.abs(motion).max(axis=(0, 1), initial=0.0)
    motion = motion / np.where(largest > 0.0, largest, 1.0)
    own = [
        {
            "hz": float(frequencies[k]),
            "paired": number.get(k),
            "modification": None,
            "shape": motion[..., j].round(_SHAPE_DECIMALS).tolist(),
        }
        for j, k in enumerate(shown)
    ]
    return {
        "modes": own
        + [mode for change in case.modifications for mode in _changed(case, model, change)],
        "mac": {
            "rows": list(tested.numbers),
            "columns": [float(frequencies[k]) for k in shown],
            "values": rounded(mac(tested.shapes, at_sensors[:, shown])),
        },
    }


def _changed(case: Case, model: Model, change: Modification) -> Iterator[dict[str, Any]]:
    """Yield the modes of a modified structure that belong to measured ones."""
    changed = model.attach(change.masses, change.springs)
    elastic, data = modes_of(changed).elastic, change.measurement
    at_sensors = np.asarray(changed.observe(data.sensors) @ elastic.shapes)
    partner = pair_modes(
        data.frequencies, data.shapes, elastic.natural_frequencies, at_sensors
    ).index
    pairs = [(n, int(k)) for n, k in zip(data.numbers, partner, strict=True) if k >= 0]
    pairs = pairs[:MOST_CHANGED]
    motion = node_motions(changed, case.model, elastic.shapes[:, [k for _, k in pairs]])
    largest = np.abs(motion).max(axis=(0, 1), initial=0.0)
    for j, (number, k) in enumerate(pairs):
        yield {
            "hz": float(elastic.natural_frequencies[k]),
            "paired": number,
            "modification": change.name,
            "shape": (motion[..., j] / (largest[j] or 1.0)).round(_SHAPE_DECIMALS).tolist(),
        }


def frequency_axis(case: Case) -> FloatArray:
    """Return the frequencies of the receptances of a case in Hz, (400,)."""
    return np.linspace(2.0, _ABOVE * highest_measured(case), _POINTS)


def damping_of(case: Case) -> float:
    """Return the median of the measured damping ratios, a half per cent where there is none."""
    known = case.measurement.damping[np.isfinite(case.measurement.damping)]
    return float(np.median(known)) if len(known) else _DAMPING


def _drive(case: Case) -> Sensors | None:
    label = drive_sensor(case)
    if label is None:
        return None
    sensors = case.measurement.sensors
    k = sensors.labels.index(label)
    return Sensors((label,), sensors.xyz[[k]], (sensors.directions[k],))


def _receptances(case: Case, model: Model) -> dict[str, Any]:
    """Return the receptances at the drive sensor in dB re 1 m/N, as tested and modified."""
    drive = _drive(case)
    if drive is None:
        return {}
    found = {"": _decibels(case, model, modes_of(model), drive)}
    for change in case.modifications:
        changed = model.attach(change.masses, change.springs)
        found[change.name] = _decibels(case, changed, modes_of(changed), drive)
    return found


def _decibels(case: Case, model: Model, modes: Modes, drive: Sensors) -> list[float]:
    row = model.observe(drive)
    values = receptance(modes, row, row, frequency_axis(case), damping_of(case))[:, 0, 0]
    return _level(values)


def _level(values: FloatArray) -> list[float]:
    levels = 20.0 * np.log10(np.maximum(np.abs(values), 1e-300))
    return [round(float(level), 1) for level in levels]


def measured_receptances(case: Case) -> dict[str, Any]:
    """Return receptances made of the measured modes, scaled to mass by their nominal partners.

    A test of free shapes does not tell modal masses: those of the nominal model stand in, as do
    its rigid-body modes and its modes above the measured ones.
    """
    drive = _drive(case)
    if drive is None:
        return {}
    tested = case.measurement.select((*case.used, *case.held_out))
    measured = {"": _stand_in(case, case.model, tested, drive)}
    alone = ", ".join(map(str, _unpaired(case.model, tested)))
    for change in case.modifications:
        changed = case.model.attach(change.masses, change.springs)
        measured[change.name] = _stand_in(case, changed, change.measurement, drive)
    return {
        "hz": rounded(frequency_axis(case)),
        "damping": damping_of(case),
        "measured": {name: level for name, level in measured.items() if level is not None},
        "note": "Made of the measured modes; scaled to mass, and completed by rigid-body and "
        "higher modes, with the nominal model."
        + (f" Measured modes without a partner there are not in it: {alone}." if alone else ""),
    }


def _unpaired(model: Model, data: Measurement) -> list[int]:
    """Return the numbers of the measured modes that no mode of a model belongs to."""
    elastic = modes_of(model).elastic
    at_sensors = np.asarray(model.observe(data.sensors) @ elastic.shapes)
    found = pair_modes(data.frequencies, data.shapes, elastic.natural_frequencies, at_sensors)
    return [number for number, k in zip(data.numbers, found.index, strict=True) if k < 0]


def _stand_in(case: Case, nominal: Model, data: Measurement, drive: Sensors) -> list[float] | None:
    modes = modes_of(nominal)
    at_sensors = np.asarray(nominal.observe(data.sensors) @ modes.shapes)
    elastic = np.flatnonzero(~modes.rigid)
    frequencies = modes.natural_frequencies[elastic]
    pairing = pair_modes(data.frequencies, data.shapes, frequencies, at_sensors[:, elastic])
    readings = np.asarray(nominal.observe(drive) @ modes.shapes)[0]
    eigenvalues = modes.eigenvalues.copy()
    known = data.sensors.labels
    row = known.index(drive.labels[0]) if drive.labels[0] in known else -1
    if row < 0 or not (pairing.index >= 0).any():
        return None
    for k, partner in enumerate(pairing.index):
        shape = data.shapes[:, k]
        if partner < 0 or not np.isfinite(shape[row]):
            continue
        own = elastic[partner]
        there = np.isfinite(shape)
        scale = modal_scale_factor(at_sensors[there, own], shape[there])
        readings[own] = float(np.real(scale).item()) * shape[row]
        eigenvalues[own] = data.eigenvalues[k]
    seen = readings[None]
    values = modal_sum(eigenvalues, seen, seen, frequency_axis(case), damping_of(case))
    return _level(values[:, 0, 0])


def keep_stages(exhibits: Exhibits, cases: Iterable[Case]) -> None:
    """Keep the stages of cases with what their nominal models predict; no picture is worth a run.

    Arguments:
        exhibits: of the store.
        cases: those of a run.
    """
    exhibits.tidy()
    for case in cases:
        if exhibits.has_stage(case.digest):
            continue
        with suppress(Exception), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            stage = stage_of(case)
            if stage is not None:
                more = {
                    "receptance": measured_receptances(case),
                    "nominal": exhibit_of(case, case.model),
                }
                exhibits.put_stage(case.digest, {**stage, **more})
