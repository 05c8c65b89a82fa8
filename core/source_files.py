"""The source files of a package, found without importing it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from importlib.util import find_spec

Stamp = tuple[str, int, int]  # a file, when it was changed, its size


def stamps(top: str) -> tuple[Stamp, ...]:
    """Return the Python files of a package, or that of a lone module, with time and size.

    Arguments:
        top: its name, without a dot: what is below would only be found by importing it.
    """
    return tuple(map(stamp, files_of(top)))


def files_of(top: str) -> list[str]:
    """Return the Python files of a package, or that of a lone module; none without it."""
    try:
        spec = find_spec(top)
    except (ImportError, ValueError, AttributeError):
        return []
    if spec is None:
        return []
    folders = spec.submodule_search_locations or ()
    found = sorted({file for folder in folders for file in python_files(folder)})
    return found or ([spec.origin] if spec.origin else [])


def stamp(file: str) -> Stamp:
    """Return a file, when it was changed, and its size."""
    try:
        found = os.stat(file)
    except OSError:  # a link that leads nowhere is no source
        return file, 0, 0
    return file, found.st_mtime_ns, found.st_size


def python_files(folder: str) -> Iterator[str]:
    """Yield the paths of the Python files below a folder; strings, since `Path` takes its time."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(".py"):
                yield entry.path
            elif entry.name != "__pycache__" and entry.is_dir():
                yield from python_files(entry.path)
