"""The base of strategies that fit a list of changes in a space of shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from femubench.core.change.parametric_model import ParametricModel
from femubench.core.errors import InputError
from femubench.core.fem.model import Model
from femubench.core.typing import FloatArray
from femubench.core.update.change_lists import OWN, Changes, check_changes
from femubench.core.update.sensitivity_update import estimate_parameters
from femubench.core.update.strategy import Strategy, UpdateResult


@dataclass(frozen=True)
class ParametricStrategy(Strategy):
    """Base class of updates by a list of changes: override `update`, set `name` and `citation`.

    Factors stay positive, so the stiffness keeps its sign and its rigid-body modes.

    Arguments:
        changes: what may change: a factor on the stiffness of each of the `elements`, `members`,
            `joints`, `sections`, `materials`, `sets` of the case, or `groups` of matrices; an
            effect at its coarsest places, `effect@place` at one; several joined by ``+``; `own` for
            the members of a frame and the groups of matrices.
        max_solves: eigenvalue solutions at most, after which the best point so far is the answer;
            0 for no limit. Up to four for the start are made in any case.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"parts"})
    promises: ClassVar[frozenset[str]] = frozenset({"rigid-body-modes", "no-negative-eigenvalue"})

    changes: str = OWN
    max_solves: int = 0

    def __post_init__(self) -> None:
        check_changes(self.changes)
        if self.max_solves < 0:
            raise InputError(f"max_solves is {self.max_solves}", expected="0 (no limit) or more")

    def parameterise(self, model: Model) -> ParametricModel:
        """Return the model with what may change of it, each with a prior.

        Raises:
            NotApplicable: when the model has no such parts, or two factors on the same one.
        """
        return Changes(model).parameterise(self.changes)

    @staticmethod
    def result(
        parametric: ParametricModel,
        x: FloatArray,
        history: Sequence[dict[str, float]] = (),
        **figures: float,
    ) -> UpdateResult:
        """Return the updated model with its parameters.

        Arguments:
            parametric: the nominal model and its changes.
            x: coordinates, (p,).
            history: one mapping an iteration.
            figures: diagnostics.
        """
        estimates = estimate_parameters(parametric, x, None)
        return UpdateResult(parametric.at(x), len(parametric), estimates, tuple(history), figures)
