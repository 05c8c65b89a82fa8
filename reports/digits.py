"""Printed figures and ours side by side: digits as in print, and one more for ours."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from femubench.reports.cells import NOTHING

# Outside these a figure is written with a power of ten.
_LEAST, _MOST = 1e-4, 1e7


@dataclass(frozen=True)
class Digits:
    """How figures of one kind are written.

    Arguments:
        decimals: behind the point in print.
        significant: in print, for figures with a power of ten.
    """

    decimals: int
    significant: int

    @staticmethod
    def of(printed: Iterable[float]) -> Digits:
        """Return the digits that figures printed alike have; the longest one counts.

        A table prints 0.930 where the number has become 0.93.
        """
        known = [float(value) for value in printed if math.isfinite(value)]
        plain = [repr(value).partition(".")[2] for value in known if _fits(value)]
        powers = [f"{value:e}".partition("e")[0] for value in known if not _fits(value)]
        return Digits(
            max((len(decimals.rstrip("0")) for decimals in plain), default=0),
            max((len(digits.strip("-0").replace(".", "")) for digits in powers), default=1),
        )

    def format(self, value: float, unit: str = "") -> str:
        """Return a figure as the paper has it."""
        return self._text(value, unit, 0, power=not _fits(value))

    def ours(self, value: float | None, unit: str = "", *, printed: float = 0.0) -> str:
        """Return our figure, with one digit more; a count stays one.

        Arguments:
            printed: the printed figure, which decides whether a power of ten is written.
        """
        if value is None or not math.isfinite(value):
            return NOTHING
        count = not unit and self.decimals == 0 and float(value).is_integer()
        power = not _fits(printed) or abs(value) >= _MOST
        return self._text(value, unit, 0 if count else 1, power=power)

    def _text(self, value: float, unit: str, more: int, *, power: bool) -> str:
        if unit == "Hz" and value < 0.0:
            return f"{self._text(-value, '', more, power=power)} i"
        if not power:
            text = f"{value:.{self.decimals + more}f}"
            return text.removeprefix("-") if float(text) == 0.0 else text
        mantissa, _, exponent = f"{value:.{self.significant - 1 + more}e}".partition("e")
        return f"{mantissa}e{int(exponent)}"


def off(percent: float | None, unit: str = "") -> str:
    """Return a deviation in percent with its sign; of percentages, in points."""
    if percent is None or not math.isfinite(percent):
        return NOTHING
    text = f"{percent:+.2f}" if abs(percent) < 1e4 else f"{percent:+.1e}"
    text = "0.00" if float(text) == 0.0 else text
    return f"{text} pt" if unit == "%" else text


def _fits(value: float) -> bool:
    return value == 0.0 or _LEAST <= abs(value) < _MOST
