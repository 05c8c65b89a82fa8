"""Fill a folder that appears complete or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from femubench.core.errors import InputError


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give a folder beside the wanted one that takes its place when all went well.

    Raises:
        InputError: when the wanted folder holds anything, or nothing can be written there.
    """
    made: list[Path] = []
    fresh = folder.parent / f".{folder.name}.{os.getpid()}-{secrets.token_hex(4)}"
    try:
        if os.path.lexists(folder) and not (folder.is_dir() and not any(folder.iterdir())):
            what = "is not empty" if folder.is_dir() else "is no folder"
            raise InputError(what, file=folder, expected="a new or an empty folder")
        above = [path for path in (folder.parent, *folder.parent.parents) if not path.exists()]
        for path in reversed(above):
            path.mkdir()
            made.append(path)
        fresh.mkdir()
        yield fresh
        fresh.rename(folder)
        made.clear()
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError(what, file=folder, expected="a folder that can be written") from None
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        for path in reversed(made):
            with suppress(OSError):
                path.rmdir()
