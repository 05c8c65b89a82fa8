"""Conventions that a text leaves open or states otherwise, and the cells under each of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from femubench.core.errors import InputError
from femubench.core.reproduction.cell import Cell
from femubench.core.reproduction.ground import Ground, Verdict

Key = tuple[str, str, str]  # table, row and column of a cell


@dataclass(frozen=True)
class Choice:
    """One way to read a text.

    Arguments:
        label: what is done.
        ours: the cells that it changes, and our values then; None where there is none.
        worth: what an agreement is worth at best.
    """

    label: str
    ours: Mapping[Key, float | None]
    worth: Verdict = "under-convention"

    def under(self, cells: Sequence[Cell]) -> dict[Key, Cell]:
        """Return the cells that a choice changes, judged anew by the bars of their kind.

        What agrees is worth no more than the choice; what cannot be checked stays so.

        Raises:
            InputError: for a cell that is not there, or that does not know how it was judged.

        Examples:
            >>> fit = reproduction.Ground("fitted", "the length is fitted to this frequency")
            >>> page = reproduction.Page("paper", "1", (fit,), unit="Hz", tolerance=0.1)
            >>> key = "1", "mode 1", "FE"
            >>> choice = reproduction.Choice("lumped mass", {key: 300.0})
            >>> found = choice.under([page.cell("mode 1", "FE", 255.8, 255.83)])
            >>> found[key].verdict
            'does-not-follow'
        """
        known = {(cell.table, cell.row, cell.column): cell for cell in cells}
        found = {}
        missed = Ground("does-not-follow", f"the figures do not agree: {self.label}")
        for key, ours in self.ours.items():
            cell = known.get(key)
            if cell is None or cell.page is None:
                raise InputError(f"no judged cell {key}", expected="one of the study's")
            grounds = (*cell.page.grounds, Ground(self.worth, self.label))
            page = replace(cell.page, grounds=grounds, fault=missed)
            found[key] = page.cell(cell.row, cell.column, cell.printed, ours, cell.others)
        return found


@dataclass(frozen=True)
class Convention:
    """A choice that decides cells.

    Arguments:
        title: what is chosen.
        judged: the way in which the verdicts have it.
        choices: the other ways.

    Raises:
        InputError: where it changes no cell.
    """

    title: str
    judged: str
    choices: tuple[Choice, ...]

    def __post_init__(self) -> None:
        """Check that something can be seen to change."""
        if not self.keys:
            raise InputError(f"convention {self.title!r} changes nothing", expected="some cells")

    @property
    def keys(self) -> frozenset[Key]:
        """Return the cells that any choice changes."""
        return frozenset(key for choice in self.choices for key in choice.ours)
