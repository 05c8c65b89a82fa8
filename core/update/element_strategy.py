"""The base of strategies that look for other element matrices by their equation error."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, get_args

import numpy as np

from femubench.core.errors import InputError, NotApplicable
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.modal.measurement import Measurement
from femubench.core.update.change_lists import OWN, check_changes, element_sets
from femubench.core.update.element_families import ElementFamily, Family, GroupFamily, tie_unknowns
from femubench.core.update.equation_error import update_by_equation_error
from femubench.core.update.quasi import ITERATIONS, Expansion, Frequencies
from femubench.core.update.strategy import Strategy, UpdateResult


@dataclass(frozen=True)
class ElementStrategy(Strategy):
    """Base class of the element methods: override `family`, set `name` and `citation`.

    Arguments:
        orthogonality: whether the orthogonality of the modes adds equations: the paper counts them
            in, and without them the used frequencies are not met.
        expansion: of measured shapes: `rotation` of the current model's, the paper's equations (16)
            and (17), or `force`, its equation (15) with the nominal model.
        frequencies: that the equations ask for: the `measured` ones, or `nominal`, the nominal
            model's own, which leaves the measured shapes as the only data.
        changes: `own` for the unknowns of the family; else those of the elements of every one
            of the `members`, `sections`, `materials` or `sets` of the case are tied to each other.
        max_solves: iterations at most, an eigenvalue solution each; 0 for all five.

    Attributes:
        OWN: the word for the unknowns of the family.
        keep_rigid: whether rigid-body modes are kept exactly.
        takes_groups: whether groups of matrices get a factor each, too.
    """

    OWN: ClassVar[str] = OWN

    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "elements"})
    keep_rigid: ClassVar[bool] = False
    takes_groups: ClassVar[bool] = False

    settings: ClassVar[tuple[str, ...]] = (
        "orthogonality=false",
        "expansion=force",
        "orthogonality=false,expansion=force",
    )

    orthogonality: bool = True
    expansion: Expansion = "rotation"
    frequencies: Frequencies = "measured"
    changes: str = OWN
    max_solves: int = 0

    def __post_init__(self) -> None:
        check_changes(self.changes, parts_alone=True)
        if self.expansion not in get_args(Expansion):
            raise InputError(f"the expansion is rotation or force, not {self.expansion!r}")
        if self.frequencies not in get_args(Frequencies):
            raise InputError(f"the frequencies are measured or nominal, not {self.frequencies!r}")
        if self.max_solves < 0:
            raise InputError(f"max_solves is {self.max_solves}", expected="0 (no limit) or more")

    @abstractmethod
    def family(self, structure: Structure) -> ElementFamily:
        """Return where the updated element matrices are looked for."""

    def family_of(self, model: Model) -> Family:
        """Return the family of a model, unknowns of one part tied where asked.

        Raises:
            NotApplicable: when the model has no such parts.
        """
        grouped = model.structure is None and self.changes == OWN
        if self.takes_groups and (grouped or self.changes == "groups"):
            return GroupFamily.of(model)
        if self.changes == "groups":
            raise NotApplicable("groups of matrices have no elements: changes=sets of a frame")
        structure = model.frame_structure
        family = self.family(structure)
        if self.changes == OWN:
            return family
        return tie_unknowns(family, element_sets(structure, self.changes))

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with other element matrices.

        Raises:
            StrategyFailure: when a measured mode has no partner in the model.
            SelfCheckFailed: when a promise is not kept: a stiffness that is positive semidefinite
                where element cores are, rigid-body modes where they shall be kept.
            NotApplicable: when there are too many unknowns, or no rigid-body modes to keep.
        """
        family = self.family_of(model)
        return update_by_equation_error(
            model,
            measurement,
            family,
            orthogonality=self.orthogonality,
            keep_rigid=self.keep_rigid,
            expansion=self.expansion,
            frequencies=self.frequencies,
            iterations=min(self.max_solves or ITERATIONS, ITERATIONS),
        )
