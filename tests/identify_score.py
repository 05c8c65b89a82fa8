"""How far an identification is from the truth of a synthetic set."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from femubench import Identification
from femubench.modal import mac
from tests.frf_problems import FrfSet

NEAR = 0.02  # relative distance up to which a mode may be the one that is meant
LEVEL = 1.6449  # standard deviations, of intervals that cover 90 %
NAMES = ("frequency", "damping", "shape")


@dataclass(frozen=True)
class Score:
    """One set: what was missed and invented, the largest errors, and errors over their sd."""

    missed: int
    extra: int
    frequency_percent: float
    mac: float
    errors: dict[str, Any]

    @property
    def within(self) -> bool:
        """Tell whether all modes were found, frequencies to 0.05 %, shapes to a MAC of 0.995."""
        return self.missed == 0 and self.frequency_percent < 0.05 and self.mac > 0.995


def score(truth: FrfSet, found: Identification) -> Score:
    """Return how far modes are from the truth; partners are the best by frequency and MAC."""
    shapes = found.shapes.real
    likeness = mac(truth.shapes, shapes)
    apart = np.abs(found.frequencies / truth.frequencies[:, None] - 1.0)
    cost = np.where(apart < NEAR, apart / NEAR - likeness, 10.0)
    rows, columns = linear_sum_assignment(cost)
    good = cost[rows, columns] < 1.0
    rows, columns = rows[good], columns[good]
    own, best = truth.shapes[:, rows], shapes[:, columns]
    scaled = own * (np.sum(own * best, axis=0) / np.sum(own**2, axis=0))
    errors = {
        "frequency": (found.frequencies[columns] - truth.frequencies[rows])
        / found.frequency_std[columns],
        "damping": (found.damping[columns] - truth.damping[rows]) / found.damping_std[columns],
        "shape": ((best - scaled) / found.shape_std[:, columns]).ravel(),
    }
    return Score(
        missed=len(truth.frequencies) - len(rows),
        extra=len(found) - len(rows),
        frequency_percent=100.0 * float(apart[rows, columns].max(initial=0.0)),
        mac=float(likeness[rows, columns].min(initial=1.0)),
        errors=errors,
    )


def covered(scores: Iterable[Score], name: str) -> float:
    """Return the share of true values within the stated intervals of 90 %."""
    errors = np.concatenate([found.errors[name] for found in scores])
    return float(np.mean(np.abs(errors) < LEVEL))
