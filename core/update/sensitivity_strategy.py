"""The base of strategies that fit a list of changes by the iterative sensitivity method."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from femubench.core.change.change import Change
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.modal.measurement import Measurement
from femubench.core.update.change_lists import OWN, Changes, check_changes
from femubench.core.update.sensitivity_update import UpdateOptions, sensitivity_update
from femubench.core.update.strategy import Strategy, UpdateResult

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class SensitivityStrategy(Strategy):
    """Base class of updates by the sensitivity method: override `own_changes`.

    Arguments:
        options: of the iteration.
        changes: what may change, in place of the strategy's `own` list: a factor on the stiffness
            of each of the `elements`, `members`, `joints`, `sections`, `materials`, `sets` of the
            case, or `groups` of matrices; an effect at its coarsest places, `effect@place` at one;
            several joined by ``+``.

    Attributes:
        OWN: the word for the strategy's own list.
    """

    OWN: ClassVar[str] = OWN

    options: UpdateOptions = field(default_factory=UpdateOptions)
    changes: str = OWN

    def __post_init__(self) -> None:
        check_changes(self.changes)

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the values that fit the used modes."""
        return sensitivity_update(*self.pose(model, measurement), measurement, self.options)

    def pose(
        self, model: Model, measurement: Measurement
    ) -> tuple[Model | Structure, list[Change]]:
        """Return the model to start from, and what may change of it."""
        if self.changes == OWN:
            return self.own_changes(model, measurement)
        return model, self.list_changes(model, measurement)

    @abstractmethod
    def own_changes(
        self, model: Model, measurement: Measurement
    ) -> tuple[Model | Structure, list[Change]]:
        """Return the model to start from, and the changes that the source has."""

    def list_changes(self, model: Model, measurement: Measurement) -> list[Change]:
        """Return the changes that `changes` names, nothing known of them beforehand."""
        return Changes(model).listed(self.changes)
