"""What readers of other programs' files share: one line for all that a broken file does."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from femubench import InputError

if TYPE_CHECKING:
    from femubench import Measurement
    from femubench.fem import SparseArray

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
SPARSE_PARTS = ("data", "indices", "indptr", "shape")


@contextmanager
def open_broken(path: Path, what: str) -> Iterator[None]:
    """Turn whatever a library raises at a broken file into one line; let it print nothing.

    Arguments:
        what: was expected, e.g. ``"an OP4 file"``.
    """
    try:
        with redirect_stdout(StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except InputError:
        raise
    except MemoryError:
        raise InputError("takes too much memory", file=path, expected=what) from None
    except Exception as error:
        stated = f"{type(error).__name__}: {error}"
        raise InputError(f"cannot be read: {stated}", file=path, expected=what) from None


class ProgramReader:
    """Base class of readers of a program's files, which refuses what these do not hold."""

    name: str
    suffixes: tuple[str, ...]

    def read_matrix(self, path: Path) -> SparseArray:
        """Refuse, as here, where a file holds no matrix."""
        what = f"no matrix is read from files of kind {self.name!r}"
        raise InputError(what, file=path, expected=".op4, .pch or .mtx")

    def read_modes(self, path: Path) -> Measurement:
        """Refuse, as here, where a file holds no measured modes."""
        what = f"no modes are read from files of kind {self.name!r}"
        raise InputError(what, file=path, expected=".csv or .unv")


def directions(numbers: Sequence[int], path: Path) -> tuple[str, ...]:
    """Return the directions that programs count from 1 (x) to 6 (rz).

    Raises:
        InputError: for any other number.
    """
    for number in numbers:
        if not 1 <= number <= len(DIRECTIONS):
            expected = "degrees of freedom 1 to 6"
            raise InputError(f"degree of freedom {number}", file=path, expected=expected)
    return tuple(DIRECTIONS[number - 1] for number in numbers)


def words_of(column: Any) -> list[str]:  # noqa: ANN401 - numbers or words
    """Return the entries of a column as texts, whole numbers without a point."""
    values = np.asarray(column).reshape(-1)
    if values.dtype.kind == "f" and np.isfinite(values).all() and (values % 1 == 0).all():
        values = values.astype(np.int64)
    texts = [v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for v in values]
    return [text.strip() for text in texts]


def symmetric(rows: np.ndarray, columns: np.ndarray, values: np.ndarray, n: int) -> SparseArray:
    """Return a matrix of which a file has one triangle, sparse (n, n).

    Arguments:
        rows, columns: from 0, (m,) each; where both triangles are there, they must be equal.
        values: (m,).
    """
    low, high = np.minimum(rows, columns), np.maximum(rows, columns)
    if (rows < columns).any() and (rows > columns).any():
        return sp.csc_array((values, (rows, columns)), shape=(n, n))
    upper = sp.csc_array((values, (low, high)), shape=(n, n))
    return sp.csc_array(upper + sp.triu(upper, 1).T)


def sparse_of(data: Any, indices: Any, indptr: Any, shape: Any) -> SparseArray:  # noqa: ANN401
    """Return a sparse matrix from its `SPARSE_PARTS`; raises ValueError where they do not fit."""
    rows, columns = (int(value) for value in shape)
    matrix = sp.csc_array((data, indices, indptr), shape=(rows, columns))
    matrix.check_format(full_check=True)
    return matrix


def lower_triangle(matrix: SparseArray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows, columns (from 0) and values of the lower triangle, row by row."""
    part = sp.coo_array(sp.tril(sp.csr_array(matrix)))
    order = np.lexsort((part.col, part.row))
    return part.row[order], part.col[order], part.data[order]


def needs(package: str, extra: str, path: Path) -> None:
    """Make sure that the library of a format is there.

    Raises:
        InputError: with the command that installs it.
    """
    if find_spec(package) is None:
        what, expected = f"reading it needs {package}", f"pip install 'femubench[{extra}]'"
        raise InputError(what, file=path, expected=expected)


def columns_of(path: Path, count: int, what: str, delimiter: str | None = None) -> np.ndarray:
    """Return the numbers of a text in columns, (m, count); lines that begin with * are no data.

    Raises:
        InputError: for other columns, or what is no finite number.
    """
    with open_broken(path, what):
        table = np.loadtxt(path, delimiter=delimiter, comments="*", ndmin=2, encoding="latin-1")
    if not len(table) or table.shape[1] != count or not np.isfinite(table).all():
        raise InputError(f"{table.shape[1]} columns", file=path, expected=what)
    return table


def whole(column: np.ndarray, path: Path, lowest: int, highest: int) -> np.ndarray:
    """Return a column as whole numbers within bounds; raises InputError."""
    wrong = (column % 1 != 0) | (column < lowest) | (column > highest)
    if wrong.any():
        expected = f"whole numbers from {lowest} to {highest}"
        raise InputError(f"{column[wrong][0]:g}", file=path, expected=expected)
    return column.astype(np.int64)
