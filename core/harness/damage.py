"""What is wrong with a file of records: an error for who writes to it, a note for who reads."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from femubench.core.errors import InputError

_MOST_NOTES = 3


class Damage:
    """Lines that are no records of this version.

    Arguments:
        lenient: whether they are left out and counted, instead of being an error.
    """

    def __init__(self, lenient: bool) -> None:
        self.lenient = lenient
        self._faults: list[InputError] = []

    @contextmanager
    def told(self) -> Iterator[None]:
        """Keep an error of the block, where lenient."""
        try:
            yield
        except InputError as error:
            if not self.lenient:
                raise
            self._faults.append(error)

    def notes(self, file: Path) -> list[str]:
        """Return a line for each of the first ones and one for the others."""
        shown = [
            f"{' '.join(str(fault).split())}: left out" for fault in self._faults[:_MOST_NOTES]
        ]
        more = len(self._faults) - len(shown)
        if more:
            lines = "line was" if more == 1 else "lines were"
            shown.append(f"{file}: {more} more {lines} left out")
        return shown
