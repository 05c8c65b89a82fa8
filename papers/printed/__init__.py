"""The printed figures of the papers, transcribed."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from typing import Any


def printed(paper: str) -> dict[str, Any]:
    """Return the tables of a paper as its TOML file has them."""
    text = files(__package__).joinpath(f"{paper}-tables.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
