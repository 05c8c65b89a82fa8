"""The datasets of a universal file, read one by one through pyuff."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, TypeAlias

from femubench import InputError

_LARGEST = 256  # MiB of a file
Dataset: TypeAlias = Mapping[str, Any]


def read_datasets(
    path: Path, wanted: Collection[int], spare: Collection[int] = ()
) -> list[Dataset]:
    """Return the datasets of some numbers.

    Arguments:
        wanted: numbers of datasets.
        spare: those of them that are left out where they are broken.

    Raises:
        InputError: when the file is too large, or it or a wanted dataset is broken.
    """
    import pyuff

    if path.stat().st_size > _LARGEST * 2**20:
        raise InputError("file is too large", file=path, expected=f"at most {_LARGEST} MiB")
    found: list[Dataset] = []
    try:
        file: Any = pyuff.UFF(str(path))
        types = [int(number) for number in file.get_set_types()]
    except Exception as error:  # pyuff raises nothing more special
        raise InputError(f"cannot be read: {error}", file=path) from None
    for i, number in enumerate(types):
        if number not in wanted:
            continue
        try:
            # pyuff prints what it does not know.
            with redirect_stdout(StringIO()):
                found.append(file.read_sets(i))
        except Exception as error:
            if number in spare:
                continue
            key = f"dataset {number} (block {i + 1})"
            raise InputError(f"cannot be read: {error}", file=path, key=key) from None
    return found
