"""Read and write models in archives of NumPy and SciPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench.plugins.readers.reading import SPARSE_PARTS, open_broken, sparse_of
from femubench.plugins.readers.variables import Variables, VariablesReader

_KIND = "an archive of numpy.savez or scipy.sparse.save_npz"


class NpzReader(VariablesReader):
    """Reads `scipy.sparse.save_npz` (one matrix) and `numpy.savez` (variables by name).

    A sparse matrix K among the variables is four arrays: K.data, K.indices, K.indptr, K.shape.
    """

    name: str = "npz"
    suffixes: tuple[str, ...] = (".npz",)

    def variables(self, path: Path) -> dict[str, Any]:
        """Return the arrays, those of every sparse matrix put together; raises InputError."""
        with open_broken(path, _KIND):
            arrays = _arrays(path)
            if "format" in arrays:
                with path.open("rb") as stream:
                    return {path.stem: sp.csc_array(sp.load_npz(stream))}
            found = {name: value for name, value in arrays.items() if "." not in name}
            for name in arrays:
                base, dot, part = name.rpartition(".")
                if dot and part == "indptr":
                    found[base] = sparse_of(*(arrays[f"{base}.{one}"] for one in SPARSE_PARTS))
            return found

    def save(self, path: Path, original: Path, new: Variables) -> None:
        """Write an archive with some variables renewed."""
        arrays = _arrays(original)
        for name, value in new.items():
            if "format" in arrays:
                sp.save_npz(path, value)
                return
            if sp.issparse(value):
                arrays |= {f"{name}.{part}": getattr(value, part) for part in SPARSE_PARTS}
            else:
                arrays[name] = value
        with path.open("wb") as stream:
            np.savez_compressed(stream, **arrays)


def _arrays(path: Path) -> dict[str, Any]:
    # NumPy leaves a file open that it cannot read.
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
