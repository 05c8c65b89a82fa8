"""The role of a strategy: one method that turns a model and a few measured modes into a model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    import numpy as np

    from femubench.core.fem.model import Model
    from femubench.core.modal.measurement import Measurement

CAPABILITIES = ("shapes", "elements", "geometry", "joints")


@dataclass(frozen=True)
class ParameterEstimate:
    """One updated parameter.

    Arguments:
        name: e.g. ``"EI all members"``.
        before: value in the nominal model.
        after: value in the updated model.
        unit: of both; empty for a ratio.
        std: standard deviation of ``after``; None where the method gives none.
    """

    name: str
    before: float
    after: float
    unit: str = ""
    std: float | None = None


@dataclass(frozen=True)
class UpdateResult:
    """What a strategy hands back.

    Arguments:
        model: the updated model: on the dofs of the one that was given, or `Model.of` a frame that
            was rebuilt, e.g. with flexible joints, whose dofs are its own. Either way it answers
            `observe` and `attach`.
        parameter_count: number of unknowns that were free to change.
        parameters: the ones that have a name, with values before and after.
        history: one mapping an iteration, e.g. ``{"residual": 0.1}``.
        diagnostics: any further figures, e.g. the rank of a least-squares problem.
    """

    model: Model
    parameter_count: int = 0
    parameters: tuple[ParameterEstimate, ...] = ()
    history: tuple[Mapping[str, float], ...] = ()
    diagnostics: Mapping[str, float] = field(default_factory=dict)


class Strategy(ABC):
    """Base class of every updating strategy: override `update`, set `name` and `citation`.

    Attributes:
        name: the word after ``bench run -s``.
        citation: author, year, title, equation.
        needs: capabilities (of `CAPABILITIES`) that model or measurement must have: ``shapes``
            measured mode shapes, ``elements`` element matrices, ``geometry`` members that can be
            rebuilt with other parameters, ``joints`` places where members meet.
        promises: what every result keeps (of ``used-modes``, ``rigid-body-modes``,
            ``no-negative-eigenvalue``); `bench plugins check` measures it.
        baseline: whether it is the one that leaves the model as it is, to compare with.
        yardstick: whether `bench plugins check` compares time and memory with its own.
    """

    name: ClassVar[str]
    citation: ClassVar[str]
    needs: ClassVar[frozenset[str]] = frozenset()
    promises: ClassVar[frozenset[str]] = frozenset()
    baseline: ClassVar[bool] = False
    yardstick: ClassVar[bool] = False

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
