"""What a model predicts of a case, and what was measured there, in plain data for drawing."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from femubench.core.case.case import Case
from femubench.core.drawing.element_change import difference_picture, relative_changes
from femubench.core.drawing.files import Exhibits
from femubench.core.drawing.findings import changes_found
from femubench.core.drawing.thinning import thin_nodes
from femubench.core.drawing.wireframe import MOST_NODES, node_positions, wireframe_of
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.correlation import mac, modal_scale_factor
from femubench.core.modal.eigen import Modes, keep_last, modes_of
from femubench.core.modal.frf import modal_sum, receptance
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import Pairing, pair_measured
from femubench.core.schema.records import to_plain
from femubench.core.typing import AnyArray, FloatArray, IntArray

DIGITS = 4
_AXES = {"in-plane": ("x", "z"), "out-of-plane": ("z",), "3d": ("x", "y", "z")}
MOST_MODES = 12
MOST_CHANGED = 8  # of one modification
_SHAPE_DECIMALS = 3  # of the largest component
_ABOVE = 1.2  # modes up to this times the highest measured frequency are shown
_POINTS = 400


def case_drawing(case: Case) -> dict[str, Any] | None:
    """Return the structure of a case and what was measured on it, in plain data.

    A large frame is thinned out, and `thinned` says how many nodes and elements it has. Returns
    None for large matrices.
    """
    few = thin_nodes(case)
    wireframe = wireframe_of(case) if few is None else few.wireframe(case)
    if not wireframe.nodes:
        return None
    return {
        **to_plain(wireframe),
        "thinned": None if few is None else [few.of, few.elements],
        "measured": list(_measured(case)),
        "drive": drive_sensor(case),
    }


def exhibit_of(
    case: Case, model: Model, parameters: Sequence[Mapping[str, Any]] = ()
) -> dict[str, Any] | None:
    """Return what a model predicts, in plain data.

    Returns None for a model that is too large to draw.

    Raises:
        ModelError: when the model cannot be solved or observed.
    """
    few = thin_nodes(case)
    if few is None and len(node_positions(case.model)) > MOST_NODES:
        return None
    found = changes_found(case, parameters)
    elements = None
    if few is not None:
        found = [replace(finding, spans=()) for finding in found]  # its members are not drawn
    elif all(finding.kind == "elsewhere" for finding in found):
        elements = relative_changes(case.model, model)
    by_entries = (elements is None and not found) or model.stiffness_change is not None
    return {
        **_modes(case, model, None if few is None else few.nodes),
        "receptance": receptances(case, model),
        "findings": [to_plain(finding) for finding in found],
        "elements": elements,
        "difference": difference_picture(case.model, model) if by_entries else None,
    }


def pair_modes(model: Model, data: Measurement) -> tuple[Modes, FloatArray, Pairing]:
    """Return the elastic modes of a model, their readings at the sensors, and the partners.

    Arguments:
        model: the structure as it was when it was measured.
        data: measured modes.
    """
    elastic = modes_of(model).elastic
    at_sensors = np.asarray(model.observe(data.sensors) @ elastic.shapes)
    return elastic, at_sensors, pair_measured(data, elastic, at_sensors)


def _structures(case: Case, model: Model) -> Iterator[tuple[str, Model, Measurement]]:
    """Yield the structure as tested (``""``) and with every modification, and what was measured."""
    yield "", model, case.measurement.select((*case.used, *case.held_out))
    for change in case.modifications:
        # The same one every time, so that it is solved once.
        own = keep_last(model, ("attached", id(change)), change, partial(change.modify, model))
        yield change.name, own, change.measurement


def _modes(case: Case, model: Model, nodes: IntArray | None = None) -> dict[str, Any]:
    """Return the modes near the measured ones with their shapes, and the MAC matrix.

    Arguments:
        nodes: that are drawn; None for all.
    """
    drawn: list[dict[str, Any]] = []
    likeness: dict[str, Any] = {}
    for name, changed, data in _structures(case, model):
        elastic, at_sensors, pairing = pair_modes(changed, data)
        frequencies = elastic.natural_frequencies
        number = {int(k): n for k, n in zip(pairing.index, data.numbers, strict=True) if k >= 0}
        shown = list(number)[: MOST_CHANGED if name else None]
        if not name:
            most = _ABOVE * float(data.frequencies.max(initial=0.0))
            near = np.flatnonzero(frequencies <= most).tolist()
            shown = sorted([*shown, *(k for k in near if k not in number)][:MOST_MODES])
            likeness = {
                "rows": list(data.numbers),
                "columns": [float(frequencies[k]) for k in shown],
                "values": round_values(mac(data.shapes, at_sensors[:, shown])),
            }
        motion = node_motions(changed, case.model, elastic.shapes[:, shown], nodes)
        largest = np.abs(motion).max(axis=(0, 1), initial=0.0)
        drawn += [
            {
                "hz": float(frequencies[k]),
                "paired": number.get(k),
                "modification": name or None,
                "shape": (motion[..., j] / (largest[j] or 1.0)).round(_SHAPE_DECIMALS).tolist(),
            }
            for j, k in enumerate(shown)
        ]
    return {"modes": drawn, "mac": likeness}


def frequency_axis(case: Case) -> FloatArray:
    """Return the frequencies of the receptances of a case in Hz, (400,)."""
    found = (hz for *_, data in measured_blocks(case) for hz in data.frequencies)
    return np.linspace(2.0, _ABOVE * float(max(found, default=0.0)), _POINTS)


def _drive(case: Case, label: str | None = None) -> Sensors | None:
    """Return the one sensor of a label, the drive sensor where none is given."""
    label = label or drive_sensor(case)
    if label is None:
        return None
    sensors = case.measurement.sensors
    return sensors.take([sensors.labels.index(label)])


def receptances(case: Case, model: Model, sensor: str | None = None) -> dict[str, list[float]]:
    """Return the receptances at one sensor in dB re 1 m/N, as tested (``""``) and modified.

    Arguments:
        case: gives the sensor, the frequencies, the damping and the modifications.
        sensor: its label; None for the drive sensor.
    """
    drive = _drive(case, sensor)
    if drive is None:
        return {}
    hz, damping = frequency_axis(case), case.measurement.usual_damping
    found = {}
    for name, changed, _ in _structures(case, model):
        row = changed.observe(drive)
        found[name] = _decibels(receptance(modes_of(changed), row, row, hz, damping))
    return found


def _decibels(values: FloatArray) -> list[float]:
    levels = 20.0 * np.log10(np.maximum(np.abs(values[:, 0, 0]), 1e-300))
    return [round(float(level), 1) for level in levels]


def list_receptances(case: Case, sensor: str | None = None) -> dict[str, Any]:
    """Return receptances as measured, or made of the measured modes and scaled to mass.

    Where no frequency responses were measured at the sensor, modes stand for them. A test of free
    shapes does not tell modal masses: those of the nominal model stand in, as do its rigid-body
    modes and its modes above the measured ones.
    """
    drive = _drive(case, sensor)
    if drive is None:
        return {}
    measured: dict[str, Sequence[float | None]] = {}
    alone: list[str] = []
    for name, changed, data in _structures(case, case.model):
        _, at_sensors, pairing = pair_modes(changed, data)
        as_measured = None if name else _as_measured(case, drive.labels[0])
        if as_measured is not None:
            measured[name] = as_measured
        elif drive.labels[0] in data.sensors.labels and (pairing.index >= 0).any():
            measured[name] = _stand_in(case, changed, data, drive, pairing, at_sensors)
        if not name:
            pairs = zip(data.numbers, pairing.index, strict=True)
            alone = [str(number) for number, k in pairs if k < 0]
    note = (
        "Made of the measured modes; scaled to mass, and completed by rigid-body and higher modes, "
        "with the nominal model."
    )
    if _point_response(case, drive.labels[0]) is not None:
        changed_too = f" Of modified structures: {note[0].lower()}{note[1:]}"
        note = f"As measured.{changed_too if case.modifications else ''}"
    elif alone:
        note += f" Measured modes without a partner there are not in it: {', '.join(alone)}."
    return {
        "hz": round_values(frequency_axis(case)),
        "damping": case.measurement.usual_damping,
        "measured": measured,
        "note": note,
    }


def _point_response(case: Case, label: str) -> AnyArray | None:
    """Return the measured receptance of one sensor to a force at it; None where there is none."""
    frfs = case.frfs
    if frfs is None or label not in frfs.responses.labels or label not in frfs.references.labels:
        return None
    o, i = frfs.responses.labels.index(label), frfs.references.labels.index(label)
    values: AnyArray = frfs.receptances[:, o, i]
    return values if np.isfinite(values).any() else None


def _as_measured(case: Case, label: str) -> list[float | None] | None:
    """Return the measured receptance in dB on the axis of all curves; None where there is none.

    Between two points of the axis the largest line counts, so that no resonance is lost.
    """
    values = _point_response(case, label)
    if values is None or case.frfs is None:
        return None
    hz, axis = case.frfs.frequencies, frequency_axis(case)
    levels = 20.0 * np.log10(np.maximum(np.abs(values), 1e-300))
    known = np.isfinite(levels)
    hz, levels = hz[known], levels[known]
    found = np.interp(axis, hz, levels, left=np.nan, right=np.nan)
    nearest = np.rint((hz - axis[0]) / (axis[1] - axis[0])).astype(int)
    there = (nearest >= 0) & (nearest < len(axis))
    held = np.full(len(axis), -np.inf)
    np.maximum.at(held, nearest[there], levels[there])
    found = np.where(np.isfinite(held), held, found)
    return [None if np.isnan(level) else round(float(level), 1) for level in found]


def _stand_in(
    case: Case,
    nominal: Model,
    data: Measurement,
    drive: Sensors,
    pairing: Pairing,
    at_sensors: FloatArray,
) -> list[float]:
    modes = modes_of(nominal)
    elastic = np.flatnonzero(~modes.rigid)
    readings = np.asarray(nominal.observe(drive) @ modes.shapes)[0]
    eigenvalues = modes.eigenvalues.copy()
    row = data.sensors.labels.index(drive.labels[0])
    for k, partner in enumerate(pairing.index):
        shape = data.shapes[:, k]
        if partner < 0 or not np.isfinite(shape[row]):
            continue
        own = elastic[partner]
        there = np.isfinite(shape)
        scale = modal_scale_factor(at_sensors[there, partner], shape[there])
        readings[own] = float(np.real(scale).item()) * shape[row]
        eigenvalues[own] = data.eigenvalues[k]
    seen = readings[None]
    damping = case.measurement.usual_damping
    return _decibels(modal_sum(eigenvalues, seen, seen, frequency_axis(case), damping))


def round_values(values: Any) -> Any:  # noqa: ANN401 - arrays of any shape
    """Return numbers of an array as nested lists with four digits; None where there is none."""
    array = np.asarray(values, dtype=float)
    if array.ndim:
        return [round_values(item) for item in array]
    number = float(array)
    return float(f"{number:.{DIGITS}g}") if np.isfinite(number) else None


def node_motions(
    model: Model, nominal: Model, shapes: FloatArray, nodes: IntArray | None = None
) -> FloatArray:
    """Return the displacements of the nodes of a picture, (k, 3, m).

    Arguments:
        shapes: on the dofs of `model`, (n, m).
        nodes: of a frame, those that are drawn by their numbers, (k,); None for all.

    Raises:
        ModelError: when a node lies off the structure of `model`.
    """
    xyz = node_positions(nominal)
    xyz = xyz if nodes is None else xyz[nodes]
    motion = np.zeros((len(xyz), 3, shapes.shape[1]))
    if nominal.structure is None:
        present = np.unique(nominal.dofs.node)
        for row, (node, name) in enumerate(zip(model.dofs.node, model.dofs.direction, strict=True)):
            if name in "xyz":
                motion[np.searchsorted(present, node), "xyz".index(name)] += shapes[row]
        return motion
    for name in _AXES[nominal.structure.frame.plane]:
        labels = tuple(str(i) for i in range(len(xyz)))
        sensors = Sensors(labels, xyz, (name,) * len(xyz))
        motion[:, "xyz".index(name)] = model.observe(sensors) @ shapes
    return motion


def drive_sensor(case: Case) -> str | None:
    """Return the displacement sensor that sees all used modes best; None without shapes.

    Where a force was measured at some sensors, it is one of them.
    """
    sensors = case.measurement.sensors
    moves = np.flatnonzero(["r" not in direction for direction in sensors.directions])
    shapes = np.abs(case.measurement.select(case.used).shapes)[moves]
    shapes = shapes[:, np.isfinite(shapes).any(axis=0)]
    if shapes.size == 0:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = np.log(shapes / np.nanmax(shapes, axis=0)).sum(axis=1)
    driven = [_point_response(case, sensors.labels[k]) is not None for k in moves]
    if any(driven):
        seen = np.where(driven, seen, -np.inf)
    best = int(np.argmax(np.where(np.isfinite(seen), seen, -np.inf)))
    return sensors.labels[int(moves[best])]


def measured_blocks(case: Case) -> list[tuple[str, str | None, Measurement]]:
    """Return the measured modes by block and modification."""
    tested = case.measurement
    blocks: list[tuple[str, str | None, Measurement]] = [
        ("used", None, tested.select(case.used)),
        ("higher", None, tested.select(case.held_out)),
    ]
    blocks += [("modified", change.name, change.measurement) for change in case.modifications]
    return [block for block in blocks if len(block[2])]


def _measured(case: Case) -> Sequence[Mapping[str, Any]]:
    return [
        {
            "mode": number,
            "block": block,
            "modification": change,
            "hz": round_values(data.frequencies[k]) and float(data.frequencies[k]),
            "shape": round_values(_unit(data.shapes[:, k])),
        }
        for block, change, data in measured_blocks(case)
        for k, number in enumerate(data.numbers)
    ]


def _unit(shape: FloatArray) -> FloatArray:
    """Return a shape whose largest component is 1 or -1."""
    largest = np.nanmax(np.abs(shape)) if np.isfinite(shape).any() else 0.0
    return np.asarray(shape / largest if largest > 0.0 else shape)


def keep_drawings(exhibits: Exhibits, cases: Iterable[Case]) -> None:
    """Keep what is drawn of cases and their nominal models; no picture is worth a run."""
    exhibits.tidy()
    for case in cases:
        if exhibits.has_case(case.digest):
            continue
        with suppress(Exception), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            drawing = case_drawing(case)
            if drawing is not None:
                more = {
                    "receptance": list_receptances(case),
                    "nominal": exhibit_of(case, case.model),
                }
                exhibits.put_case(case.digest, {**drawing, **more})
