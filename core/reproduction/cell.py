"""One printed cell, our value of it, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from femubench.core.errors import InputError
from femubench.core.reproduction.ground import FAULTS, Ground, Verdict, weakest

_UNEXPLAINED = Ground("does-not-follow", "no reading of the text was found that gives it")
Others = Callable[[], Iterable[float]]


@dataclass(frozen=True)
class Cell:
    """One figure that a paper prints.

    Arguments:
        paper: slug, the word after ``bench reproduce``.
        table: as the paper numbers it, e.g. ``"4d"``.
        row, column: what the paper calls them.
        printed: its figure; an imaginary frequency is a negative one.
        ours: the same from a re-run; None where there is none.
        verdict: what the comparison is worth.
        note: what an agreement rests on, or why there is none.
        unit: of both; ``%`` for a figure that is a percentage itself.
        tried: number of readings that were tried, of a cell that was found by searching.
        page: what it was judged by.
        others: computes ours for other choices of what the paper does not print.
    """

    paper: str
    table: str
    row: str
    column: str
    printed: float
    ours: float | None
    verdict: Verdict
    note: str
    unit: str = ""
    tried: int | None = None
    page: Page | None = field(default=None, repr=False, compare=False)
    others: Others = field(default=tuple, repr=False, compare=False)

    @property
    def deviation_percent(self) -> float | None:
        """Return how far ours is from the printed figure; see `deviation_percent`."""
        return deviation_percent(self.printed, self.ours, self.unit)

    @staticmethod
    def verdict_counts(cells: Sequence[Cell]) -> dict[Verdict, int]:
        """Return the number of cells of every verdict, none left out.

        Examples:
            >>> fit = reproduction.Ground("fitted", "the length is fitted to this frequency")
            >>> page = reproduction.Page("paper", "1", (fit,), unit="Hz", tolerance=0.1)
            >>> cells = [page.cell("mode 1", "FE", 255.8, 255.83)]
            >>> reproduction.Cell.verdict_counts(cells)["fitted"]
            1
        """
        return {
            verdict: sum(cell.verdict == verdict for cell in cells) for verdict in Ground.VERDICTS
        }

    @staticmethod
    def count_different(cells: Sequence[Cell]) -> int:
        """Return how many different figures agree independently: one printed again counts once.

        Examples:
            >>> free = reproduction.Ground("independent", "nothing is chosen for it")
            >>> page = reproduction.Page("paper", "2", (free,), decimals=3)
            >>> cells = [page.cell(m, "mode 1", 1.0, 1.0001) for m in "BCD"]
            >>> reproduction.Cell.count_different(cells)
            1
        """
        return len({(c.paper, c.unit, c.printed) for c in cells if c.verdict == "independent"})


def deviation_percent(printed: float, ours: float | None, unit: str) -> float | None:
    """Return (ours - printed) / |printed| in percent; of percentages, ours - printed.

    None where there is no value of ours, the printed one is zero and ours is not, or one of
    two frequencies is imaginary; two imaginary ones are compared by size.

    Arguments:
        printed, ours, unit: as in `Cell`.
    """
    if ours is None or not math.isfinite(ours):
        return None
    if unit == "%":
        return ours - printed
    if printed == 0.0:
        return 0.0 if ours == 0.0 else None
    if unit == "Hz" and (printed < 0.0 or ours < 0.0):
        # Imaginary frequencies are compared by size, and with nothing else.
        return 100.0 * (ours / printed - 1.0) if max(printed, ours) < 0.0 else None
    return 100.0 * (ours - printed) / abs(printed)


@dataclass(frozen=True)
class Page:
    """Where cells of one kind stand, when they agree, and what that is worth.

    Arguments:
        paper, table: as in `Cell`.
        grounds: all that an agreement rests on; the weakest makes the verdict.
        unit: of the cells.
        tolerance: largest deviation that agrees, in percent (of percentages: in points).
        decimals: digits behind the point in print: what rounds to the printed figure agrees too;
            None for the tolerance alone.
        fault: what a cell is that does not agree, unless it cannot be checked.
        unprinted: what decides a cell whose printed figure lies between ours and `Cell.others`.

    Raises:
        InputError: for no grounds, or where a fault stands among them or something else as fault.
    """

    paper: str
    table: str
    grounds: tuple[Ground, ...]
    unit: str = ""
    tolerance: float = 0.1
    decimals: int | None = None
    fault: Ground = _UNEXPLAINED
    unprinted: str = ""

    def __post_init__(self) -> None:
        """Check that grounds are grounds, and the fault is one."""
        wrong = [ground.verdict for ground in self.grounds if ground.verdict in FAULTS]
        if not self.grounds or wrong or self.fault.verdict not in FAULTS:
            raise InputError(
                f"page {self.paper} {self.table}: grounds {[g.verdict for g in self.grounds]}, "
                f"fault {self.fault.verdict!r} (expected at least one ground, none of them "
                f"{' or '.join(FAULTS)}, and one of these as fault)"
            )

    def cell(
        self, row: str, column: str, printed: float, ours: float | None, others: Others = tuple
    ) -> Cell:
        """Return the cell with its verdict: figures decide whether, grounds for what."""
        deciding = weakest(self.grounds)
        note = "; ".join(dict.fromkeys(ground.words for ground in self.grounds))
        off = deviation_percent(printed, ours, self.unit)
        half = 1e-12 if self.decimals is None else 0.5000001 * 10.0**-self.decimals
        rounds = ours is not None and abs(ours - printed) <= half
        meets = rounds or (off is not None and abs(off) <= self.tolerance)
        if deciding.verdict != "cannot-be-checked" and not meets:
            deciding, note = self.fault, self.fault.words
            found = [x for x in (ours, *others()) if x is not None and math.isfinite(x)]
            if found and min(found) - half <= printed <= max(found) + half:
                words = f"{self.unprinted}, from {min(found):.5g} to {max(found):.5g} {self.unit}"
                deciding, note = Ground("cannot-be-checked", words), f"{words.strip()}; {note}"
        return Cell(
            self.paper, self.table, row, column, printed, ours,
            deciding.verdict, note, self.unit, deciding.tried, self, others,
        )  # fmt: skip
