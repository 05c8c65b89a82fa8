"""Generic element matrices, alike for all elements of a kind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import (
    Measurement,
    Model,
    Strategy,
    Symmetry,
    UpdateResult,
    generic_family,
    update_by_equation_error,
)


@dataclass(frozen=True)
class GenericAdjusted(Strategy):
    """Give the elements at joints of one type, and all plain elements, one generic core each.

    Cores are relative to the nominal element. Where the second end of an element is at the joint,
    the core is turned end for end. They stay positive definite as in `generic-ls`.

    Arguments:
        orthogonality: whether the orthogonality of the modes adds equations: the paper counts them
            in, and without them the used frequencies are not met.
        plain: symmetry of elements that touch no joint; with `half-turn` they have 4 parameters in
            a plane, with `mirror` 4 others, with `full` 3.
        joint: symmetry of elements at a joint; with `none` they have 6 parameters.
    """

    name: ClassVar[str] = "generic-adjusted"
    citation: ClassVar[str] = (
        "Ahmadian, Gladwell & Ismail (1997), section 4.3, table 4, adjusted solution; Gladwell & "
        "Ahmadian (1995), Generic element matrices suitable for finite element model updating"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "elements"})

    orthogonality: bool = True
    plain: Symmetry = "half-turn"
    joint: Symmetry = "none"

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with generic elements.

        Raises:
            StrategyFailure: when a measured mode has no partner in the model.
            SelfCheckFailed: when the stiffness is not positive semidefinite.
            NotApplicable: when there are too many unknowns.
        """
        family = generic_family(
            model.frame_structure, plain=self.plain, joint=self.joint, tied=True
        )
        return update_by_equation_error(
            model, measurement, family, orthogonality=self.orthogonality
        )
