"""Slopes of eigenvalues and mode shapes with respect to model parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.fem.model_parameters import matrix_slopes
from femubench.core.fem.parameters import Property
from femubench.core.fem.slopes import MatrixSlopes
from femubench.core.modal.eigen import Modes
from femubench.core.modal.factorisation import LU
from femubench.core.typing import FloatArray

_REPEATED = 1e-8


def eigenvalue_sensitivities(
    model: Model, modes: Modes, parameters: Sequence[Property] | MatrixSlopes
) -> FloatArray:
    """Return d lambda_j / d p in rad^2/s^2 a unit of the parameter, (m, n_parameters).

    Arguments:
        model: a frame, or matrices with groups.
        modes: some of its modes, mass-normalised.
        parameters: factors are taken about 1, everything else about its present value; or the
            slopes of the matrices, where they are at hand.

    Source: Fox & Kapoor (1968); Horton et al. (1999), equation (2).

    Examples:
        >>> slopes = modal.eigenvalue_sensitivities(model, modes.take([3, 4]), [stiffness])
        >>> np.allclose(slopes[:, 0], modes.eigenvalues[[3, 4]])
        True
    """
    change = matrix_slopes(model, parameters) if isinstance(parameters, Sequence) else parameters
    stiffness, mass = change.quadratic(modes.shapes, modes.shapes)
    return np.asarray(stiffness - modes.eigenvalues[:, None] * mass)


def shape_sensitivities(
    model: Model, modes: Modes, index: int, parameters: Sequence[Property] | MatrixSlopes
) -> FloatArray:
    """Return d phi / d p of one mode, (n, n_parameters).

    Where `modes` holds the full spectrum (small models without massless dofs) the modal sum is
    exact; else Nelson's method solves one sparse bordered system, which is as exact. Within a
    repeated eigenvalue shapes have no derivative of their own: what turns inside its space is
    left out.

    Arguments:
        modes: its modes, mass-normalised; modes that share the eigenvalue must be among them.
        parameters: as in `eigenvalue_sensitivities`.

    Raises:
        ModelError: when the bordered system is singular.

    Source: Fox & Kapoor (1968), full modal sum; Nelson (1976).
    """
    change = matrix_slopes(model, parameters) if isinstance(parameters, Sequence) else parameters
    shape, eigenvalue = modes.shapes[:, index], float(modes.eigenvalues[index])
    gap = eigenvalue - modes.eigenvalues
    same = np.abs(gap) <= _REPEATED * max(abs(eigenvalue), 1.0)
    own = -0.5 * change.quadratic(shape[:, None], shape[:, None])[1][0]  # keeps phi' M phi = 1
    force = change.products(shape, eigenvalue)
    if len(modes) == model.size:
        share = (modes.shapes.T @ force) / np.where(same, np.inf, gap)[:, None]
        share[index] = own
        return np.asarray(modes.shapes @ share)
    # Nelson's method, with the mode at hand alone.
    if model.stiffness_change is not None or model.mass_change is not None:
        raise ModelError("shape sensitivities of a model with low-rank changes need all its modes")
    cluster = modes.shapes[:, same]
    weighted = model.mass_times(cluster)
    right = weighted @ (cluster.T @ force) - force
    # The border replaces Nelson's deleted row: it keeps the matrix symmetric and regular.
    size = np.abs(model.stiffness.diagonal()).mean() / np.linalg.norm(weighted, axis=0)
    border = sp.csc_array(weighted * size)
    dynamic = sp.block_array(
        [[model.stiffness - eigenvalue * model.mass, border], [border.T, None]], format="csc"
    )
    zero = np.zeros((cluster.shape[1], change.count))
    try:
        solved = LU(dynamic, pivot=0.01).solve(np.vstack([right, zero]))
    except RuntimeError as error:
        raise ModelError(f"mode {index + 1}: shape sensitivities have no solution") from error
    particular = np.asarray(solved[: model.size])
    return np.asarray(particular + np.outer(shape, own))
