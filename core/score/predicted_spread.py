"""The standard deviation of every predicted frequency, from samples of a model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from femubench.core.case.case import Modification
from femubench.core.fem.model import Model, neighbours_of
from femubench.core.modal.eigen import Modes
from femubench.core.modal.neighbour_modes import follow_frequencies
from femubench.core.typing import FloatArray, IntArray

MORE = 8  # modes above the highest one that is wanted, which samples may mix with it


@dataclass(frozen=True)
class Spread:
    """What a strategy says of the error of its model.

    Arguments:
        model: the updated one.
        samples: models that are as probable as each other, on the same dofs.
        discrepancy_std: relative standard deviation of a frequency beyond the samples.
    """

    model: Model
    samples: tuple[Model, ...]
    discrepancy_std: float

    def after(self, change: Modification, changed: Model) -> Spread:
        """Return the same for the model with a known modification, `changed`."""
        if change.alteration:
            samples = tuple(change.modify(sample) for sample in self.samples)
        else:
            samples = neighbours_of(self.model, changed, self.samples)
        return replace(self, model=changed, samples=samples)

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
            kept = modes.take(np.arange(min(int(index.max()) + 1 + MORE, len(modes))))
            found = [follow_frequencies(sample, kept)[index[paired]] for sample in self.samples]
            variance[paired] += np.mean(np.square(found - own[paired]), axis=0)
        std = np.sqrt(variance)
        return [float(s) if there else None for s, there in zip(std, paired, strict=True)]
