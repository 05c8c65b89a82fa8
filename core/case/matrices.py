"""Models that come as matrices: Matrix Market files, their degrees of freedom, groups."""

from __future__ import annotations

import bz2
import gzip
import zlib
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from io import BufferedIOBase
from pathlib import Path
from typing import IO, Any

import numpy as np
import scipy.sparse as sp

from femubench.core.case.checks import check_sets, check_unique
from femubench.core.case.faults import BadKey, Misfit, at_key
from femubench.core.case.files import LARGEST_FILE, CaseFiles
from femubench.core.case.nodes import MatrixGeometry, read_dofs
from femubench.core.case.schema import LARGEST, GroupedSpec, GroupSpec, MatricesSpec
from femubench.core.errors import FemubenchError, InputError, ModelError
from femubench.core.fem.group_factors import PRELOAD, SET
from femubench.core.fem.model import Model
from femubench.core.files import MIB, limit_memory, open_regular
from femubench.core.roles import Reader
from femubench.core.typing import SparseArray

_OPENERS: dict[str, Callable[..., Any]] = {".gz": gzip.open, ".bz2": bz2.open}


class MatrixText(BufferedIOBase):
    """The bytes of a text file, as many as the limit allows: a few can unpack to any number.

    SciPy looks for the end of a line without looking for the end of its buffer, and crashes where
    there is none (scipy issue 19949): after a NUL byte, and in a last line without line end. So
    the former is refused and the latter gets one.
    """

    def __init__(self, file: Path) -> None:
        self._stream: IO[bytes] | Any
        self._file, self._left, self._last = file, LARGEST_FILE, b"\n"
        self._plain = open_regular(file, LARGEST_FILE)
        opener = _OPENERS.get(file.suffix.lower())
        self._stream = self._plain if opener is None else opener(self._plain)

    def readable(self) -> bool:
        """Tell that it can be read."""
        return True

    def read(self, size: int | None = -1) -> bytes:
        """Return the next bytes; raises InputError behind the limit, and for what is no text."""
        wanted = self._left + 1 if size is None or size < 0 else min(size, self._left + 1)
        content = self._stream.read(wanted)
        self._left -= len(content)
        if self._left < 0:
            expected = f"at most {LARGEST_FILE // MIB} MiB once it is unpacked"
            raise InputError("file is too large", file=self._file, expected=expected)
        if b"\0" in content:
            raise InputError("not a text: a NUL byte", file=self._file, expected="Matrix Market")
        if not content and wanted > 0 and self._last != b"\n":
            content = b"\n"
        self._last = content[-1:] or self._last
        return content

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
        self._plain.close()
        super().close()


_MOST_DENSE = 10_000  # rows of a matrix in array form
_MOST_ENTRIES = 50_000_000  # of a matrix in coordinate form
_BROKEN = (ValueError, OverflowError, OSError, EOFError, IndexError, TypeError, MemoryError)
_MEMORY, _PER_BYTE = 768 * MIB, 64  # that a reader may take, and more for every byte of a file
_ASYMMETRY = 1e-8  # of the largest entry
_MATRIX_MARKET = (".mtx", ".mtx.gz", ".mtx.bz2")


def read_matrix(
    file: Path, size: int, readers: Collection[Reader], *, signed: bool = False
) -> SparseArray:
    """Return a symmetric matrix of a file.

    Arguments:
        file: Matrix Market, or whatever one of the readers knows by its suffix.
        size: the number of rows that it must have.
        signed: whether it may have negative entries on its diagonal, as geometric stiffness has.

    Raises:
        InputError: when it is not real, square, of that size, finite and symmetric.
    """
    return check_symmetric(matrix_of(file, readers, size), file, size, signed=signed)


def matrix_of(file: Path, readers: Collection[Reader], size: int | None = None) -> SparseArray:
    """Return what a file holds as a matrix, with nothing checked but its size.

    Arguments:
        file: Matrix Market, or whatever one of the readers knows by its suffix.
        size: the number of rows that a header must claim; None for any.
    """
    if is_matrix_market(file):
        return _matrix_market(file, size)
    reader = reader_of(file, readers)
    if reader is None:
        known = [*_MATRIX_MARKET[:2], *(s for r in readers for s in r.suffixes)]
        raise InputError("unknown kind of file", file=file, expected=", ".join(known))
    with reading_with(reader, file):
        return sp.csc_array(reader.read_matrix(file))


def is_matrix_market(file: Path) -> bool:
    """Tell whether a file is one of Matrix Market; Abaqus calls its matrices ``.mtx`` too."""
    name = file.name.lower()
    if not name.endswith(_MATRIX_MARKET[0]):
        return name.endswith(_MATRIX_MARKET)
    with open_regular(file, LARGEST_FILE) as stream:
        start = stream.read(64)
    return start.startswith(b"%%") or not start.lstrip()[:1].isdigit()


def check_symmetric(
    matrix: SparseArray, file: Path, size: int, *, signed: bool = False
) -> SparseArray:
    """Return what a file gave as a symmetric matrix, positive on its diagonal if not `signed`.

    Raises:
        InputError: when it is not real, square, of that size, finite and symmetric.
    """
    if matrix.shape != (size, size):
        what = f"the matrix has {matrix.shape[0]} rows and {matrix.shape[1]} columns"
        raise InputError(what, file=file, expected=f"{size} of both as in the dofs file")
    if matrix.dtype.kind not in "fiu":
        raise InputError("an entry is not a number", file=file, expected="real numbers")
    matrix = sp.csc_array(matrix, dtype=float)
    entries = sp.coo_array(matrix)
    sizes = np.abs(entries.data)
    wrong = np.flatnonzero(~(sizes <= LARGEST))
    if len(wrong):
        i, j = entries.row[wrong[0]] + 1, entries.col[wrong[0]] + 1
        what = f"entry ({i}, {j}) is {entries.data[wrong[0]]:g}"
        raise InputError(what, file=file, expected=f"finite numbers up to {LARGEST:g}")
    apart = sp.coo_array(matrix - matrix.T)
    wrong = np.flatnonzero(np.abs(apart.data) > _ASYMMETRY * sizes.max(initial=0.0))
    if len(wrong):
        i, j = apart.row[wrong[0]] + 1, apart.col[wrong[0]] + 1
        what = f"the matrix is not symmetric at ({i}, {j})"
        raise InputError(what, file=file, expected="A = A'")
    largest = np.abs(matrix.data).max(initial=0.0)
    if largest == 0.0 or (not signed and matrix.diagonal().min() < 0.0):
        what = "the matrix is zero" if largest == 0.0 else "a diagonal entry is negative"
        raise InputError(what, file=file, expected="a positive semidefinite matrix")
    return sp.csc_array(0.5 * (matrix + matrix.T))


def reader_of(file: Path, readers: Collection[Reader]) -> Reader | None:
    """Return the first reader that knows the suffix of a file."""
    name = file.name.lower()
    return next((r for r in readers if any(name.endswith(s) for s in r.suffixes)), None)


@contextmanager
def reading_with(reader: Reader, file: Path) -> Iterator[None]:
    """Turn whatever a reader plugin raises into one line that names it and the file.

    What it may take of memory grows with the file, whatever the file claims to hold; a reader whose
    files are small for what they describe has `read_memory(file)`, in bytes, None for as usual.
    """
    size = file.stat().st_size if file.is_file() else 0
    try:
        own = getattr(reader, "read_memory", None)
        needed = own(file) if own else None
        with limit_memory(_MEMORY + (_PER_BYTE * size if needed is None else needed)):
            yield
    except ModelError as error:
        raise InputError(
            str(error), file=file, expected="matrices with labels of their rows"
        ) from None
    except FemubenchError:
        raise
    except Exception as error:
        what = f"reader {reader.name!r} failed: {type(error).__name__}: {error}"
        raise InputError(what, file=file, expected=f"a file that {reader.name!r} reads") from error


def _matrix_market(file: Path, size: int | None) -> SparseArray:
    import scipy.io

    expected = "a Matrix Market file, coordinate or array, real, symmetric or general"
    try:
        with MatrixText(file) as text:
            rows, columns, entries, form, field, symmetry = scipy.io.mminfo(text)
        if field not in ("real", "integer") or symmetry not in ("general", "symmetric"):
            raise InputError(f"a matrix that is {field} {symmetry}", file=file, expected=expected)
        if (rows, columns) != (size or rows,) * 2 or (form == "array" and rows > _MOST_DENSE):
            what = f"the matrix has {rows} rows and {columns} columns"
            wanted = f"{size} of both as in the dofs file" if size else "a square matrix"
            raise InputError(what, file=file, expected=wanted)
        # The header is believed when memory is taken for the entries.
        if form == "coordinate" and not 0 <= entries <= _MOST_ENTRIES:
            what = f"the matrix has {entries} entries"
            raise InputError(what, file=file, expected=f"at most {_MOST_ENTRIES}")
        with MatrixText(file) as text:
            return sp.csc_array(scipy.io.mmread(text, spmatrix=False))
    except (*_BROKEN, zlib.error) as error:
        raise InputError(f"cannot be read: {error}", file=file, expected=expected) from None


def model_of_matrices(spec: MatricesSpec, files: CaseFiles, readers: Collection[Reader]) -> Model:
    """Return the model of a case of kind ``matrices``.

    Raises:
        BadKey: with a path below `model`.
        InputError: for what is wrong in one of the files.
    """
    paths = {}
    for key in ("dofs", "mass", "stiffness"):
        with at_key(key):
            paths[key] = files.path(getattr(spec, key))
    geometry = read_dofs(paths["dofs"])
    size = len(geometry.dofs)
    mass, stiffness = (read_matrix(paths[key], size, readers) for key in ("mass", "stiffness"))
    model = Model(mass, stiffness, geometry.dofs, geometry)
    return with_families(with_groups(model, spec.groups, files, readers), spec)


def with_groups(
    model: Model, specs: Sequence[GroupSpec], files: CaseFiles, readers: Collection[Reader]
) -> Model:
    """Return a model from files with the groups of `[[model.groups]]` in addition to its own.

    Raises:
        BadKey: with a path below `model`.
        InputError: for what is wrong in one of the files.
    """
    geometry = model.geometry
    assert isinstance(geometry, MatrixGeometry)
    check_unique((("groups", i, "name"), spec.name) for i, spec in enumerate(specs))
    groups, mass_groups = dict(model.groups), dict(model.mass_groups)
    powers = dict(model.powers)
    for i, spec in enumerate(specs):
        with at_key("groups", i):
            if spec.dofs is not None and (spec.stiffness is not None or spec.mass is not None):
                raise BadKey(("dofs",), "a group of dofs with files", "either files or dofs")
            known = spec.name in {*model.groups, *model.mass_groups}
            if not known and spec.stiffness is None and spec.mass is None and spec.dofs is None:
                raise BadKey((), "a group without a part", "stiffness, mass or dofs")
            if spec.kind == "preload" and (
                known or spec.stiffness is None or spec.mass is not None
            ):
                expected = "the geometric stiffness, which is no group of a deck and has no mass"
                raise BadKey(("kind",), "a preload without its stiffness alone", expected)
            if spec.dofs is not None:
                inside = np.zeros(len(geometry.dofs))
                for i, entry in enumerate(spec.dofs):
                    with at_key("dofs", i):
                        inside[_rows(entry, geometry)] = 1.0
                pick = sp.diags_array(inside)
                part = sp.csc_array(pick @ model.stiffness @ pick)
                part.eliminate_zeros()
                groups[spec.name] = part
            for key, found in (("stiffness", groups), ("mass", mass_groups)):
                if (file := getattr(spec, key)) is not None:
                    with at_key(key):
                        path = files.path(file)
                    signed = spec.kind == "preload"
                    found[spec.name] = read_matrix(path, model.size, readers, signed=signed)
            if spec.kind == "preload":  # lies in other groups, and is none of its own
                added = groups.pop(spec.name)
                powers[f"{PRELOAD}{spec.name}"] = {1: (added, sp.csc_array(added.shape))}
    priors = {spec.name: spec.prior for spec in specs if spec.prior is not None}
    model = replace(model, groups=groups, mass_groups=mass_groups, powers=powers)
    kinds = {**model.group_kinds, **{s.name: s.kind for s in specs if s.kind is not None}}
    return replace(model, group_priors={**model.group_priors, **priors}, group_kinds=kinds)


def with_families(model: Model, spec: GroupedSpec) -> Model:
    """Return a model from files with the sets that its case states of its groups.

    Raises:
        BadKey: with a path below `model`.
    """
    known = {*model.groups, *model.mass_groups}
    check_sets([(item.name, item.groups) for item in spec.sets], "group", known)
    sets = {f"{SET}{item.name}": tuple(item.groups) for item in spec.sets}
    return replace(model, families={**model.families, **sets})


def _rows(entry: int | str, geometry: MatrixGeometry) -> list[int]:
    if isinstance(entry, int):
        row = entry - geometry.first_row
        if not 0 <= row < len(geometry.dofs):
            raise Misfit("there is no such row", "a row number of the dofs file")
        return [row]
    node, _, direction = entry.rpartition(":")
    if (node, direction) in geometry.rows:
        return [geometry.rows[node, direction]]
    found = geometry.rows_of.get(entry)
    if not found:
        raise Misfit(f"there is no dof {entry[:60]!r}", 'a row number, "node" or "node:direction"')
    return found
