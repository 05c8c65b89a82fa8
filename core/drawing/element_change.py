"""How much a strategy changed each element, or, where it works by entries, which of them."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.typing import FloatArray

_TURNS = np.tile([False, False, False, True, True, True], 2)
_MOST_DOFS = 3000  # a dense difference of more is no picture
_CELLS = 64
_LEVELS = 254
_DECADES = 4.0
_NOTHING = 1e-12  # of the stiffness itself: rounding of the assembly


def relative_changes(nominal: Model, updated: Model) -> list[float | None] | None:
    """Return |dK_e| / |K0_e| of every element of the nominal frame, (n_elements,).

    Frobenius norms, rotations times the element's length, so that all entries have one unit.

    Arguments:
        nominal, updated: models of the same frame; the second may be meshed anew.

    Returns None where the change is none of elements.
    """
    structure = nominal.structure
    if structure is None or updated.structure is None:
        return None
    before = _scaled(structure, structure.properties.stiffness_matrices())
    size = np.linalg.norm(before, axis=(1, 2))
    after = _scaled(updated.structure, updated.structure.properties.stiffness_matrices())
    place = {label: k for k, label in enumerate(updated.structure.labels) if label}
    rows = [place.get(label) for label in structure.labels]
    found = np.array(
        [np.nan if k is None else np.linalg.norm(after[k] - before[e]) for e, k in enumerate(rows)]
    )
    if not (np.nanmax(found, initial=0.0) > _NOTHING * size.max() or _as_assembled(updated)):
        return None
    return [
        None if row is None or not norm > 0.0 else float(f"{part / norm:.4g}")
        for part, norm, row in zip(found, size, rows, strict=True)
    ]


def element_norms(structure: Structure, matrices: FloatArray) -> FloatArray:
    """Return Frobenius norms of local element matrices, rotations times the length, (n,).

    Arguments:
        structure: whose elements they belong to.
        matrices: (n, 12, 12).

    Examples:
        >>> results.element_norms(structure, properties.stiffness_matrices()).shape
        (28,)
    """
    return np.asarray(np.linalg.norm(_scaled(structure, matrices), axis=(1, 2)))


def _scaled(structure: Structure, matrices: FloatArray) -> FloatArray:
    scale = np.where(_TURNS, 1.0 / structure.properties.length[:, None], 1.0)
    scale = scale * structure.active_local
    return np.asarray(scale[:, :, None] * matrices * scale[:, None, :])


def _as_assembled(updated: Model) -> bool:
    """Tell whether the matrix of a model is that of its own structure."""
    assert updated.structure is not None
    if updated.stiffness_change is not None:
        return False
    own = updated.structure.matrices()[1]
    if own.shape != updated.stiffness.shape:
        return False
    return bool(abs(updated.stiffness - own).max() <= 1e-9 * abs(own).max())


def difference_picture(nominal: Model, updated: Model) -> dict[str, Any] | None:
    """Return |K - K0| between groups of nodes as a picture of at most 64 x 64 cells.

    Rotations count times the mean distance of neighbouring nodes, so that all entries are in N/m.
    A cell is the Frobenius norm of its block; values are levels of a logarithmic scale over four
    decades, 0 for nothing.

    Arguments:
        nominal, updated: on the same dofs.

    Returns None where nothing changed, or the models cannot be compared entry by entry.
    """
    size = nominal.size
    if updated.size != size or size > _MOST_DOFS:
        return None
    change = np.abs(stiffness_difference(nominal, updated))
    scale = _one_unit(nominal)
    nodes = np.unique(nominal.dofs.node, return_inverse=True)[1]
    count = int(nodes.max()) + 1
    cell = nodes * min(_CELLS, count) // count
    gather = np.zeros((int(cell.max()) + 1, size))
    gather[cell, np.arange(size)] = 1.0
    found = np.sqrt(gather @ np.square(change) @ gather.T)
    own = scale[:, None] * np.abs(nominal.stiffness.toarray()) * scale
    if not found.max() > _NOTHING * own.max():
        return None
    highest = float(np.log10(found.max()))
    lowest = highest - _DECADES
    with np.errstate(divide="ignore"):
        share = (np.log10(found) - lowest) / _DECADES
    levels = np.where(share > 0.0, 1 + np.round(_LEVELS * np.clip(share, 0.0, 1.0)), 0)
    names = _node_labels(nominal)
    first = [int(np.flatnonzero(cell[np.argsort(nodes)] == k)[0]) for k in range(len(found))]
    return {
        "size": len(found),
        "nodes": count,
        "labels": [names[int(np.sort(nodes)[row])] for row in first],
        "values": base64.b64encode(levels.astype(np.uint8).tobytes()).decode(),
        "lowest": round(lowest, 4),
        "highest": round(highest, 4),
        "unit": "N/m",
    }


def _node_labels(model: Model) -> list[str]:
    """Return a name for every node with dofs: a joint's, a member's with its place, a row's."""
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


def stiffness_difference(nominal: Model, updated: Model) -> FloatArray:
    """Return K0 - K with rotations times the mean element length: all entries in N/m, (n, n).

    Arguments:
        nominal, updated: small models on the same dofs.

    Examples:
        >>> results.stiffness_difference(model, result.model).shape
        (81, 81)
    """
    scale, unit = _one_unit(nominal), np.eye(nominal.size)
    change = nominal.stiffness_times(unit) - updated.stiffness_times(unit)
    return np.asarray(scale[:, None] * change * scale)


def _one_unit(model: Model) -> FloatArray:
    turns = np.array([name.startswith("r") for name in model.dofs.direction])
    if model.structure is not None:
        spacing = float(model.structure.properties.length.mean())
    else:
        xyz = np.unique(model.dofs.xyz, axis=0)
        extent = float(np.linalg.norm(np.ptp(xyz, axis=0)))
        spacing = extent / max(len(xyz) - 1, 1) or 1.0
    return np.where(turns, 1.0 / spacing, 1.0)
