"""Files that the commands write: checked before the work starts, replaced in one step after it."""

from __future__ import annotations

import os
from pathlib import Path

from femubench.core.errors import InputError
from femubench.core.files import write_atomically as write_atomically


def check_writable(path: Path) -> None:
    """Make sure that a file can be written before hours are spent on its content.

    Raises:
        InputError: when it is a folder, or its folder is missing or may not be written to.
    """
    if path.is_dir():
        raise InputError("is a folder", file=path, expected="the name of a file")
    if not path.parent.is_dir():
        raise InputError("folder does not exist", file=path.parent, expected="an existing folder")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError("folder cannot be written to", file=path.parent)


def check_can_make(folder: Path) -> None:
    """Make sure that a folder is there or can be made, before the work that fills it.

    Raises:
        InputError: when it, or the nearest folder above it, cannot be written to.
    """
    above = folder
    while not above.exists() and above != above.parent:
        above = above.parent
    if not above.is_dir() or not os.access(above, os.W_OK | os.X_OK):
        raise InputError("cannot be written to", file=above, expected="a folder of yours")


def make_folder(folder: Path) -> None:
    """Make a folder with its parents.

    Raises:
        InputError: when that fails or the folder may not be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InputError(f"cannot make the folder: {fault.strerror}", file=folder) from fault
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError("folder cannot be written to", file=folder)
