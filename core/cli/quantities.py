"""Durations, sizes and numbers of twins on the command line: ``90s``, ``1.5h``; ``4G``; ``2``."""

from __future__ import annotations

import re

import click

_UNITS = {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0}
_SIZES = {"": 1, "k": 2**10, "m": 2**20, "g": 2**30, "t": 2**40}
_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*([kmgt]?)(?:i?b)?", re.ASCII | re.IGNORECASE)
_LEAST_MEMORY = 16 * 2**20
_DURATION = re.compile(r"(\d+(?:\.\d+)?|\.\d+)\s*([smh]?)", re.ASCII)

_TWINS = re.compile(r"(\d{1,2}|100)(?::(\d{1,18}))?", re.ASCII)


def timeouts_of(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, float]:
    """Return seconds by strategy, that of all others under an empty name; a callback of click.

    Raises:
        click.BadParameter: for what is neither DURATION nor STRATEGY=DURATION, or stands twice.
    """
    found: dict[str, float] = {}
    for value in values:
        # Options of a strategy may hold equal signs of their own.
        name, _, text = value.rpartition("=")
        if name in found:
            whom = f" for {name!r}" if name else ""
            raise click.BadParameter(f"{value!r}: given twice{whom}")
        match = _DURATION.fullmatch(text.strip())
        seconds = float(match[1]) * _UNITS[match[2]] if match else 0.0
        if not 0.0 < seconds < float("inf"):
            raise click.BadParameter(f"{value!r} is no duration > 0 such as 90, 90s, 10m or 1h")
        found[name] = seconds
    return found


def bytes_of(ctx: click.Context, param: click.Parameter, value: str | None) -> int | None:
    """Return the bytes that an option's text stands for; a callback of click.

    Raises:
        click.BadParameter: when it is no size, or one in which nothing can run.
    """
    if value is None:
        return None
    match = _SIZE.fullmatch(value.strip())
    size = int(float(match[1]) * _SIZES[match[2].lower()]) if match else 0
    if size < _LEAST_MEMORY:
        raise click.BadParameter(f"{value!r} is no size >= 16M such as 512M or 4G")
    return size


def twins_of(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> tuple[int, int | None]:
    """Return number and seed, None where none is given, of ``N[:SEED]``; a callback of click.

    Raises:
        click.BadParameter: when it is neither.
    """
    if value is None:
        return 0, None
    match = _TWINS.fullmatch(value.strip())
    if match is None:
        raise click.BadParameter(f"{value!r} is no number of twins such as 2, or 2:SEED")
    return int(match[1]), None if match[2] is None else int(match[2])


def spoken(seconds: float) -> str:
    """Return a duration as one would type it."""
    for unit in ("h", "m"):
        if seconds >= _UNITS[unit] and seconds % _UNITS[unit] == 0.0:
            return f"{seconds / _UNITS[unit]:g}{unit}"
    return f"{seconds:g}s"
