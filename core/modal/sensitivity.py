"""Derivatives of eigenvalues and mode shapes with respect to model parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from femubench.core.fem.parameters import Derivatives, Parameter, derivatives
from femubench.core.modal.eigen import Modes
from femubench.core.model import Model
from femubench.core.typing import FloatArray

_REPEATED = 1e-8


def eigenvalue_sensitivities(
    model: Model, modes: Modes, parameters: Sequence[Parameter]
) -> FloatArray:
    """Return d lambda_j / d p in rad^2/s^2 a unit of the parameter, (m, n_parameters).

    Arguments:
        model: a frame model.
        modes: some of its modes, mass-normalised.
        parameters: factors are taken about 1, everything else about its present value.

    Source: Fox & Kapoor (1968); Horton et al. (1999), equation (2).
    """
    change = derivatives(model.frame_structure, parameters)
    stiffness, mass = change.quadratic(modes.shapes, modes.shapes)
    return np.asarray(stiffness - modes.eigenvalues[:, None] * mass)


def shape_sensitivities(
    model: Model, modes: Modes, index: int, parameters: Sequence[Parameter]
) -> FloatArray:
    """Return d phi / d p of one mode, (n, n_parameters).

    Where `modes` holds the full spectrum the modal sum is exact; else Nelson's method solves one
    sparse bordered system.

    Arguments:
        model: a frame model.
        modes: its modes, mass-normalised.
        index: which of them.
        parameters: as in `eigenvalue_sensitivities`.

    Source: Fox & Kapoor (1968), full modal sum; Nelson (1976).
    """
    change = derivatives(model.frame_structure, parameters)
    if len(modes) == model.size:
        return _modal_sum(modes, index, change)
    return _nelson(model, modes, index, change)


def _modal_sum(modes: Modes, index: int, change: Derivatives) -> FloatArray:
    shapes, eigenvalue = modes.shapes, modes.eigenvalues[index]
    shape = shapes[:, index]
    force = change.products(shape, float(eigenvalue))
    gap = eigenvalue - modes.eigenvalues
    scale = max(abs(float(eigenvalue)), float(np.abs(modes.eigenvalues).min()), 1.0)
    apart = np.abs(gap) > _REPEATED * scale
    factor = np.where(apart, 1.0 / np.where(apart, gap, 1.0), 0.0)
    share = factor[:, None] * (shapes.T @ force)
    share[index] = -0.5 * _mass_part(shape, change)
    return np.asarray(shapes @ share)


def _mass_part(shape: FloatArray, change: Derivatives) -> FloatArray:
    """Return phi' dM/dp phi, (n_parameters,)."""
    return change.quadratic(shape[:, None], shape[:, None])[1][0]


def _nelson(model: Model, modes: Modes, index: int, change: Derivatives) -> FloatArray:
    shape, eigenvalue = modes.shapes[:, index], float(modes.eigenvalues[index])
    weighted = model.mass_times(shape[:, None])[:, 0]
    force = change.products(shape, eigenvalue)
    stiffness, mass = change.quadratic(shape[:, None], shape[:, None])
    right = np.outer(weighted, stiffness[0] - eigenvalue * mass[0]) - force
    # The border replaces Nelson's deleted row: it keeps the matrix symmetric and regular.
    size = np.abs(model.stiffness.diagonal()).mean() / np.linalg.norm(weighted)
    border = sp.csc_array((weighted * size)[:, None])
    dynamic = sp.block_array(
        [[model.stiffness - eigenvalue * model.mass, border], [border.T, None]], format="csc"
    )
    solved = splu(sp.csc_matrix(dynamic)).solve(np.vstack([right, np.zeros((1, change.count))]))
    particular = np.asarray(solved[:-1])
    return np.asarray(particular - 0.5 * np.outer(shape, mass[0]))


def frequency_sensitivities(
    model: Model, modes: Modes, parameters: Sequence[Parameter]
) -> FloatArray:
    """Return d f_j / d p in Hz a unit of the parameter, elastic modes only, (m, n_parameters)."""
    slope = eigenvalue_sensitivities(model, modes, parameters)
    omega = np.sqrt(np.abs(modes.eigenvalues))[:, None]
    return np.asarray(slope / (4.0 * np.pi * omega))
