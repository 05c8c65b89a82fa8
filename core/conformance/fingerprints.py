"""Fingerprints: what an object holds, path by path, to the last bit."""

from __future__ import annotations

import hashlib
import os
import random
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

_DEEPEST = 12


def fingerprint(item: object, path: str) -> dict[str, str]:
    """Return a digest of every number and text that an object holds, by path.

    Arguments:
        item: dataclasses, mappings, sequences, arrays and sparse arrays are looked into; of
            anything else the type counts.
    """
    return dict(_walk(item, path, 0))


def first_difference(before: Mapping[str, str], after: Mapping[str, str]) -> str | None:
    """Return the first path at which two fingerprints differ, None where they are equal."""
    if before == after:
        return None
    paths = [*before, *(path for path in after if path not in before)]
    return next(path for path in paths if before.get(path) != after.get(path))


def global_state() -> dict[str, str]:
    """Return a fingerprint of what all code in a process shares."""
    numbers: Any = np.random.get_state()  # noqa: NPY002 - it is others who may use it
    parts: dict[str, object] = {
        "numpy's global random state": [np.asarray(numbers[1]), numbers[2:]],
        "the state of the module random": repr(random.getstate()),
        "numpy's error handling": np.geterr(),
        "numpy's print options": repr(sorted(np.get_printoptions().items(), key=lambda i: i[0])),
        "the working directory": os.getcwd(),
        "the environment variables": repr(sorted(os.environ.items())),
    }
    return {name: _digest(repr(fingerprint(part, "")).encode()) for name, part in parts.items()}


def _walk(item: Any, path: str, depth: int) -> Iterator[tuple[str, str]]:  # noqa: ANN401
    if depth > _DEEPEST:
        return
    if isinstance(item, np.ndarray):
        yield path, _array(item)
    elif sp.issparse(item):
        for name in ("data", "indices", "indptr", "row", "col", "coords", "offsets"):
            part = getattr(item, name, None)
            if isinstance(part, np.ndarray):
                yield f"{path}.{name}", _array(part)
        yield f"{path}.shape", str(item.shape)
    elif is_dataclass(item) and not isinstance(item, type):
        for field in fields(item):
            yield from _walk(getattr(item, field.name), f"{path}.{field.name}", depth + 1)
    elif isinstance(item, Mapping):
        for key, value in item.items():
            yield from _walk(value, f"{path}[{key!r}]", depth + 1)
    elif isinstance(item, tuple | list):
        for i, value in enumerate(item):
            yield from _walk(value, f"{path}[{i}]", depth + 1)
        yield f"{path} length", str(len(item))
    elif isinstance(item, np.generic | int | float | complex | str | bytes | bool | None):
        yield path, repr(item)
    else:
        yield path, type(item).__qualname__


def _array(array: np.ndarray[Any, Any]) -> str:
    if array.dtype.hasobject:
        return repr(array.tolist())
    head = f"{array.dtype.str} {array.shape} ".encode()
    return _digest(head + np.ascontiguousarray(array).tobytes())


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
