"""Durations, sizes and numbers of twins as one types them: ``90s``, ``1.5h``; ``4G``; ``2:7``."""

from __future__ import annotations

import re
from collections.abc import Iterable

_UNITS = {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0}
_SIZES = {"": 1, "k": 2**10, "m": 2**20, "g": 2**30, "t": 2**40}
_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*([kmgt]?)(?:i?b)?", re.ASCII | re.IGNORECASE)
_LEAST_MEMORY = 16 * 2**20
_DURATION = re.compile(r"(\d+(?:\.\d+)?|\.\d+)\s*([smh]?)", re.ASCII)
_TWINS = re.compile(r"(\d{1,2}|100)(?::(\d{1,18}))?", re.ASCII)


def parse_timeouts(texts: Iterable[str]) -> dict[str, float]:
    """Return seconds by strategy, those of all others under an empty name.

    Raises:
        ValueError: for what is neither DURATION nor STRATEGY=DURATION, or stands twice.
    """
    found: dict[str, float] = {}
    for text in texts:
        # Options of a strategy may hold equal signs of their own.
        name, _, duration = text.rpartition("=")
        if name in found:
            raise ValueError(f"{text!r}: given twice{f' for {name!r}' if name else ''}")
        match = _DURATION.fullmatch(duration.strip())
        seconds = float(match[1]) * _UNITS[match[2]] if match else 0.0
        if not 0.0 < seconds < float("inf"):
            raise ValueError(f"{text!r} is no duration > 0 such as 90, 90s, 10m or 1h")
        found[name] = seconds
    return found


def parse_size(text: str) -> int:
    """Return the bytes that a text stands for.

    Raises:
        ValueError: when it is no size, or one in which nothing can run.
    """
    match = _SIZE.fullmatch(text.strip())
    size = int(float(match[1]) * _SIZES[match[2].lower()]) if match else 0
    if size < _LEAST_MEMORY:
        raise ValueError(f"{text!r} is no size >= 16M such as 512M or 4G")
    return size


def parse_twins(text: str) -> tuple[int, int | None]:
    """Return number and seed, None where none is given, of ``N[:SEED]``.

    Raises:
        ValueError: when it is neither.
    """
    match = _TWINS.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is no number of twins such as 2, or 2:SEED")
    return int(match[1]), None if match[2] is None else int(match[2])


def say_duration(seconds: float) -> str:
    """Return a duration as one would type it."""
    for unit in ("h", "m"):
        if seconds >= _UNITS[unit] and seconds % _UNITS[unit] == 0.0:
            return f"{seconds / _UNITS[unit]:g}{unit}"
    return f"{seconds:g}s"
