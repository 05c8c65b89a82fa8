"""The standard deviation of every predicted frequency, from samples of a model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
from scipy.optimize import linear_sum_assignment

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model, neighbours_of
from femubench.core.modal.eigen import Modes
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import FloatArray, IntArray

_MORE = 8  # modes above the highest one that is wanted, which samples may mix with it
_SAME = 1e-10  # of the largest: below it two directions of a basis are one


@dataclass(frozen=True)
class Spread:
    """What a strategy says of the error of its model.

    Arguments:
        model: the updated one.
        samples: models that are as probable as each other, on the same dofs.
        discrepancy_std: relative standard deviation of a frequency beside the samples.
    """

    model: Model
    samples: tuple[Model, ...]
    discrepancy_std: float

    def after(self, changed: Model) -> Spread:
        """Return the same for the model with a known modification attached."""
        return replace(
            self, model=changed, samples=neighbours_of(self.model, changed, self.samples)
        )

    def std_of(self, modes: Modes, index: IntArray, measured_std: FloatArray) -> list[float | None]:
        """Return the standard deviation of what a test would find about every prediction, in Hz.

        The variance is the mean square distance of the samples' frequencies from the model's, the
        discrepancy's and the measurement's.

        Arguments:
            modes: of `model`, all from the lowest one on.
            index: of the predicted modes; -1 for a measured mode without partner, (m,).
            measured_std: in Hz, (m,).

        Raises:
            ModelError: when a sample has no modes.
        """
        own = modes.natural_frequencies[index]
        paired = (index >= 0) & (own > 0.0)
        variance = np.square(self.discrepancy_std * own) + np.square(np.nan_to_num(measured_std))
        if self.samples and paired.any():
            kept = modes.take(np.arange(min(int(index.max()) + 1 + _MORE, len(modes))))
            found = [_followed(sample, kept)[index[paired]] for sample in self.samples]
            variance[paired] += np.mean(np.square(found - own[paired]), axis=0)
        std = np.sqrt(variance)
        return [float(s) if there else None for s, there in zip(std, paired, strict=True)]


def _followed(sample: Model, modes: Modes) -> FloatArray:
    """Return the frequencies of a sample's modes that are most like the given ones, (m,), in Hz.

    The given shapes after one step of inverse iteration with the sample's own matrices span the
    space in which its modes are sought.

    Source: Bathe (1971), subspace iteration; a sample is near enough for one step.
    """
    elastic = modes.eigenvalues[~modes.rigid & (modes.eigenvalues > 0.0)]
    if not len(elastic):
        raise ModelError("the updated model has no elastic mode")
    inertia = sample.mass_times(modes.shapes)
    basis = ShiftedModel(sample, -float(elastic[0])).solve(inertia)
    basis = basis / np.linalg.norm(basis, axis=0)
    mass, stiffness = (
        basis.T @ times(basis) for times in (sample.mass_times, sample.stiffness_times)
    )
    size, turn = la.eigh(0.5 * (mass + mass.T))
    kept = size > _SAME * size[-1]
    unit = turn[:, kept] / np.sqrt(size[kept])
    values, vectors = la.eigh(unit.T @ (0.5 * (stiffness + stiffness.T)) @ unit)
    likeness = np.abs(inertia.T @ (basis @ (unit @ vectors)))
    rows, columns = linear_sum_assignment(np.square(likeness), maximize=True)
    found = np.full(len(modes), np.nan)
    found[rows] = values[columns]
    return np.asarray(np.copysign(np.sqrt(np.abs(found)), found) / (2.0 * np.pi))
