"""The stage of a case: its structure, sensors and measured modes, for drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from femubench.core.case.case import Case
from femubench.core.fem.mesh import place_xyz
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.fem.structure import Structure
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import FloatArray

MOST_NODES = 3000  # more are no picture, and too much to keep for every job
DIGITS = 4
_AXES = {"in-plane": ("x", "z"), "out-of-plane": ("z",), "3d": ("x", "y", "z")}


def rounded(values: Any) -> Any:  # noqa: ANN401 - arrays of any shape
    """Return numbers of an array as nested lists with four digits; None where there is none."""
    array = np.asarray(values, dtype=float)
    if array.ndim:
        return [rounded(item) for item in array]
    number = float(array)
    return float(f"{number:.{DIGITS}g}") if np.isfinite(number) else None


def stage_of(case: Case) -> dict[str, Any] | None:
    """Return the structure of a case and what was measured on it, in plain data.

    Arguments:
        case: its nominal model gives the picture.

    Returns None for a model that is too large to draw.
    """
    model = case.model
    xyz = node_positions(model)
    if len(xyz) > MOST_NODES:
        return None
    structure = model.structure
    parts = _frame_parts(structure) if structure is not None else _bare_parts(model)
    return {
        **parts,
        "nodes": rounded(xyz),
        "sensors": _sensors(case.measurement.sensors),
        "measured": list(_measured(case)),
        "drive": drive_sensor(case),
    }


def node_positions(model: Model) -> FloatArray:
    """Return where the nodes of a picture are in m: those of the mesh, or of the dofs, (k, 3)."""
    if model.structure is not None:
        mesh = model.structure.mesh
        return np.asarray(np.delete(mesh.xyz, mesh.oscillators, axis=0))
    first = np.unique(model.dofs.node, return_index=True)[1]
    return np.asarray(model.dofs.xyz[first])


def node_motions(model: Model, nominal: Model, shapes: FloatArray) -> FloatArray:
    """Return the displacements of the nodes of a picture, (k, 3, m).

    Arguments:
        model: whose shapes they are.
        nominal: whose nodes are drawn.
        shapes: on the dofs of `model`, (n, m).

    Raises:
        ModelError: when a node lies off the structure of `model`.
    """
    xyz = node_positions(nominal)
    motion = np.zeros((len(xyz), 3, shapes.shape[1]))
    if nominal.structure is None:
        nodes = np.unique(nominal.dofs.node)
        for row, (node, name) in enumerate(zip(model.dofs.node, model.dofs.direction, strict=True)):
            if name in "xyz":
                motion[np.searchsorted(nodes, node), "xyz".index(name)] += shapes[row]
        return motion
    for name in _AXES[nominal.structure.frame.plane]:
        labels = tuple(str(i) for i in range(len(xyz)))
        sensors = Sensors(labels, xyz, (name,) * len(xyz))
        motion[:, "xyz".index(name)] = model.observe(sensors) @ shapes
    return motion


def drive_sensor(case: Case) -> str | None:
    """Return the displacement sensor that sees all used modes best; None without shapes."""
    sensors = case.measurement.sensors
    moves = np.flatnonzero(["r" not in direction for direction in sensors.directions])
    shapes = np.abs(case.measurement.select(case.used).shapes)[moves]
    shapes = shapes[:, np.isfinite(shapes).any(axis=0)]
    if shapes.size == 0:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = np.log(shapes / np.nanmax(shapes, axis=0)).sum(axis=1)
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
            "hz": rounded(data.frequencies[k]) and float(data.frequencies[k]),
            "shape": rounded(_unit(data.shapes[:, k])),
        }
        for block, change, data in measured_blocks(case)
        for k, number in enumerate(data.numbers)
    ]


def _unit(shape: FloatArray) -> FloatArray:
    """Return a shape whose largest component is 1 or -1."""
    largest = np.nanmax(np.abs(shape)) if np.isfinite(shape).any() else 0.0
    return np.asarray(shape / largest if largest > 0.0 else shape)


def _sensors(sensors: Sensors) -> list[dict[str, Any]]:
    rows = zip(sensors.labels, sensors.xyz, sensors.axes, sensors.directions, strict=True)
    return [
        {
            "label": label,
            "xyz": rounded(xyz),
            "axis": rounded(axes[3:] if "r" in direction else axes[:3]),
            "rotation": "r" in direction,
        }
        for label, xyz, axes, direction in rows
    ]


def _bare_parts(model: Model) -> dict[str, Any]:
    nothing: dict[str, Any] = {
        name: []
        for name in (
            *("elements", "element_labels", "member_of", "members", "joints"),
            *("masses", "springs", "supports"),
        )
    }
    return {"plane": "matrices", **nothing}


def _frame_parts(structure: Structure) -> dict[str, Any]:
    frame, mesh = structure.frame, structure.mesh
    kept = np.full(len(mesh.xyz), -1)
    stays = np.setdiff1d(np.arange(len(mesh.xyz)), mesh.oscillators)
    kept[stays] = np.arange(len(stays))
    return {
        "plane": frame.plane,
        "elements": kept[mesh.ends].tolist(),
        "element_labels": list(structure.labels),
        "member_of": mesh.member.tolist(),
        "members": [member.name for member in frame.members],
        "joints": [
            {"name": joint.name, "type": joint.type, "node": k}
            for k, joint in enumerate(frame.joints)
        ],
        "masses": [
            {"xyz": rounded(place_xyz(frame, mass.at)), "kg": mass.mass} for mass in frame.masses
        ],
        "springs": [
            {
                "xyz": rounded(place_xyz(frame, spring.at)),
                "axis": [float(name == spring.direction.lstrip("+-")[-1]) for name in "xyz"],
                "rotation": "r" in spring.direction,
                "stiffness": spring.stiffness,
            }
            for spring in frame.springs
        ],
        "supports": [
            {"xyz": rounded(place_xyz(frame, support.at)), "fixed": list(support.fixed)}
            for support in frame.supports
        ],
    }


def highest_measured(case: Case) -> float:
    """Return the highest measured frequency in Hz, of the structure as tested and modified."""
    found = chain.from_iterable(data.frequencies for _, _, data in measured_blocks(case))
    return float(max(found, default=0.0))


def node_labels(model: Model) -> list[str]:
    """Return a name for every node that has dofs: a joint's, a member's with its place, or a row's.

    Arguments:
        model: the nodes are counted as in `Dofs.node`, without gaps.
    """
    present = np.unique(model.dofs.node)
    if model.structure is None:
        names = getattr(model.geometry, "names", ())
        return [str(names[k]) if k < len(names) else str(k) for k in present]
    frame, mesh = model.structure.frame, model.structure.mesh
    found = {k: joint.name for k, joint in enumerate(frame.joints)}
    for member, ends, stations in zip(mesh.member, mesh.ends, mesh.stations, strict=True):
        for node, station in zip(ends, stations, strict=True):
            found.setdefault(int(node), f"{frame.members[member].name}@{station:.3g}")
    return [found.get(int(node), str(node)) for node in present]
