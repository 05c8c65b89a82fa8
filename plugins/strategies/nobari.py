"""Nobari: one factor on every kind of entry of every element matrix."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import (
    Measurement,
    Model,
    Strategy,
    UpdateResult,
    nobari_family,
    update_by_equation_error,
)


@dataclass(frozen=True)
class Nobari(Strategy):
    """Scale deflection, coupling, slope and rod terms of every element matrix on their own.

    Nothing ties them to each other, so elements lose their rigid-body modes and the stiffness may
    become indefinite: that is the method, not an error.

    Arguments:
        orthogonality: whether the orthogonality of the modes adds equations: the paper counts them
            in, and without them the used frequencies are not met.
    """

    name: ClassVar[str] = "nobari"
    citation: ClassVar[str] = (
        "Nobari, Robb & Ewins (1993), Model updating and joint identification methods: "
        "applications, restrictions and overlap; as in Ahmadian, Gladwell & Ismail (1997), "
        "equation (20), table 3"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "elements"})

    orthogonality: bool = True

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with other element matrices.

        Raises:
            StrategyFailure: when a measured mode has no partner in the model.
            NotApplicable: when there are too many unknowns.
        """
        family = nobari_family(model.frame_structure)
        return update_by_equation_error(
            model, measurement, family, orthogonality=self.orthogonality
        )
