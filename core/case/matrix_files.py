"""The matrices of a model as files: Matrix Market, the table of their dofs, groups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from os import PathLike
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from femubench.core.case.faults import BadKey
from femubench.core.case.frame_keys import Keys
from femubench.core.case.nodes import DOF_COLUMNS, INTERNAL, MatrixGeometry
from femubench.core.case.table_text import csv_bytes, number
from femubench.core.errors import InputError
from femubench.core.fem.frame import Place
from femubench.core.fem.group_factors import PRELOAD, SET
from femubench.core.fem.kinematics import node_at
from femubench.core.fem.mesh import SAME_STATION
from femubench.core.fem.model import LowRank, Model
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.fem.structure import Structure
from femubench.core.files import make_folder, write_atomically
from femubench.core.typing import SparseArray

Files = dict[str, bytes]
_MOST_DENSE = 4_000  # dofs; a low-rank change fills the whole matrix


def matrix_market(matrix: SparseArray) -> bytes:
    """Return a symmetric matrix as Matrix Market text in full double precision.

    Arguments:
        matrix: sparse or dense, (n, n).
    """
    import scipy.io

    stream = BytesIO()
    # The shortest text that reads back to the same number is the writer's default.
    scipy.io.mmwrite(stream, sp.coo_array(matrix), symmetry="symmetric")
    return stream.getvalue()


def matrices_of(model: Model) -> tuple[SparseArray, SparseArray]:
    """Return mass and stiffness with low-rank changes multiplied out, sparse (n, n) each.

    Raises:
        BadKey: when that would fill a large matrix.
    """
    pairs = ((model.mass, model.mass_change), (model.stiffness, model.stiffness_change))
    mass, stiffness = (_whole(matrix, change) for matrix, change in pairs)
    return mass, stiffness


def _whole(matrix: SparseArray, change: LowRank | None) -> SparseArray:
    if change is not None:
        if matrix.shape[0] > _MOST_DENSE:
            what = f"a low-rank change of {matrix.shape[0]} degrees of freedom has no sparse matrix"
            raise BadKey(("model",), what, f"at most {_MOST_DENSE}")
        matrix = sp.csc_array(matrix).toarray() + change.toarray()
    matrix = sp.csc_array(matrix)
    return sp.csc_array(0.5 * (matrix + matrix.T))


def frame_files(model: Model) -> Files:
    """Return the files that show a frame model to other programs, in a folder of their own.

    `dofs.csv` names directions; those of a flexible connection of a skew member lie along the
    member, and then `axes.csv` has the unit motion of every dof.
    """
    files = _three(model.mass, model.stiffness, frame_geometry(model))
    axes = model.dofs.axes
    if axes is not None and has_skew_dofs(model):
        rows = [[i + 1, *(number(v) for v in row)] for i, row in enumerate(axes)]
        files["axes.csv"] = csv_bytes(["row", *DIRECTIONS], rows)
    return {f"matrices/{name}": content for name, content in files.items()}


def _three(mass: SparseArray, stiffness: SparseArray, geometry: MatrixGeometry) -> Files:
    matrices = {"mass.mtx": matrix_market(mass), "stiffness.mtx": matrix_market(stiffness)}
    return {**matrices, "dofs.csv": dofs_csv(geometry)}


def has_skew_dofs(model: Model) -> bool:
    """Tell whether a dof moves along another direction than the one that it is named after."""
    dofs = model.dofs
    if dofs.axes is None:
        return False
    moved = ~dofs.internal
    named = np.eye(6)[[DIRECTIONS.index(dofs.direction[i]) for i in np.flatnonzero(moved)]]
    return not np.array_equal(dofs.axes[moved], named)


def frame_geometry(model: Model) -> MatrixGeometry:
    """Return the dofs of a frame model under readable node names.

    Joints keep their names, other nodes are ``member 0.25`` after their station, ``member 0.02
    arm`` at the tip of a joint's arm, ``oscillator 1``.
    """
    structure = model.frame_structure
    names = node_names(structure)
    used = list(dict.fromkeys(int(node) for node in model.dofs.node))
    index = {node: i for i, node in enumerate(used)}
    nodes = np.array([index[int(node)] for node in model.dofs.node], dtype=np.int64)
    dofs = replace(model.dofs, node=nodes, axes=None)
    return MatrixGeometry(tuple(names[node] for node in used), dofs)


def node_names(structure: Structure) -> list[str]:
    """Return a name of its own for every node of the mesh."""
    frame = structure.frame
    names: dict[str, None] = {}
    for part, where, arm in structure.mesh.node_keys(len(frame.joints)):
        if part == -1:
            name = frame.joints[where].name
        elif part == -2:
            name = f"oscillator {where + 1}"
        else:
            name = f"{frame.members[part].name} {where * SAME_STATION:g}" + (" arm" if arm else "")
        free, count = name, 1
        while free in names:
            count += 1
            free = f"{name} ({count})"
        names[free] = None
    return list(names)


def frame_places(model: Model, places: Sequence[Place]) -> dict[Place, Place]:
    """Return the nodes, by name, at places of a frame; raises BadKey for a place between nodes."""
    structure = model.frame_structure
    names, found = node_names(structure), {}
    for place in places:
        node = node_at(structure.frame, structure.mesh, place)
        if node is None:
            what = f"the model has changed matrices and no node at {place}"
            expected = "`elements` with a node at every sensor and attachment, or a strategy that "
            raise BadKey(("model", "members"), what, f"{expected}scales parameters")
        found[place] = Place(joint=names[node])
    return found


def dofs_csv(geometry: MatrixGeometry) -> bytes:
    """Return the table row,node,direction,x,y,z, nodes in the order of their names."""
    dofs, internal = geometry.dofs, geometry.dofs.internal
    marked, order = bool(internal.any()), np.arange(len(dofs))
    if np.any(np.diff(np.unique(dofs.node, return_index=True)[1]) <= 0):
        order = np.argsort(dofs.node, kind="stable")  # nodes by their numbers
    rows = [
        [
            int(i) + geometry.first_row,
            geometry.names[dofs.node[i]],
            dofs.direction[i],
            *(number(v) for v in dofs.xyz[i]),
            *([int(internal[i])] if marked else []),
        ]
        for i in order
    ]
    return csv_bytes([*DOF_COLUMNS, *([INTERNAL] if marked else [])], rows)


def matrix_keys(
    mass: SparseArray, stiffness: SparseArray, geometry: MatrixGeometry, model: Model
) -> tuple[Keys, Files]:
    """Return the table `[model]` of a pair of matrices, and the files that it names.

    Arguments:
        mass, stiffness: sparse, (n, n).
    """
    files = _three(mass, stiffness, geometry)
    keys: Keys = {"kind": "matrices", **{file.partition(".")[0]: file for file in files}}
    tables = []
    preloads = {
        place.removeprefix(PRELOAD): own[1][0]
        for place, own in model.powers.items()
        if place.startswith(PRELOAD)
    }
    names = dict.fromkeys((*model.groups, *model.mass_groups, *preloads))
    for i, name in enumerate(names, start=1):
        table: Keys = {"name": name}
        for key, suffix, parts in (
            ("stiffness", "", {**model.groups, **preloads}),
            ("mass", "-mass", model.mass_groups),
        ):
            if name in parts:
                table[key] = f"group-{i}{suffix}.mtx"
                files[table[key]] = matrix_market(parts[name])
        if name in model.group_priors:
            table["prior"] = float(model.group_priors[name])
        if kind := "preload" if name in preloads else model.group_kinds.get(name):
            table["kind"] = kind
        tables.append(table)
    kept = {w: own for w, own in model.families.items() if w.startswith(SET) or own[1:]}
    families = {word.partition(":")[2]: own for word, own in kept.items()}
    sets = [{"name": name, "groups": [*own]} for name, own in families.items()]
    listed: Keys = {"groups": tables, "sets": sets}
    return keys | {key: found for key, found in listed.items() if found}, files


def write_matrices(model: Model, folder: str | PathLike[str]) -> tuple[Path, ...]:
    """Write a model as the files of a case: `mass.mtx`, `stiffness.mtx`, `dofs.csv`, groups.

    ``bench init`` makes a case of them and of what was measured.

    Arguments:
        model: any model; of a frame the nodes between joints get names of their own.
        folder: made where it is not there; files of these names are written anew.

    Raises:
        InputError: when nothing can be written there, or a degree of freedom has no direction
            that a table could name.

    Examples:
        >>> [path.name for path in fem.write_matrices(model, "matrices")]
        ['mass.mtx', 'stiffness.mtx', 'dofs.csv']
    """
    place = Path(folder)
    if has_skew_dofs(model):
        raise InputError("the model has degrees of freedom of skew members", file=place)
    geometry = model.geometry
    if not isinstance(geometry, MatrixGeometry):
        geometry = frame_geometry(model)
    try:
        files = matrix_keys(*matrices_of(model), geometry, model)[1]
    except BadKey as fault:
        raise InputError(fault.what, file=place, expected=fault.expected) from None
    make_folder(place)
    for name, content in files.items():
        write_atomically(place / name, content)
    return tuple(place / name for name in files)
