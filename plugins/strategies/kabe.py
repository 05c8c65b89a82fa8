"""Kabe: the smallest relative changes of the non-zero entries of K."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import InputError, Measurement, Model, Strategy, UpdateResult
from femubench.fem import FloatArray
from femubench.modal import rigid_modes_of
from femubench.update import update_entries


@dataclass(frozen=True)
class _Entries(Strategy):
    """Base class of the updates of the non-zero entries.

    Arguments:
        cutoff: directions in which a change of 100 % moves forces by less than this share of the
            inertia forces count as not shown by the modes and stay as they are, > 0.
        least_squares_cutoff: the same where no stiffness of this pattern has the used modes, so
            that the equations are met by least squares only, > 0.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"shapes"})

    settings: ClassVar[tuple[str, ...]] = (
        "cutoff=0.01",
        "cutoff=0.1",
        "least_squares_cutoff=0.1",
        "least_squares_cutoff=1.0",
    )

    cutoff: float = 0.03
    least_squares_cutoff: float = 0.3

    def __post_init__(self) -> None:
        for cutoff in (self.cutoff, self.least_squares_cutoff):
            if not cutoff > 0.0:
                raise InputError(f"the cutoff {cutoff:g} is not positive")

    @abstractmethod
    def find_kept_motions(self, model: Model) -> FloatArray:
        """Return the motions that must stay free of forces, (n, r)."""

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with other entries in the same places.

        Raises:
            StrategyFailure: when a measured mode has no partner in the model, before or after.
            SelfCheckFailed: when no matrix of this pattern with the used modes was found, and it
                is too large for least squares.
            NotApplicable: when the matrix has too many entries.
        """
        cutoffs = self.cutoff, self.least_squares_cutoff
        return update_entries(model, measurement, self.find_kept_motions(model), *cutoffs).result


@dataclass(frozen=True)
class Kabe(_Entries):
    """Correct the non-zero entries of the stiffness matrix, the pattern of zeros kept.

    Nothing ties the entries of an element together, so a free structure may lose its
    rigid-body modes.
    """

    name: ClassVar[str] = "kabe"
    citation: ClassVar[str] = (
        "Kabe, A. M. (1985). Stiffness matrix adjustment using mode data. AIAA Journal 23, "
        "1431-1436; Ahmadian, Gladwell & Ismail (1997), section 4.1"
    )
    promises: ClassVar[frozenset[str]] = frozenset({"used-modes-or-stated"})

    def find_kept_motions(self, model: Model) -> FloatArray:
        """Return no motion."""
        return np.zeros((model.size, 0))


@dataclass(frozen=True)
class KabeRigid(_Entries):
    """Correct the non-zero entries of the stiffness matrix and keep its rigid-body modes."""

    name: ClassVar[str] = "kabe-rigid"
    citation: ClassVar[str] = (
        "Kabe, A. M. (1985). Stiffness matrix adjustment using mode data. AIAA Journal 23, "
        "1431-1436; rigid-body modes as in Ahmadian, Gladwell & Ismail (1997), section 4.1"
    )
    promises: ClassVar[frozenset[str]] = frozenset({"used-modes-or-stated", "rigid-body-modes"})

    def find_kept_motions(self, model: Model) -> FloatArray:
        """Return the free rigid-body motions."""
        return rigid_modes_of(model)
