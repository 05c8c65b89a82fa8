"""One printed cell beside our value of it, and the verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

Verdict = Literal["agrees", "agrees-under", "does-not-follow"]
VERDICTS: tuple[Verdict, ...] = ("agrees", "agrees-under", "does-not-follow")
_UNEXPLAINED = "no reading of the text was found that gives it"


@dataclass(frozen=True)
class Cell:
    """One figure that a paper prints.

    Arguments:
        paper: slug, the word after ``bench reproduce``.
        table: as the paper numbers it, e.g. ``"4d"``.
        row, column: what the paper calls them.
        printed: its figure; an imaginary frequency is a negative one.
        ours: the same from a re-run; None where there is none.
        verdict: whether it agrees, agrees under a convention that the text does not state, or does
            not follow from the text.
        note: the convention, or why it does not follow; may be empty for ``agrees``.
        unit: of both; ``%`` for a figure that is a percentage itself.
    """

    paper: str
    table: str
    row: str
    column: str
    printed: float
    ours: float | None
    verdict: Verdict
    note: str = ""
    unit: str = ""

    @property
    def deviation_percent(self) -> float | None:
        """Return (ours - printed) / |printed| in percent; of percentages, ours - printed.

        None where there is no value of ours, the printed one is zero and ours is not, or one of
        two frequencies is imaginary; two imaginary ones are compared by size.
        """
        printed, ours = self.printed, self.ours
        if ours is None or not math.isfinite(ours):
            return None
        if self.unit == "%":
            return ours - printed
        if printed == 0.0:
            return 0.0 if ours == 0.0 else None
        if self.unit == "Hz" and (printed < 0.0 or ours < 0.0):
            # Imaginary frequencies are compared by size, and with nothing else.
            return 100.0 * (ours / printed - 1.0) if max(printed, ours) < 0.0 else None
        return 100.0 * (ours - printed) / abs(printed)


@dataclass(frozen=True)
class Page:
    """Where cells of one kind stand, and when they agree.

    Arguments:
        paper, table: as in `Cell`.
        unit: of the cells.
        tolerance: largest deviation that agrees, in percent (of percentages: in points).
        decimals: digits behind the point in print: what rounds to the printed figure agrees too;
            None for the tolerance alone.
        convention: what the text does not state and the value rests on; empty for nothing.
        reason: why cells that do not agree do not follow from the text.
    """

    paper: str
    table: str
    unit: str = ""
    tolerance: float = 0.1
    decimals: int | None = None
    convention: str = ""
    reason: str = _UNEXPLAINED

    def cell(self, row: str, column: str, printed: float, ours: float | None) -> Cell:
        """Return the cell with its verdict, which follows from the figures alone."""
        cell = Cell(self.paper, self.table, row, column, printed, ours, "agrees", "", self.unit)
        off = cell.deviation_percent
        same = ours is not None and round(ours - printed, 12) == 0.0
        digits = math.inf if self.decimals is None else self.decimals
        rounds = ours is not None and abs(ours - printed) <= 0.5000001 * 10.0**-digits
        meets = same or rounds or (off is not None and abs(off) <= self.tolerance)
        if not meets:
            return replace(cell, verdict="does-not-follow", note=self.reason)
        if self.convention:
            return replace(cell, verdict="agrees-under", note=self.convention)
        return cell
