"""Figures of a diagnosis as text; what is missing or not finite is a dash."""

from __future__ import annotations

import math
from collections.abc import Iterable

from femubench.reports.cells import NOTHING


def chance(probability: float | None) -> str:
    """Return a probability in percent that never claims certainty."""
    if probability is None:
        return NOTHING
    if probability > 0.999:
        return "> 99.9 %"
    return "< 0.1 %" if probability < 0.001 else f"{100.0 * probability:.1f} %"


def figure(value: float | None, digits: int = 4) -> str:
    """Return a number to some digits, written out as long as it has seven at most."""
    if value is None or not math.isfinite(value):
        return NOTHING
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e" in text and 1.0 <= abs(value) < 1e7 else text


def signed(value: float | None, decimals: int = 1) -> str:
    """Return a number with its sign."""
    if value is None or not math.isfinite(value):
        return NOTHING
    return f"{value:+.{decimals}f}" if abs(value) < 1e4 else f"{value:+.2e}"


def rms(values: Iterable[float | None]) -> float | None:
    """Return the root mean square of what is there."""
    known = [value for value in values if value is not None]
    return math.sqrt(sum(value * value for value in known) / len(known)) if known else None


def estimate(value: float | None, std: float | None) -> str:
    """Return a value to the second digit of its standard deviation."""
    if value is None or std is None or std <= 0.0:
        return figure(value)
    last = math.floor(math.log10(std)) - 1
    if not -9 <= last <= 6 or abs(value) >= 1e9:
        return f"{figure(value)} ± {figure(std, 2)}"
    return " ± ".join(f"{round(v, -last):.{max(0, -last)}f}" for v in (value, std))
