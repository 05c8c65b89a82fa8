"""Frequencies of a model near another one whose modes are known, mode by mode."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from scipy.optimize import linear_sum_assignment

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import Modes, count_evaluation
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import FloatArray

_SAME = 1e-10  # of the largest: below it two directions of a basis are one


def follow_frequencies(sample: Model, modes: Modes) -> FloatArray:
    """Return the frequencies of a sample's modes that are most like the given ones, (m,), in Hz.

    The given shapes after one step of inverse iteration with the sample's own matrices span the
    space in which its modes are sought.

    Arguments:
        sample: a model near the one that has the modes, on the same dofs.
        modes: of that one, all from the lowest one on.

    Raises:
        ModelError: when there is no elastic mode among them, or the sample cannot be factorised.

    Source: Bathe (1971), subspace iteration; a sample is near enough for one step.
    """
    elastic = modes.eigenvalues[~modes.rigid & (modes.eigenvalues > 0.0)]
    if not len(elastic):
        raise ModelError("the updated model has no elastic mode")
    count_evaluation()
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
