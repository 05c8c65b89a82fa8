"""Kabe with the free rigid-body modes as further data."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, Strategy, UpdateResult
from femubench.modal import rigid_modes_of
from femubench.update import update_entries


class KabeRigid(Strategy):
    """Correct the non-zero entries of the stiffness matrix and keep its rigid-body modes."""

    name: ClassVar[str] = "kabe-rigid"
    citation: ClassVar[str] = (
        "Kabe, A. M. (1985). Stiffness matrix adjustment using mode data. AIAA Journal 23, "
        "1431-1436; rigid-body modes as in Ahmadian, Gladwell & Ismail (1997), section 4.1"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes"})
    promises: ClassVar[frozenset[str]] = frozenset({"used-modes", "rigid-body-modes"})

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with other entries in the same places and K R = 0.

        Raises:
            SelfCheckFailed: when no matrix of this pattern with the used modes was found.
            StrategyFailure: when a measured mode has no partner in the model.
            NotApplicable: when the matrix has too many entries.
        """
        return update_entries(model, measurement, rigid_modes_of(model)).result
