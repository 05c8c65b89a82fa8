"""The base of strategies that change a set of stiffness factors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.core.update.parameter_sets import checked_set
from femubench.core.update.strategy import Strategy


@dataclass(frozen=True)
class FactorStrategy(Strategy):
    """Base class of updates of stiffness factors: override `update`, set `name` and `citation`.

    Factors stay positive, so the stiffness keeps its sign and its rigid-body modes. Element
    matrices are needed, except where the factors are those of groups of matrices.

    Arguments:
        parameters: one factor on the stiffness of each of the `elements`, `members`, `sections`,
            `materials`, `sets` of the case, or `groups` of matrices.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"elements"})
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes", "no-negative-eigenvalue"})

    parameters: str = "members"

    def __post_init__(self) -> None:
        checked_set(self.parameters)
        if self.parameters == "groups":
            object.__setattr__(self, "needs", self.needs - {"elements"})
