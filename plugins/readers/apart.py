"""Call a library in a process of its own, where what it does with a broken file ends.

SciPy, HDF5 and the library of Ansys's files follow the numbers in a file into memory that is not
theirs; an error of Python is not what comes of it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench import InputError
from femubench.plugins.readers.reading import SPARSE_PARTS, opened, sparse_of

_MEMORY, _PER_BYTE = 900 * 2**20, 64  # bytes beyond the libraries, and more for each of the file
_SECONDS = 300
_NAMES = "names"


def apart(function: Callable[[Path], dict[str, Any]], path: Path, expected: str) -> dict[str, Any]:
    """Return the arrays and sparse matrices by name that a function reads in a file.

    Arguments:
        function: of a module, from the path of a file.
        path: of the file.
        expected: for the message about a broken one.

    Raises:
        InputError: for whatever goes wrong.
    """
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.npz"
        words = (function.__module__, function.__name__, str(path.resolve()), str(result))
        code = f"from {__name__} import in_child; in_child{words!r}"
        environment = {"PYTHONPATH": os.pathsep.join(sys.path), "OPENBLAS_NUM_THREADS": "1"}
        try:
            done = subprocess.run(
                [sys.executable, "-c", code],
                env={**os.environ, **environment},
                capture_output=True,
                check=False,
                timeout=_SECONDS,
            )
        except subprocess.TimeoutExpired:
            what = f"takes more than {_SECONDS} s"
            raise InputError(what, file=path, expected=expected) from None
        if done.returncode or not result.is_file():
            told = done.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
            what = told if done.returncode == 1 and told else "cannot be read: it is broken"
            raise InputError(what, file=path, expected=expected)
        with np.load(result, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
            found: dict[str, Any] = {}
            for i, name in enumerate(arrays[_NAMES].tolist()):
                if f"v{i}" in arrays:
                    found[name] = arrays[f"v{i}"]
                else:
                    found[name] = sparse_of(*(arrays[f"v{i}.{part}"] for part in SPARSE_PARTS))
            return found


def in_child(module: str, function: str, path: str, result: str) -> None:
    """Call a function with limits, and store what it returns; end with 1 and one line otherwise."""
    called: Callable[[Path], dict[str, Any]] = getattr(import_module(module), function)
    try:
        with opened(Path(path), ""):
            # Arrays of NPZ, those of sparse matrices by part, and the list of all names.
            arrays: dict[str, Any] = {}
            names: list[str] = []
            for name, value in called(Path(path)).items():
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
                names.append(name)
            arrays[_NAMES] = np.array(names, dtype=str)
    except InputError as error:
        sys.exit(" ".join(error.what.split()))
    np.savez(result, **arrays)


def limit_memory(path: Path) -> None:
    """Take no more memory from now on than a file of that size may need; not on Windows."""
    try:
        import resource
    except ImportError:
        return
    most = _MEMORY + _PER_BYTE * path.stat().st_size
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
