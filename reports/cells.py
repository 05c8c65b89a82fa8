"""Numbers and names as reports have them; what is missing or not finite is a dash."""

from __future__ import annotations

import math
from collections.abc import Sequence

NOTHING = "–"


def plain(text: object) -> str:
    """Return text on one line without control characters, which a terminal would obey."""
    return " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())


def shorten_text(text: str, width: int) -> str:
    """Return text cut to a width, with an ellipsis where something is missing."""
    return text if len(text) <= width else text[: width - 1] + "…"


def sentence(clause: str) -> str:
    """Return a clause with a capital and a full stop."""
    text = plain(clause)
    return text and f"{text[0].upper()}{text[1:]}" + ("" if text[-1] in ".!?" else ".")


def first_of(entries: Sequence[object], most: int) -> str:
    """Return the first of some entries on one line, and how many more there are."""
    more = len(entries) - most
    return ", ".join(map(plain, entries[:most])) + (f" and {more} more" if more > 0 else "")


def join_names(names: Sequence[str]) -> str:
    """Return names as in a sentence."""
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def format_fixed(value: float | None, digits: int = 2, width: int = 5) -> str:
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
    return format_fixed(value, 0 if value == round(value) else 1, width)


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


def format_signed(value: float | None, decimals: int = 1) -> str:
    """Return a number with its sign."""
    if value is None or not math.isfinite(value):
        return NOTHING
    return f"{value:+.{decimals}f}" if abs(value) < 1e4 else f"{value:+.2e}"


def estimate(value: float | None, std: float | None) -> str:
    """Return a value to the second digit of its standard deviation."""
    if value is None or std is None or std <= 0.0:
        return figure(value)
    last = math.floor(math.log10(std)) - 1
    if not -9 <= last <= 6 or abs(value) >= 1e9:
        return f"{figure(value)} ± {figure(std, 2)}"
    return " ± ".join(f"{round(v, -last):.{max(0, -last)}f}" for v in (value, std))
