"""Stiffness factors for the elements at the joints."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, Strategy, UpdateResult
from femubench.update import UpdateOptions, groups_within, joint_stiffness, sensitivity_update


@dataclass(frozen=True)
class Local(Strategy):
    """Scale the bending stiffness of the elements that touch joints.

    One factor for every joint type and role: at joints that a member passes, one for the elements
    that branch off and one for the two of the member that passes; else one for all elements of
    the joint. With more groups than measured frequencies all joints count as one type, and if
    need be all their elements as one group. In plane the factors are on EI, else on E.

    Arguments:
        options: of the iteration.

    Source: Horton et al. (1999), table 4(b).
    """

    name: ClassVar[str] = "local"
    citation: ClassVar[str] = (
        "Horton, Gurgenci, Veidt & Friswell (1999), Finite element model updating of the welded "
        "joints in a tubular H-frame, equation (4), table 4(b)"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"geometry", "joints"})

    options: UpdateOptions = field(default_factory=UpdateOptions)

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with factors on the elements at joints."""
        structure = model.frame_structure
        groups = groups_within(structure.frame, len(measurement))
        unknowns = [joint_stiffness(structure, group) for group in groups]
        return sensitivity_update(structure, unknowns, measurement, self.options)
