"""Nobari with the rigid-body modes of the structure as hard constraints."""

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
class NobariRigid(Strategy):
    """Change the terms of every element matrix as `nobari` does, rigid-body modes kept exactly.

    What is left are the physical factors, (21), here without bounds: wherever those of `physical`
    stay above theirs, both give the same model.

    Arguments:
        orthogonality: whether the orthogonality of the modes adds equations: the paper counts them
            in, and without them the used frequencies are not met.
    """

    name: ClassVar[str] = "nobari-rigid"
    citation: ClassVar[str] = (
        "Nobari, Robb & Ewins (1993), with the rigid-body modes as data: Ahmadian, Gladwell & "
        "Ismail (1997), section 4.2"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "elements"})

    orthogonality: bool = True

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with other element matrices.

        Raises:
            StrategyFailure: when a measured mode has no partner in the model.
            SelfCheckFailed: when a rigid-body mode is lost.
            NotApplicable: when the model has no free rigid-body modes, or too many unknowns.
        """
        family = nobari_family(model.frame_structure)
        return update_by_equation_error(
            model, measurement, family, orthogonality=self.orthogonality, keep_rigid=True
        )
