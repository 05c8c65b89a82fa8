"""What a model gets wrong by itself, as a relative standard deviation that is log-normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.typing import FloatArray


@dataclass(frozen=True)
class Discrepancy:
    """What is known beforehand of the relative standard deviation that a model has of its own.

    Arguments:
        median: of a log-normal prior.
        spread: standard deviation of its logarithm.

    Source: Kennedy & O'Hagan (2001), J. R. Stat. Soc. B 63, 425-464.
    """

    median: float
    spread: float

    def std(self, v: FloatArray) -> FloatArray:
        """Return the standard deviation at standard normal coordinates."""
        return np.asarray(self.median * np.exp(self.spread * v))
