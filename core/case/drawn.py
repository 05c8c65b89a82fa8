"""Other drawings of a case, files next to its `case.toml`: no more than looking up names needs."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

CASE_FILE = "case.toml"
DRAWN = ":"  # between the name of a case and that of the drawing that its model is


def drawing_of(path: str | PathLike[str]) -> Path | None:
    """Return the file of another drawing that stands for a case; None for a case folder."""
    found = Path(path)
    return found if found.suffix == ".toml" and found.name != CASE_FILE else None
