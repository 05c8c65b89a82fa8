"""What a strategy hands back, and a base class for strategies: one method to override."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from femubench.core import roles
from femubench.core.display import Shown, count_noun

if TYPE_CHECKING:
    import numpy as np

    from femubench.core.fem.model import Model
    from femubench.core.modal.measurement import Measurement
    from femubench.core.update.uncertainty import Uncertainty


@dataclass(frozen=True)
class ParameterEstimate:
    """One updated parameter.

    Arguments:
        name: e.g. ``"EI all members"``.
        before: value in the nominal model.
        after: value in the updated model.
        unit: of both; empty for a ratio.
        std: standard deviation of ``after``; None where the method gives none.
        places: where on the structure it acts, in the grammar of places, so that drawings show it
            there; nothing where it has no place.
    """

    name: str
    before: float
    after: float
    unit: str = ""
    std: float | None = None
    places: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False)
class UpdateResult(Shown):
    """What a strategy hands back.

    Arguments:
        model: the updated model: on the dofs of the one that was given, or `Model.of` a frame that
            was rebuilt, e.g. with flexible joints, whose dofs are its own. Either way it answers
            `observe` and `attach`.
        parameter_count: number of unknowns that were free to change.
        parameters: the ones that have a name, with values before and after.
        history: one mapping an iteration, e.g. ``{"residual": 0.1}``.
        diagnostics: any further figures, e.g. the rank of a least-squares problem.
        uncertainty: how far the model may be off; None where the method does not say.
    """

    model: Model
    parameter_count: int = 0
    parameters: tuple[ParameterEstimate, ...] = ()
    history: tuple[Mapping[str, float], ...] = ()
    diagnostics: Mapping[str, float] = field(default_factory=dict)
    uncertainty: Uncertainty | None = None

    def rows(self) -> list[tuple[str, str]]:
        """Return the model, and the parameters before and after."""
        unknowns = count_noun(self.parameter_count, "unknown")
        found = [
            ("", f"{unknowns}, {count_noun(len(self.history), 'iteration')}"),
            ("model", self.model.rows()[0][1]),
        ]
        for p in self.parameters:
            std = "" if p.std is None else f", std {p.std:.2g}"
            found.append((p.name, f"{p.before:.5g} -> {p.after:.5g} {p.unit}".rstrip() + std))
        if self.uncertainty is not None:
            samples = count_noun(len(self.uncertainty.samples), "sample")
            std = f"{100.0 * self.uncertainty.discrepancy_std:.2g} %"
            found.append(("uncertainty", f"{samples}, discrepancy of a frequency {std}"))
        return found + [(name, f"{value:.5g}") for name, value in self.diagnostics.items()]


class Strategy(ABC):
    """Base class for updating strategies: override `update`, set `name` and `citation`.

    Nobody has to inherit it: whatever plays `core.roles.StrategyRole` is ranked and checked alike.

    Attributes:
        name: the word after ``bench run -s``.
        citation: author, year, title, equation.
        needs: capabilities that model or measurement must have: ``shapes`` measured mode shapes,
            ``parts`` members of a frame or groups of matrices, whose stiffness has factors,
            ``elements`` element matrices, ``geometry`` members that can be rebuilt with other
            parameters, ``joints`` places where members of a frame meet, ``responses`` measured
            frequency responses.
        promises: what every result keeps (of ``used-modes``, ``used-modes-or-stated``,
            ``rigid-body-modes``, ``no-negative-eigenvalue``); `bench plugins check` measures it.
        settings: other values of its options that are as good a reading of its source, in the words
            after the colon of ``bench run -s``; `benchmarks/tuning.py` compares them.
        baseline: whether it is the one that leaves the model as it is, to compare with.
        yardstick: of one that is a line of every board and has no rank, what it stands for; empty
            for all others.
        cost_reference: whether `bench plugins check` compares time and memory with its own.
        writable: options with which it changes parameters alone and no whole matrix, so that a
            solver's files can hold its model; empty where no option decides that.
        on_request: whether it runs only where it is named.
    """

    name: ClassVar[str]
    citation: ClassVar[str]
    needs: ClassVar[frozenset[str]] = frozenset()
    promises: ClassVar[frozenset[str]] = frozenset()
    settings: ClassVar[tuple[str, ...]] = ()
    baseline: ClassVar[bool] = False
    yardstick: ClassVar[str] = ""
    cost_reference: ClassVar[bool] = False
    writable: ClassVar[str] = ""
    on_request: ClassVar[bool] = False

    @abstractmethod
    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return an updated model.

        Arguments:
            model: the nominal model; must not be changed in place.
            measurement: the used modes and nothing else.
            rng: the only source of randomness that keeps a run reproducible.

        Raises:
            StrategyFailure: when no model can be given, or a self-check fails.
            NotApplicable: when the case lacks something that `needs` cannot express.
        """


if TYPE_CHECKING:

    def _play(result: UpdateResult, strategy: Strategy) -> tuple[roles.Result, roles.StrategyRole]:
        """Let type checkers see that the classes play the roles."""
        return result, strategy
