"""The base of strategies that change a set of stiffness factors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.core.update.parameter_sets import OWN, checked_set
from femubench.core.update.strategy import Strategy


@dataclass(frozen=True)
class FactorStrategy(Strategy):
    """Base class of updates of stiffness factors: override `update`, set `name` and `citation`.

    Factors stay positive, so the stiffness keeps its sign and its rigid-body modes.

    Arguments:
        parameters: one factor on the stiffness of each of the `elements`, `members`, `sections`,
            `materials`, `sets` of the case, or `groups` of matrices; `own` for the members of a
            frame and the groups of matrices.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"parts"})
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes", "no-negative-eigenvalue"})

    parameters: str = OWN

    def __post_init__(self) -> None:
        checked_set(self.parameters, own=True)
