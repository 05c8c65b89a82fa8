"""The base of strategies that fit a list of changes in a space of shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.core.update.change_lists import OWN, check_changes
from femubench.core.update.strategy import Strategy


@dataclass(frozen=True)
class ParametricStrategy(Strategy):
    """Base class of updates by a list of changes: override `update`, set `name` and `citation`.

    Factors stay positive, so the stiffness keeps its sign and its rigid-body modes.

    Arguments:
        changes: what may change: a factor on the stiffness of each of the `elements`, `members`,
            `joints`, `sections`, `materials`, `sets` of the case, or `groups` of matrices; an
            effect at its coarsest places, `effect@place` at one; several joined by ``+``; `own` for
            the members of a frame and the groups of matrices.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"parts"})
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes", "no-negative-eigenvalue"})

    changes: str = OWN

    def __post_init__(self) -> None:
        check_changes(self.changes)
