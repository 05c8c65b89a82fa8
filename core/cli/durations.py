"""Durations on the command line: ``90``, ``90s``, ``10m``, ``1.5h``."""

from __future__ import annotations

import re

import click

_UNITS = {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0}
_DURATION = re.compile(r"(\d+(?:\.\d+)?|\.\d+)\s*([smh]?)", re.ASCII)


def seconds_of(ctx: click.Context, param: click.Parameter, value: str) -> float:
    """Return the seconds that an option's text stands for; a callback of click.

    Raises:
        click.BadParameter: when it is no duration above zero.
    """
    match = _DURATION.fullmatch(value.strip())
    seconds = float(match[1]) * _UNITS[match[2]] if match else 0.0
    if not 0.0 < seconds < float("inf"):
        raise click.BadParameter(f"{value!r} is no duration > 0 such as 90, 90s, 10m or 1h")
    return seconds


def spoken(seconds: float) -> str:
    """Return a duration as one would type it."""
    for unit in ("h", "m"):
        if seconds >= _UNITS[unit] and seconds % _UNITS[unit] == 0.0:
            return f"{seconds / _UNITS[unit]:g}{unit}"
    return f"{seconds:g}s"
