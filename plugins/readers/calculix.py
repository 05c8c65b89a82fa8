"""Read and write the matrices that CalculiX stores: .sti, .mas, .dof, nodes from the .inp."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from femubench import InputError, Model
from femubench.fem import MatrixGeometry, SparseArray, matrix_model
from femubench.plugins.readers import nodes, solid_elements
from femubench.plugins.readers.reading import (
    DIRECTIONS,
    ProgramReader,
    columns_of,
    directions,
    lower_triangle,
    open_broken,
    symmetric,
    whole,
)
from femubench.plugins.readers.solid_deck import read_solids, write_factors

_KIND = "row, column, value as *FREQUENCY, SOLVER=MATRIXSTORAGE stores them"
_LABELS = "node.direction for every row, directions 1 to 6"
_MOST_ROWS = 1_000_000


class CalculixReader(ProgramReader):
    """Reads the job of an input file: job.sti, job.mas and job.dof next to job.inp.

    Files job_NAME.sti next to them are groups: the part NAME of the stiffness. Without these files
    the matrices are those of the elements of the input file, and its sets of elements are groups.
    """

    name: str = "CalculiX"
    suffixes: tuple[str, ...] = (".inp", ".sti", ".mas")

    def read_matrix(self, path: Path) -> SparseArray:
        """Return a matrix of .sti or .mas; raises InputError."""
        if path.suffix.lower() == ".inp":
            what = "an input file holds no matrix"
            raise InputError(what, file=path, expected="job.sti or job.mas")
        return _matrix(path, None)

    def read_model(self, path: Path) -> Model:
        """Return mass, stiffness, labels and groups of a job, without what is held."""
        if _is_deck(path):
            return read_solids(path)
        labels = _labels(path.with_suffix(".dof"))
        n = len(labels)
        places = nodes.read_nodes(path.with_suffix(".inp"))
        numbers, along = zip(*labels, strict=True)
        groups = {name: _matrix(file, n) for name, file in _groups(path).items()}
        mass, stiffness = (_matrix(path.with_suffix(s), n) for s in (".mas", ".sti"))
        xyz = np.array([places.get(number, (np.nan,) * 3) for number in numbers])
        added = np.isnan(xyz[:, 0])
        xyz = _with_inner_nodes(xyz, np.array(numbers), stiffness)
        return matrix_model(mass, stiffness, numbers, along, xyz, groups, internal=added)

    def model_files(self, path: Path) -> Sequence[Path]:
        """Return the files of a job in addition to the one named; raises InputError."""
        suffixes = (".inp",) if _is_deck(path) else (".inp", ".sti", ".mas", ".dof")
        job = [path.with_suffix(suffix) for suffix in suffixes]
        further = nodes.list_included(job[0])
        return tuple(f for f in (*job, *further, *_groups(path).values()) if f != path)

    def read_memory(self, path: Path) -> int | None:
        """Return the bytes that a deck takes, whose lines are full matrices of elements."""
        if not _is_deck(path):
            return None
        files = (path, *nodes.list_included(path))
        return solid_elements.BYTES * sum(file.stat().st_size for file in files)

    def read_nodes(self, path: Path) -> Mapping[str, nodes.Point]:
        """Return the nodes of an input file; raises InputError."""
        return nodes.read_nodes(path.with_suffix(".inp"))

    def write_model(self, model: Model, path: Path, original: Path) -> None:
        """Write .sti, .mas and .dof of an updated model next to each other, and its groups.

        Where the matrices came from a deck, and factors of its groups make the model: the deck.
        """
        if _is_deck(original) and write_factors(model, path, original):
            return
        geometry = model.geometry
        assert isinstance(geometry, MatrixGeometry)
        for suffix, matrix in ((".sti", model.stiffness), (".mas", model.mass)):
            _write(path.with_suffix(suffix), matrix)
        for name, part in model.groups.items():
            _write(path.with_name(f"{path.stem}_{name}.sti"), part)
        labels = [
            f"{geometry.names[node]}.{DIRECTIONS.index(direction) + 1}\n"
            for node, direction in zip(model.dofs.node, model.dofs.direction, strict=True)
        ]
        path.with_suffix(".dof").write_text("".join(labels))


def _is_deck(path: Path) -> bool:
    """Return whether an input file stands alone, without any matrix of its job."""
    own = (path.with_suffix(suffix) for suffix in (".sti", ".mas", ".dof"))
    return path.suffix.lower() == ".inp" and not any(file.exists() for file in own)


def _groups(path: Path) -> dict[str, Path]:
    """Return the files of parts of the stiffness by the names of the parts."""
    start = f"{path.stem}_"
    files = sorted(path.parent.glob("*.sti"))
    return {f.stem[len(start) :]: f for f in files if f.stem.startswith(start)}


def _labels(path: Path) -> list[tuple[str, str]]:
    """Return node and direction of every row."""
    found = []
    with open_broken(path, _LABELS):
        lines = path.read_text(encoding="latin-1").split()
    for number, line in enumerate(lines, start=1):
        node, _, direction = line.partition(".")
        if not (node.isdecimal() and len(node) < 12 and direction.isdecimal()):
            what = f"{line[:40]!r} is no degree of freedom"
            raise InputError(what, file=path, line=number, expected=_LABELS)
        found.append((str(int(node)), directions([int(direction[:9])], path)[0]))
    if not found:
        raise InputError("no rows", file=path, expected=_LABELS)
    return found


def _with_inner_nodes(xyz: np.ndarray, numbers: np.ndarray, stiffness: SparseArray) -> np.ndarray:
    """Return places where nodes that CalculiX adds inside elements lie amid their neighbours.

    Arguments:
        xyz: of every row, nan for nodes that the input file does not have, (n, 3).
        numbers: of the node of every row, (n,).
        stiffness: (n, n).
    """
    lost = np.isnan(xyz[:, 0])
    found = xyz.copy()
    for number in np.unique(numbers[lost]):
        near = np.unique(stiffness[:, np.flatnonzero(numbers == number)].indices)
        near = near[~lost[near]]
        if len(near):
            found[numbers == number] = xyz[near].mean(axis=0)
    return found


def _matrix(path: Path, n: int | None) -> SparseArray:
    """Return a matrix of a file; of the rows that it has where n is None."""
    table = columns_of(path, 3, _KIND)
    rows, columns = (whole(table[:, i], path, 1, n or _MOST_ROWS) - 1 for i in (0, 1))
    n = int(max(rows.max(), columns.max())) + 1 if n is None else n
    return symmetric(rows, columns, table[:, 2], n)


def _write(path: Path, matrix: SparseArray) -> None:
    rows, columns, values = lower_triangle(matrix)
    table = np.column_stack([columns + 1, rows + 1, values])
    np.savetxt(path, table, fmt="%d %d %.16e")
