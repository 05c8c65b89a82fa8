"""Whether the mesh is fine enough, and its elements fit each other."""

from __future__ import annotations

import numpy as np

from femubench.core.fem.structure import Structure
from femubench.core.fit.mesh_error import mesh_bias
from femubench.core.inference.settings import settings
from femubench.core.look.modes import Seen, percent
from femubench.core.schema.diagnosis import LookWarning


def look_at_mesh(seen: Seen) -> list[LookWarning]:
    """Return what a finer mesh changes, and elements that do not fit their neighbours."""
    structure = seen.model.structure
    found = [] if structure is None else _unequal(structure)
    changes = mesh_bias(seen.model, seen.count, seen.modes)
    if changes is None or len(changes) == 0:
        return found
    if seen.exceeds(changes, settings.notable_mesh, settings.telling_deviations):
        worst = int(np.abs(changes).argmax())
        finer = "every element cut in two" if structure else "elements that bend along their edges"
        what = (
            f"The mesh is coarse: with {finer}, mode {worst + 1} changes by "
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
    if ratio[worst] <= settings.unequal_elements:
        return []
    at_node = element[nodes == worst]
    short, long = at_node[length[at_node].argmin()], at_node[length[at_node].argmax()]
    labels = [structure.labels[rows[k]] for k in (short, long)]
    what = (
        f"Element {labels[0]} is {ratio[worst]:.3g} times shorter than its neighbour {labels[1]} "
        f"({length[short]:.3g} m and {length[long]:.3g} m)."
    )
    return [LookWarning(what, labels[0], "")]
