"""The printed figures of the papers, transcribed."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from typing import Any

from femubench.reproduction import Equation


def read_printed(paper: str) -> dict[str, Any]:
    """Return the tables of a paper as its TOML file has them."""
    text = files(__package__).joinpath(f"{paper}-tables.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def equations(paper: str) -> tuple[Equation, ...]:
    """Return the equations of a paper with the functions that work by them."""
    text = files(__package__).joinpath(f"{paper}-equations.toml").read_text(encoding="utf-8")
    return tuple(Equation(**entry) for entry in tomllib.loads(text)["equation"])
