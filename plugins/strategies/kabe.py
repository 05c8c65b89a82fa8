"""Kabe: the smallest relative changes of the non-zero entries of K."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import InputError, Measurement, Model, Strategy, UpdateResult
from femubench.modal import rigid_modes_of
from femubench.update import update_entries


@dataclass(frozen=True)
class Kabe(Strategy):
    """Correct the non-zero entries of the stiffness matrix, the pattern of zeros kept.

    Nothing ties the entries of an element together, so a free structure may lose its
    rigid-body modes.

    Arguments:
        cutoff: directions in which a change of 100 % moves forces by less than this share of the
            inertia forces count as not shown by the modes and stay as they are, > 0.
    """

    name: ClassVar[str] = "kabe"
    citation: ClassVar[str] = (
        "Kabe, A. M. (1985). Stiffness matrix adjustment using mode data. AIAA Journal 23, "
        "1431-1436; Ahmadian, Gladwell & Ismail (1997), section 4.1"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes"})
    promises: ClassVar[frozenset[str]] = frozenset({"used-modes"})

    cutoff: float = 0.03

    def __post_init__(self) -> None:
        if not self.cutoff > 0.0:
            raise InputError(f"the cutoff {self.cutoff:g} is not positive")

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with other entries in the same places.

        Raises:
            SelfCheckFailed: when no matrix of this pattern with the used modes was found.
            StrategyFailure: when a measured mode has no partner in the model.
            NotApplicable: when the matrix has too many entries.
        """
        none = np.zeros((model.size, 0))
        return update_entries(model, measurement, none, self.cutoff).result


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
