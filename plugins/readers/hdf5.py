"""Read and write models in HDF5 files, those of MATLAB among them."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from femubench import InputError
from femubench.plugins.readers.apart import apart
from femubench.plugins.readers.reading import needs, sparse_of
from femubench.plugins.readers.variables import Variables, VariablesReader

_KIND = "an HDF5 file with matrices by name"
_FORMS = (("data", "ir", "jc"), ("data", "indices", "indptr"))  # MATLAB's, and SciPy's names
_ROWS = "MATLAB_sparse"
_DEEPEST = 4


class Hdf5Reader(VariablesReader):
    """Reads full matrices, and sparse ones as groups with data, indices and indptr by columns."""

    name: str = "HDF5"
    suffixes: tuple[str, ...] = (".h5", ".hdf5", ".hdf")

    def variables(self, path: Path) -> dict[str, Any]:
        """Return datasets and sparse matrices by name, those below groups with a slash."""
        return read_hdf5(path)

    def save(self, path: Path, original: Path, new: Variables) -> None:
        """Write a file with some matrices renewed."""
        save_hdf5(path, original, new)


def read_hdf5(path: Path) -> dict[str, Any]:
    """Return what a file holds by name.

    Raises:
        InputError: when it is broken, or leads to data outside of it.
    """
    needs("h5py", "hdf5", path)
    return apart(list_variables, path, _KIND)


def list_variables(path: Path) -> dict[str, Any]:
    """Return what a file holds by name; a crash is for the caller to stand."""
    import h5py

    with h5py.File(path, "r") as file:
        return dict(_found(file, "", path))


def _found(group: Any, above: str, path: Path) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    import h5py

    for key in group:
        name = f"{above}{key}"
        if key.startswith("#"):  # where MATLAB keeps cells
            continue
        if isinstance(group.get(key, getlink=True), h5py.ExternalLink):
            raise _outside(name, path)
        item = group[key]
        if isinstance(item, h5py.Dataset):
            if item.external or item.is_virtual:
                raise _outside(name, path)
            value = _value(item)
            if value is not None:
                yield name, value
        elif (form := _form(item)) is not None:
            data, indices, indptr = (np.asarray(item[part][()]) for part in form)
            columns = len(indptr) - 1
            rows = int(item.attrs.get(_ROWS, columns))
            places = (indices.astype(np.int64), indptr.astype(np.int64))
            yield name, sparse_of(data, *places, (rows, columns))
        elif name.count("/") < _DEEPEST:
            yield from _found(item, f"{name}/", path)


def _outside(name: str, path: Path) -> InputError:
    what = f"{name!r} is kept in another file"
    return InputError(what, file=path, expected="one file with all of its data")


def _value(item: Any) -> Any:  # noqa: ANN401 - numbers or words
    """Return numbers or words; None for what is neither. MATLAB keeps rows where others columns."""
    kind = item.attrs.get("MATLAB_class", b"")
    if item.dtype.kind == "O":
        return np.array([str(v) for v in np.asarray(item.asstr()[()]).reshape(-1)])
    if item.dtype.kind not in "fiuS" or not item.size:
        return None
    value = np.asarray(item[()])
    if kind == b"char":
        rows = value.T if value.ndim == 2 else value.reshape(1, -1)
        return np.array(["".join(chr(int(code)) for code in row) for row in rows])
    return value.T if kind else value


def _form(group: Any) -> tuple[str, ...] | None:  # noqa: ANN401
    """Return the names of the three arrays where a group is a sparse matrix."""
    return next((form for form in _FORMS if all(part in group for part in form)), None)


def save_hdf5(path: Path, original: Path, new: Variables) -> None:
    """Write a copy of a file with some matrices renewed.

    Arguments:
        new: matrices by the names that `read_hdf5` gives; symmetric, so that rows and columns
            are alike.
    """
    import h5py

    shutil.copyfile(original, path)
    with h5py.File(path, "r+") as file:
        for name, value in new.items():
            item: Any = file[name]
            if isinstance(item, h5py.Dataset):
                item[...] = value
                continue
            form = _form(item)
            assert form is not None
            for part, array in zip(form, (value.data, value.indices, value.indptr), strict=True):
                kind = item[part].dtype
                del item[part]
                item[part] = array.astype(kind)
