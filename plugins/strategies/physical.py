"""Physical parameters: one factor on every rigidity of every element."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import (
    Measurement,
    Model,
    Strategy,
    UpdateResult,
    physical_family,
    update_by_equation_error,
)


@dataclass(frozen=True)
class Physical(Strategy):
    """Scale EI and GJ (out of plane), EI and EA (in plane) or all four of every element.

    The factors stay above one hundredth, so the stiffness stays positive semidefinite.

    Arguments:
        orthogonality: whether the orthogonality of the modes adds equations: the paper counts them
            in, and without them the used frequencies are not met.
    """

    name: ClassVar[str] = "physical"
    citation: ClassVar[str] = (
        "Ahmadian, Gladwell & Ismail (1997), Parameter selection strategies in finite element "
        "model updating, section 4.2, table 3"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "elements"})

    orthogonality: bool = True

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with other rigidities.

        Raises:
            StrategyFailure: when a measured mode has no partner in the model.
            SelfCheckFailed: when the stiffness is not positive semidefinite.
            NotApplicable: when there are too many unknowns.
        """
        family = physical_family(model.frame_structure)
        return update_by_equation_error(
            model, measurement, family, orthogonality=self.orthogonality
        )
