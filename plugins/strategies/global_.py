"""One stiffness factor for the whole frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, Strategy, UpdateResult
from femubench.update import UpdateOptions, global_stiffness, sensitivity_update


@dataclass(frozen=True)
class Global(Strategy):
    """Scale the stiffness of all members by one factor.

    In plane the factor is on EI, as in the paper. Out of plane and in 3-D it is on E, that is on
    EI, GJ, EA and GA together: with EI alone the torsion of the members would stay as it was, and
    the update would no longer be one of the whole structure.

    Arguments:
        options: of the iteration.

    Source: Horton et al. (1999), table 4(a).
    """

    name: ClassVar[str] = "global"
    citation: ClassVar[str] = (
        "Horton, Gurgenci, Veidt & Friswell (1999), Finite element model updating of the welded "
        "joints in a tubular H-frame, equation (4), table 4(a)"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"geometry"})

    options: UpdateOptions = field(default_factory=UpdateOptions)

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with one factor on all members."""
        structure = model.frame_structure
        unknowns = [global_stiffness(structure)]
        return sensitivity_update(structure, unknowns, measurement, self.options)
