"""Read the matrices of Ansys's .full files through ansys-mapdl-reader, in a process of its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import scipy.sparse as sp

from femubench import InputError
from femubench.plugins.readers.apart import apart
from femubench.plugins.readers.reading import ProgramReader, directions, needs

if TYPE_CHECKING:
    from femubench import Model
    from femubench.fem import SparseArray


class AnsysReader(ProgramReader):
    """Reads stiffness and mass of a .full file without what is held; nodes of a .rst file.

    Coordinates come from the results of the job: ``dofs = "file.rst"``.
    """

    name: str = "Ansys"
    suffixes: tuple[str, ...] = (".full", ".rst")

    def read_matrix(self, path: Path) -> SparseArray:
        """Refuse: a .full file has two matrices."""
        raise InputError("two matrices", file=path, expected='kind = "file"')

    def read_model(self, path: Path) -> Model:
        """Return mass and stiffness by node and direction; raises InputError."""
        from femubench.fem import matrix_model

        needs("ansys", "ansys", path)
        found = apart(full_file, path, "a .full file with stiffness and mass")
        numbers = found["node"].tolist()
        along = directions(found["dof"].tolist(), path)
        return matrix_model(found["mass"], found["stiffness"], numbers, along)

    def read_nodes(self, path: Path) -> Mapping[str, list[float]]:
        """Return the nodes of a .rst file; raises InputError."""
        needs("ansys", "ansys", path)
        found = apart(rst_file, path, "a .rst file with nodes")
        return dict(zip(map(str, found["node"].tolist()), found["xyz"].tolist(), strict=True))

    def write_model(self, model: Model, path: Path, original: Path) -> NoReturn:
        """Refuse: nothing but Ansys writes .full files."""
        what = "a .full file is written by Ansys alone"
        expected = "a case with stiffness.mtx and mass.mtx, which *SMAT,K,D,IMPORT,MMF reads"
        raise InputError(what, file=path, expected=expected)


def full_file(path: Path) -> dict[str, Any]:
    """Return node, dof (from 1) and both matrices of the free rows of a .full file."""
    from ansys.mapdl.reader.common import read_table
    from ansys.mapdl.reader.full import FullFile

    file: Any = FullFile(str(path))
    rows, stiffness, mass = file.load_km(as_sparse=True, sort=False)
    with path.open("rb") as stream:
        read_table(stream, skip=True)
        read_table(stream, skip=True)
        listed = np.asarray(read_table(stream))
    counts = np.unique(np.asarray(file.ndof))
    # A row tells its place among the directions of its node, which is known where all are alike.
    if (len(counts) > 1 or counts[0] != len(listed)) and not (np.diff(listed) == 1).all():
        raise ValueError("nodes with different directions")
    held = {(int(node), int(dof)) for node, dof in file.const}
    free = np.array([(int(node), int(dof)) not in held for node, dof in rows])
    found: dict[str, Any] = {"node": rows[free, 0], "dof": listed[rows[free, 1]]}
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        upper = sp.csc_array(matrix)[free][:, free]
        found[name] = sp.csc_array(upper + sp.triu(upper, 1).T)
    return found


def rst_file(path: Path) -> dict[str, Any]:
    """Return number and place of every node of a .rst file."""
    from ansys.mapdl.reader import read_binary

    results: Any = read_binary(str(path))
    mesh = results.mesh
    return {"node": np.asarray(mesh.nnum), "xyz": np.asarray(mesh.nodes)[:, :3]}
