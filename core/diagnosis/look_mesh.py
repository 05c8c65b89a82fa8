"""Whether the mesh is fine enough, and by how much its frequencies are off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femubench.core.diagnosis.look_modes import (
    SOLVED_LIMIT,
    Seen,
    elastic_modes,
    frequency_changes,
    percent,
)
from femubench.core.diagnosis.result import LookWarning
from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame, Place, Support
from femubench.core.fem.structure import Structure
from femubench.core.modal.eigen import Modes
from femubench.core.modal.kept import once_for
from femubench.core.model import Model, common_dofs
from femubench.core.typing import FloatArray

_NOTABLE = 0.001
_NOTABLE_DEVIATIONS = 0.5
_UNEQUAL = 20.0  # ratio of the lengths of neighbours
_MARGIN = 4


def refined(structure: Structure) -> Frame:
    """Return the frame with every element cut in two, with all the rest of it as it was.

    The flexible part of an element is halved. Labels `member/k` keep their meaning, so factors
    and parameter changes need no translation.
    """
    frame, mesh = structure.frame, structure.mesh
    length = np.linalg.norm(mesh.xyz[mesh.ends[:, 1]] - mesh.xyz[mesh.ends[:, 0]], axis=1)
    rigid = np.maximum(np.maximum(mesh.rigid, mesh.rigid_mass), 0.0) / length[:, None]
    low = mesh.stations[:, 0] + rigid[:, 0] * np.ptp(mesh.stations, axis=1)
    high = mesh.stations[:, 1] - rigid[:, 1] * np.ptp(mesh.stations, axis=1)
    cuts = [
        # A support that holds nothing: where one is, the mesh has a node.
        Support(Place(member=frame.members[m].name, s=float(s)), ())
        for m, s, arm in zip(mesh.member, 0.5 * (low + high), mesh.arm_factor, strict=True)
        if np.isnan(arm)
    ]
    return replace(frame, supports=(*frame.supports, *cuts))


def _fine(model: Model) -> Model:
    structure = model.frame_structure
    return Model.of(structure.rebuilt(refined(structure)))


def mesh_bias(model: Model, count: int, modes: Modes | None = None) -> FloatArray | None:
    """Return f_fine / f - 1 of the first elastic modes on a mesh twice as fine, (k,), k <= count.

    Modes are paired by shape. None without a frame, beyond 5000 dofs, and where the finer mesh
    cannot be built or solved.

    Arguments:
        model: any model.
        count: number of modes wanted.
        modes: elastic modes of the model where they are at hand, at least `count`.
    """
    if model.structure is None or model.size > SOLVED_LIMIT:
        return None
    try:
        coarse = elastic_modes(model, count + _MARGIN) if modes is None else modes
        fine = once_for(model, "fine", lambda: _fine(model))
        keep = common_dofs(model.structure, fine.frame_structure)
        return frequency_changes(model, coarse, fine, count, lambda shapes: shapes[keep])
    except ModelError:
        return None


def look_at_mesh(seen: Seen) -> list[LookWarning]:
    """Return what a finer mesh changes, and elements that do not fit their neighbours."""
    found = _unequal(seen.model.frame_structure)
    changes = mesh_bias(seen.model, seen.count, seen.modes)
    if changes is None or len(changes) == 0:
        return found
    if seen.exceeds(changes, _NOTABLE, _NOTABLE_DEVIATIONS):
        worst = int(np.abs(changes).argmax())
        what = (
            f"The mesh is coarse: with every element cut in two, mode {worst + 1} changes by "
            f"{100.0 * changes[worst]:+.2g} %."
        )
        found.append(LookWarning(what, "all", "", percent(changes)))
    return found


def _unequal(structure: Structure) -> list[LookWarning]:
    """Return the worst pair of elements at one node whose lengths are out of proportion."""
    mesh = structure.mesh
    rows = np.flatnonzero(np.isnan(mesh.arm_factor))
    length = structure.properties.length[rows]
    nodes, element = mesh.ends[rows].ravel(), np.repeat(np.arange(len(rows)), 2)
    shortest, longest = np.full(len(mesh.xyz), np.inf), np.zeros(len(mesh.xyz))
    np.minimum.at(shortest, nodes, length[element])
    np.maximum.at(longest, nodes, length[element])
    ratio = np.where(longest > 0.0, longest / shortest, 0.0)
    worst = int(ratio.argmax())
    if ratio[worst] <= _UNEQUAL:
        return []
    at_node = element[nodes == worst]
    short, long = at_node[length[at_node].argmin()], at_node[length[at_node].argmax()]
    labels = [structure.labels[rows[k]] for k in (short, long)]
    what = (
        f"Element {labels[0]} is {ratio[worst]:.3g} times shorter than its neighbour {labels[1]} "
        f"({length[short]:.3g} m and {length[long]:.3g} m)."
    )
    return [LookWarning(what, labels[0], "")]
