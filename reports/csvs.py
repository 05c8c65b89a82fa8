"""One line a job, or one line a measured mode, as comma-separated values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import femubench
from femubench.results import RunData

if TYPE_CHECKING:
    import pandas as pd

# A spreadsheet takes a cell that starts like this for a formula and runs it.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


class CsvReporter:
    """One line a job."""

    name, suffix, table = "csv", ".csv", "table"

    def render(self, run: RunData) -> str:
        """Return the rows as CSV."""
        return harmless_csv(getattr(femubench.Run.of(run), self.table))


class ModesCsvReporter(CsvReporter):
    """One line a measured mode of every job."""

    name, suffix, table = "modes-csv", ".modes.csv", "modes"


def harmless_csv(frame: pd.DataFrame) -> str:
    """Return a table as CSV that no spreadsheet runs anything of."""
    safe = frame.map(lambda c: f"'{c}" if isinstance(c, str) and c.startswith(_FORMULA) else c)
    text: str = safe.to_csv(index=False, lineterminator="\n")
    return text.rstrip("\n")
