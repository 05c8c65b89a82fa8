"""The case that ``bench init`` writes: a portal frame, measured on a better model of itself.

``modes.csv`` and ``modified.csv`` are the first six modes of the same frame on 40 Timoshenko
elements a member, with rotational springs of 4e5 N m/rad between the beam and the posts.
"""

from __future__ import annotations

from pathlib import Path

from femubench.core.case.drawn import CASE_FILE
from femubench.core.errors import InputError

_FILES = Path(__file__).with_name("example_files")
_NAMES = (CASE_FILE, "sensors.csv", "modes.csv", "modified.csv")


def write_example(folder: Path) -> tuple[Path, ...]:
    """Write the example case into a new or empty folder and return its files.

    Raises:
        InputError: when the folder holds anything, or cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise InputError("is not empty", file=folder, expected="a new or an empty folder")
        for name in _NAMES:
            (folder / name).write_bytes((_FILES / name).read_bytes())
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError(what, file=folder, expected="a folder that can be written") from None
    return tuple(folder / name for name in _NAMES)
