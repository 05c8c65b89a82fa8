"""Read and write models in MATLAB's files: up to version 7 through SciPy, version 7.3 as HDF5."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from femubench.plugins.readers.apart import apart
from femubench.plugins.readers.hdf5 import read_hdf5, save_hdf5
from femubench.plugins.readers.variables import Variables, VariablesReader

_KIND = "a MATLAB file"
_HDF5 = b"\x89HDF"
_USER_BLOCK = 512  # bytes before the HDF5 of version 7.3


class MatlabReader(VariablesReader):
    """Reads full and sparse matrices, and labels as numbers, words or cells of words."""

    name: str = "MATLAB"
    suffixes: tuple[str, ...] = (".mat",)

    def variables(self, path: Path) -> dict[str, Any]:
        """Return the variables by name; raises InputError."""
        if is_hdf5(path):
            return read_hdf5(path)
        return apart(list_variables, path, _KIND)

    def save(self, path: Path, original: Path, new: Variables) -> None:
        """Write a file of the same version with some variables renewed."""
        if is_hdf5(original):
            save_hdf5(path, original, new)
            return
        with path.open("wb") as stream:
            scipy.io.savemat(stream, {**_loaded(original), **new}, do_compression=True)


def is_hdf5(path: Path) -> bool:
    """Tell whether a file is one of MATLAB 7.3."""
    with path.open("rb") as stream:
        start = stream.read(_USER_BLOCK + len(_HDF5))
    return start.startswith(_HDF5) or start[_USER_BLOCK:] == _HDF5


def list_variables(path: Path) -> dict[str, Any]:
    """Return the variables by name; a crash is for the caller to stand."""
    found = dict(_parts(_loaded(path)))
    for name, value in found.items():
        if getattr(value, "dtype", np.dtype(float)).kind == "O":
            cells = (np.asarray(cell).reshape(-1)[:1] for cell in value.flat)
            found[name] = np.array([str(cell[0]) if np.size(cell) else "" for cell in cells])
    return found


def _parts(found: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield variables by name, the fields of a structure of one behind its name and a slash."""
    for name, value in found.items():
        fields = getattr(getattr(value, "dtype", None), "names", None)
        if fields and value.size == 1:
            inner = value.reshape(-1)[0]
            yield from _parts({field: inner[field] for field in fields}, f"{above}{name}/")
        elif not fields:
            yield f"{above}{name}", value


def _loaded(path: Path) -> dict[str, Any]:
    found = scipy.io.loadmat(path)
    return {name: value for name, value in found.items() if not name.startswith("__")}
