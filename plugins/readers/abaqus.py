"""Read and write the matrices that Abaqus generates: .mtx in the format of *MATRIX INPUT."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from femubench import InputError, Model
from femubench.fem import MatrixGeometry, SparseArray, matrix_model
from femubench.plugins.readers.reading import (
    DIRECTIONS,
    ProgramReader,
    columns_of,
    directions,
    lower_triangle,
    symmetric,
    whole,
)

_KIND = "node, dof, node, dof, value as *MATRIX OUTPUT, FORMAT=MATRIX INPUT writes them"
_MOST_NODES = 1_000_000_000
_HELD = 1e30  # on the diagonal of a degree of freedom that a boundary condition holds

Labels = list[tuple[int, int]]


class AbaqusReader(ProgramReader):
    """Reads stiffness and mass of *MATRIX GENERATE, e.g. job_STIF2.mtx next to job_MASS2.mtx.

    Coordinates come from the input file: ``dofs = "job.inp"``.
    """

    name: str = "Abaqus"
    suffixes: tuple[str, ...] = (".mtx",)

    def read_matrix(self, path: Path) -> SparseArray:
        """Return the matrix in the order of nodes and directions; raises InputError."""
        table = _table(path)
        return _assembled(table, _labels(table))

    def read_model(self, path: Path) -> NoReturn:
        """Refuse: such a file has one matrix."""
        raise InputError("one matrix is no model", file=path, expected="a file with the mass too")

    def read_pair(self, stiffness: Path, mass: Path) -> Model:
        """Return a model on the degrees of freedom that either has, without those held."""
        table = _table(stiffness)
        rows, columns = _keys(table)
        held = rows[(rows == columns) & (table[:, 4] >= _HELD)]
        first, second = table[~(np.isin(rows, held) | np.isin(columns, held))], _table(mass)
        labels = _labels(first, second)
        along = directions([dof for _, dof in labels], stiffness)
        names = [node for node, _ in labels]
        return matrix_model(_assembled(second, labels), _assembled(first, labels), names, along)

    def write_pair(
        self, model: Model, stiffness: Path, mass: Path, originals: Sequence[Path]
    ) -> None:
        """Write the lower triangles of an updated model; rows that were held are left out."""
        geometry = model.geometry
        assert isinstance(geometry, MatrixGeometry)
        names = np.array([int(name) for name in geometry.names])[model.dofs.node]
        dofs = np.array([DIRECTIONS.index(name) + 1 for name in model.dofs.direction])
        for path, matrix in ((stiffness, model.stiffness), (mass, model.mass)):
            rows, columns, values = lower_triangle(matrix)
            table = [names[rows], dofs[rows], names[columns], dofs[columns], values]
            np.savetxt(path, np.column_stack(table), fmt="%d, %d, %d, %d, %.16e")


def _table(path: Path) -> np.ndarray:
    """Return the entries of a file: node, dof, node, dof, value, (m, 5)."""
    table = columns_of(path, 5, _KIND, delimiter=",")
    for i in (0, 2):
        whole(table[:, i], path, 1, _MOST_NODES)
        whole(table[:, i + 1], path, 1, len(DIRECTIONS))
    return table


def _keys(table: np.ndarray) -> list[np.ndarray]:
    """Return a number for the degree of freedom of every row and of every column."""
    scale = len(DIRECTIONS) + 1
    return [(table[:, i] * scale + table[:, i + 1]).astype(np.int64) for i in (0, 2)]


def _labels(*tables: np.ndarray) -> Labels:
    """Return node and dof of every row that some table has, in the order of the nodes."""
    found = np.unique(np.concatenate([key for table in tables for key in _keys(table)]))
    return [divmod(int(key), len(DIRECTIONS) + 1) for key in found]


def _assembled(table: np.ndarray, labels: Labels) -> SparseArray:
    """Return a matrix on some of the degrees of freedom."""
    own = np.array([node * (len(DIRECTIONS) + 1) + dof for node, dof in labels])
    rows, columns = _keys(table)
    inside = np.isin(rows, own) & np.isin(columns, own)
    i, j = (np.searchsorted(own, key[inside]) for key in (rows, columns))
    return symmetric(i, j, table[inside, 4], len(labels))
