"""Read and write Nastran's OP4 files, binary and text, through pyYeti."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import scipy.sparse as sp

from femubench.fem import SparseArray
from femubench.plugins.readers.reading import needs, open_broken
from femubench.plugins.readers.variables import Variables, VariablesReader

_KIND = "a file of Nastran's OUTPUT4"
_SYMMETRIC = 6
_HEAD = 64  # bytes that tell a text from a binary file


class Op4Reader(VariablesReader):
    """Reads matrices under their names in lower case, e.g. kaa and maa; rows have no labels."""

    name: str = "Nastran OP4"
    suffixes: tuple[str, ...] = (".op4",)

    def variables(self, path: Path) -> dict[str, Any]:
        """Return the matrices, sparse; raises InputError."""
        return {
            name: _whole(sp.csc_array(value), form)
            for name, (value, form, _) in _loaded(path).items()
        }

    def save(self, path: Path, original: Path, new: Variables) -> None:
        """Write a file of the same kind, text or binary, with some matrices renewed."""
        from pyyeti.nastran import op4

        loaded = _loaded(original)
        with original.open("rb") as stream:
            binary = b"\0" in stream.read(_HEAD)
        names = [name.upper() for name in loaded]
        matrices = [new.get(name, value) for name, (value, _, _) in loaded.items()]
        forms = [form for _, form, _ in loaded.values()]
        op4.write(str(path), names, matrices, binary=binary, forms=forms)


def _loaded(path: Path) -> dict[str, tuple[Any, int, int]]:
    """Return matrix, form and type by lower-case name."""
    needs("pyyeti", "nastran", path)
    with open_broken(path, _KIND):
        from pyyeti.nastran import op4

        loaded: Any = op4.load(str(path), into="dct", sparse=True)
        return dict(loaded)


def _whole(matrix: SparseArray, form: int) -> SparseArray:
    """Return a symmetric matrix of which a file may hold one triangle alone."""
    lower, upper = sp.tril(matrix, -1), sp.triu(matrix, 1)
    if form != _SYMMETRIC or (lower.nnz and upper.nnz):
        return matrix
    return sp.csc_array(matrix + lower.T + upper.T)
