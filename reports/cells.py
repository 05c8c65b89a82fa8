"""Numbers and names as they stand in a table."""

from __future__ import annotations

import math

NOTHING = "–"


def plain(text: object) -> str:
    """Return text on one line without control characters, which a terminal would obey."""
    return " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())


def fixed(value: float | None, digits: int = 2, width: int = 5) -> str:
    """Return a number with as many decimals, up to `digits`, as fit into a width."""
    if value is None or not math.isfinite(value):
        return NOTHING
    for decimals in range(digits, -1, -1):
        text = f"{value:.{decimals}f}"
        if text.strip("-0.") == "":
            text = text.removeprefix("-")
        if len(text) <= width:
            return text
    return f"{value:.0e}".replace("e+0", "e")


def whole(value: float | None, width: int = 12) -> str:
    """Return a count; one decimal where a median lies between two and there is room for it."""
    if value is None or not math.isfinite(value):
        return NOTHING
    return fixed(value, 0 if value == round(value) else 1, width)


def hertz(value: float | None) -> str:
    """Return a frequency in Hz; ``102.5 i`` where the eigenvalue is negative."""
    if value is None:
        return NOTHING
    return f"{-value:.1f} i" if value < 0.0 else f"{value:.1f}"


def interval(low: float, high: float) -> str:
    """Return ``low to high``, nothing where there is none."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return NOTHING
    return " to ".join(f"{end:.3f}".replace("-0.000", "0.000") for end in (low, high))


def shortened(text: str, width: int) -> str:
    """Return text cut to a width, with an ellipsis where something is missing."""
    return text if len(text) <= width else text[: width - 1] + "…"
