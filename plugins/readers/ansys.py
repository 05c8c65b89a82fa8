"""Read the matrices of Ansys's .full files through ansys-mapdl-reader, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import scipy.sparse as sp

from femubench import InputError, Model
from femubench.fem import SparseArray, matrix_model
from femubench.plugins.readers.reading import directions, needs, no_modes

_PACKAGE = "ansys.mapdl.reader"
_MEMORY = 3 * 2**29  # bytes of address space of the process, the libraries among them
_PER_BYTE, _SECONDS = 32, 300


class AnsysReader:
    """Reads stiffness and mass of a .full file without what is held; nodes of a .rst file.

    The library trusts the numbers of a file: what it does with a broken one, up to a crash,
    stays in a process of its own.
    """

    name: str = "Ansys"
    suffixes: tuple[str, ...] = (".full", ".rst")

    def read_matrix(self, path: Path) -> SparseArray:
        """Refuse: a .full file has two matrices."""
        raise InputError("two matrices", file=path, expected='kind = "file"')

    def read_model(self, path: Path) -> Model:
        """Return mass and stiffness by node and direction; raises InputError."""
        found = _apart("full_file", path, "a .full file with stiffness and mass")
        numbers = found["node"].tolist()
        along = directions(found["dof"].tolist(), path)
        n = len(numbers)
        mass, stiffness = (
            sp.csc_array(tuple(found[f"{name}.{part}"] for part in _PARTS), shape=(n, n))
            for name in ("mass", "stiffness")
        )
        return matrix_model(mass, stiffness, numbers, along)

    def read_nodes(self, path: Path) -> Mapping[str, list[float]]:
        """Return the nodes of a .rst file; raises InputError."""
        found = _apart("rst_file", path, "a .rst file with nodes")
        return dict(zip(map(str, found["node"].tolist()), found["xyz"].tolist(), strict=True))

    def read_modes(self, path: Path) -> NoReturn:
        """Refuse: results of Ansys are no measured modes."""
        no_modes(path, "a file of Ansys")

    def write_model(self, model: Model, path: Path, original: Path) -> NoReturn:
        """Refuse: nothing but Ansys writes .full files."""
        what = "a .full file is written by Ansys alone"
        expected = "a case with stiffness.mtx and mass.mtx, which *SMAT,K,D,IMPORT,MMF reads"
        raise InputError(what, file=path, expected=expected)


_PARTS = ("data", "indices", "indptr")


def _apart(what: str, path: Path, expected: str) -> dict[str, Any]:
    """Return what a function of this module gives, called in a process of its own."""
    needs("ansys", "ansys", path)
    memory = _MEMORY + _PER_BYTE * path.stat().st_size
    code = f"from {__name__} import in_child; in_child({what!r}, {str(path)!r}, {memory})"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.npz"
        code = f"{code[:-1]}, {str(result)!r})"
        try:
            done = subprocess.run(
                [sys.executable, "-c", code],
                env={**environment, "OPENBLAS_NUM_THREADS": "1"},
                capture_output=True,
                check=False,
                timeout=_SECONDS,
            )
        except subprocess.TimeoutExpired:
            what = f"takes more than {_SECONDS} s"
            raise InputError(what, file=path, expected=expected) from None
        if done.returncode or not result.is_file():
            told = done.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
            raise InputError(f"cannot be read: {told or 'broken'}", file=path, expected=expected)
        with np.load(result) as archive:
            return dict(archive)


def in_child(what: str, path: str, memory: int, result: str) -> None:
    """Call a function of this module with limits, and store what it returns."""
    try:
        import resource
    except ImportError:  # there are no such limits on Windows
        pass
    else:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    np.savez(result, **{"full_file": full_file, "rst_file": rst_file}[what](path))


def full_file(path: str) -> dict[str, Any]:
    """Return node, dof (from 1) and both matrices of the free rows of a .full file."""
    from ansys.mapdl.reader.common import read_table
    from ansys.mapdl.reader.full import FullFile

    file = FullFile(path)
    rows, stiffness, mass = file.load_km(as_sparse=True, sort=False)
    with Path(path).open("rb") as stream:
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
        whole = sp.csc_array(upper + sp.triu(upper, 1).T)
        found |= {f"{name}.{part}": getattr(whole, part) for part in _PARTS}
    return found


def rst_file(path: str) -> dict[str, Any]:
    """Return number and place of every node of a .rst file."""
    from ansys.mapdl.reader import read_binary

    mesh = read_binary(path).mesh
    return {"node": np.asarray(mesh.nnum), "xyz": np.asarray(mesh.nodes)[:, :3]}
