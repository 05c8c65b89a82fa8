"""Call a library in a process of its own, where what it does with a broken file ends.

SciPy, HDF5 and the library of Ansys's files follow the numbers in a file into memory that is not
theirs; an error of Python is not what comes of it.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench import InputError
from femubench.fem import call_apart
from femubench.plugins.readers.reading import SPARSE_PARTS, open_broken, sparse_of

_MEMORY, _PER_BYTE = 1500 * 2**20, 64  # bytes with the libraries, and more for each of the file
_SECONDS = 300
_NAMES = "names"
_FOUND, _REFUSED = b"\0", b"\1"


def apart(function: Callable[[Path], dict[str, Any]], path: Path, expected: str) -> dict[str, Any]:
    """Return the arrays and sparse matrices by name that a function reads in a file.

    Arguments:
        function: of a module, from the path of a file.
        expected: for the message about a broken one.

    Raises:
        InputError: for whatever goes wrong.
    """
    words = (function.__module__, function.__name__, str(path.resolve()))
    memory = _MEMORY + _PER_BYTE * path.stat().st_size
    ending = call_apart(read_in_child, words, _SECONDS, memory, function.__module__)
    head, data = ending.answer[:1], ending.answer[1:]
    if head != _FOUND:
        late, refused = f"takes more than {_SECONDS} s", data.decode("utf-8", "replace")
        what = refused or (late if ending.how == "timeout" else "cannot be read: it is broken")
        raise InputError(what, file=path, expected=expected)
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    found: dict[str, Any] = {}
    for i, name in enumerate(arrays[_NAMES].tolist()):
        if f"v{i}" in arrays:
            found[name] = arrays[f"v{i}"]
        else:
            found[name] = sparse_of(*(arrays[f"v{i}.{part}"] for part in SPARSE_PARTS))
    return found


def read_in_child(words: tuple[str, str, str]) -> bytes:
    """Return what a function reads in a file as NPZ, or a line on why it refuses the file.

    Arguments:
        words: module and name of the function, path of the file.
    """
    module, name, file = words
    function: Callable[[Path], dict[str, Any]] = getattr(import_module(module), name)
    # Arrays of NPZ, those of sparse matrices by part, and the list of all names.
    arrays: dict[str, Any] = {}
    names: list[str] = []
    try:
        with open_broken(Path(file), ""):
            for found, value in function(Path(file)).items():
                key = f"v{len(names)}"
                if sp.issparse(value):
                    matrix = sp.csc_array(value)
                    matrix.check_format(full_check=True)
                    arrays |= {
                        f"{key}.{part}": np.asarray(getattr(matrix, part)) for part in SPARSE_PARTS
                    }
                elif isinstance(value, np.ndarray) and value.dtype.kind in "fiucbUS":
                    arrays[key] = value
                else:
                    continue
                names.append(found)
    except InputError as error:
        return _REFUSED + " ".join(error.what.split()).encode()
    stream = io.BytesIO(_FOUND)
    stream.seek(0, io.SEEK_END)
    arrays[_NAMES] = np.array(names, dtype=str)
    np.savez(stream, **arrays)
    return stream.getvalue()
