"""Changes of frequencies between two models that are much alike, paired by shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import linear_sum_assignment

from femubench.core.fem.model import Model
from femubench.core.modal.eigen import Modes, modes_of, zero_tolerance
from femubench.core.modal.pairing import FREQUENCY_WEIGHT
from femubench.core.typing import FloatArray, IntArray

_MARGIN = 4  # modes beyond those wanted, so that a pair may cross the end of the list
_RIGID = 6


def elastic_modes(model: Model, count: int) -> Modes:
    """Return at least `count` elastic modes with a frequency above zero, if there are so many."""
    modes = modes_of(model, min(count + _RIGID, model.size - 1))
    alive = ~modes.rigid & (modes.eigenvalues > zero_tolerance(modes))
    return modes.take(alive)


def match_rows(likeness: FloatArray) -> IntArray:
    """Return the column that belongs to every row, all likenesses together as large as can be.

    Two models on the same dofs: every mode has a partner, in the metric of the mass. What was
    measured at sensors is paired by `pairing.pair_measured`.
    """
    return np.asarray(linear_sum_assignment(likeness, maximize=True)[1])


def frequency_changes(
    model: Model,
    modes: Modes,
    other: Model,
    count: int,
    restrict: Callable[[FloatArray], FloatArray] = np.asarray,
) -> FloatArray:
    """Return f_other / f - 1 of the first modes, paired by shape and, less, by frequency.

    Shapes alone would not do: at the nodes of a coarse mesh a far higher mode of a finer one may
    look like a low mode.

    Arguments:
        other: a model that is much like it.
        restrict: from shapes of the other model to the dofs of the first.
    """
    further = elastic_modes(other, min(count, len(modes)) + _MARGIN)
    count = min(count, len(modes), len(further))
    shapes = restrict(further.shapes)
    norms = np.einsum("ij,ij->j", shapes, model.mass_times(shapes))
    likeness = np.square(model.mass_times(modes.shapes[:, :count]).T @ shapes)
    likeness /= np.maximum(norms, np.finfo(float).tiny)
    ratios = further.eigenvalues[None, :] / modes.eigenvalues[:count, None]
    partner = match_rows(likeness - FREQUENCY_WEIGHT * np.abs(np.log(ratios)) / 2.0)
    ratio = ratios[np.arange(count), partner]
    return np.asarray(np.sqrt(ratio) - 1.0)
