"""Parameters set in any model, a frame or matrices with groups, and the derivatives by them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from femubench.core.fem.derivatives import derivatives, element_masses
from femubench.core.fem.group_factors import Groups, group_derivatives
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.slopes import MatrixSlopes
from femubench.core.typing import FloatArray


def with_values(
    model: Model, parameters: Sequence[Property], values: Sequence[float] | FloatArray
) -> Model:
    """Return a model with parameters set; factors multiply the present properties.

    Arguments:
        model: a frame, of which what an update changed in the matrices is lost, or matrices.
        parameters: at elements and ends of the frame, or at groups of the matrices.

    Raises:
        ModelError: when there is no such place.
    """
    if model.structure is None:
        return Groups(model).with_factors(parameters, values)
    return Model.of(model.structure.with_values(parameters, values))


def matrix_slopes(model: Model, parameters: Sequence[Property]) -> MatrixSlopes:
    """Return the derivatives of a model's matrices; factors are taken about 1.

    Raises:
        ModelError: when there is no such place.
    """
    if model.structure is None:
        return group_derivatives(model, parameters)
    return derivatives(model.structure, parameters)


def find_updated_mass(model: Model) -> float:
    """Return the mass in kg that `mass_slopes` are the slopes of."""
    return model.total_mass if model.structure is None else model.structure.total_mass


def mass_slopes(model: Model, parameters: Sequence[Property]) -> FloatArray:
    """Return d total mass / d factor about the present value in kg, (n_parameters,)."""
    if model.structure is not None:
        return element_masses(model.structure, parameters)
    shift = model.dofs.motions[:, :3]
    heaviest = int(np.einsum("nd,nd->d", shift, model.mass_times(shift)).argmax())
    motion = shift[:, [heaviest]]
    return np.asarray(group_derivatives(model, parameters).quadratic(motion, motion)[1][0])
