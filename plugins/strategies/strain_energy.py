"""Localisation by the change of modal strain energy, then a fit of what it names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, UpdateResult
from femubench.fem import FloatArray
from femubench.modal import rigid_modes_of
from femubench.update import ModalSpace, ParametricStrategy, QuasiModes, expand_measured_shapes

_BARE = 1e-6  # of a mode's strain energy: where there is less, its change says nothing
_LARGEST = 5.0


@dataclass(frozen=True)
class StrainEnergy(ParametricStrategy):
    """Name the members whose modal strain energy differs most, and fit their factors alone.

    With the nominal matrix K_j of a member in both, its change ratio in mode i is
    |phi*_i' K_j phi*_i - phi_i' K_j phi_i| / phi_i' K_j phi_i. Ratios of a mode are divided by its
    largest, and their mean over the modes is the index of the member. Members one standard
    deviation above the mean index are fitted to frequencies and MAC.

    Arguments:
        changes: as of `ParametricStrategy`.
        above: standard deviations above the mean index from which a member is named; one is named
            in any case, and no more than there are frequencies.
        shape_weight: of a MAC of 0 against a frequency that is 100 % off, in the fit.

    The authors' are ratio and index, between an undamaged and a damaged state; here the nominal
    model is the first. Ours are the expansion (least force residual, all readings met), how many
    are named, and a nonlinear fit in place of their linear estimate of sizes.
    """

    name: ClassVar[str] = "strain-energy"
    citation: ClassVar[str] = (
        "Shi, Law & Zhang (1998), Structural damage localization from modal strain energy change, "
        "Journal of Sound and Vibration 218, 825-844"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "parts"})

    above: float = 1.0
    shape_weight: float = 0.1

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the factors of the named members.

        Raises:
            NotApplicable: when the model has no such parameters.
            StrategyFailure: when a measured mode has no partner in the model.
        """
        parts = self.parameterise(model)
        paired = QuasiModes.of(model, measurement)
        own = paired.modes.shapes[:, paired.partners]
        shapes = expand_measured_shapes(model, measurement, rigid_modes_of(model))
        shapes = model.mass_normalised(shapes)
        # What softens takes energy: its size counts.
        energies = (np.abs(np.einsum("pjj->pj", parts.energies(s, s))) for s in (own, shapes))
        index = energy_change_index(*energies)
        named = np.flatnonzero(index >= index.mean() + self.above * index.std())
        order = np.argsort(-index, kind="stable")
        count = min(max(len(named), 1), len(measurement))
        chosen = parts.of([int(j) for j in order[:count]])
        while len(chosen) > len(measurement) and count > 1:  # an effect may have several values
            count -= 1
            chosen = parts.of([int(j) for j in order[:count]])
        share, most = self.shape_weight, self.max_solves and max(self.max_solves - 1, 1)
        space = ModalSpace.of(chosen, measurement, shape_weight=share, max_solves=most)
        log, cost = space.fit_bounded(np.zeros(len(chosen)), _LARGEST)
        return self.result(chosen, log, cost=cost, named=float(len(chosen.changes)))


def energy_change_index(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the mean relative change of every member's modal strain energy, 0..1, (p,).

    Arguments:
        before, after: phi_i' K_j phi_i of p members in m modes of unit mass, (p, m).
    """
    known = before > _BARE * before.sum(axis=0)
    ratio = np.where(known, np.abs(after - before) / np.where(known, before, 1.0), 0.0)
    largest = ratio.max(axis=0)
    return np.asarray((ratio / np.where(largest > 0.0, largest, 1.0)).mean(axis=1))
