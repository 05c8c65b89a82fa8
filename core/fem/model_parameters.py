"""Parameters set in any model, a frame or matrices with groups, and the derivatives by them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from femubench.core.fem.derivatives import derivatives, element_masses
from femubench.core.fem.group_factors import group_derivatives, with_group_factors
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.typing import FloatArray


class MatrixSlopes(Protocol):
    """dK/dp and dM/dp of several parameters, never as global dense matrices."""

    @property
    def count(self) -> int:
        """Return the number of parameters."""
        ...

    def quadratic(self, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return left_j' dK/dp right_j and the same for dM, two arrays (m, n_parameters)."""
        ...

    def inner(self, left: FloatArray, right: FloatArray) -> FloatArray:
        """Return left' dK/dp right of every parameter, (n_parameters, m_left, m_right)."""
        ...

    def combined(self, vector: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the sum of weights[p] dK/dp @ vector, (n, k), of weights (n_parameters, k)."""
        ...

    def products(self, vector: FloatArray, eigenvalue: float) -> FloatArray:
        """Return (dK/dp - eigenvalue dM/dp) @ vector for every parameter, (n, n_parameters)."""
        ...


def with_values(
    model: Model, parameters: Sequence[Property], values: Sequence[float] | FloatArray
) -> Model:
    """Return a model with parameters set; factors multiply the present properties.

    Arguments:
        model: a frame, of which what an update changed in the matrices is lost, or matrices.
        parameters: at elements and ends of the frame, or at groups of the matrices.
        values: one a parameter.

    Raises:
        ModelError: when there is no such place.
    """
    if model.structure is None:
        return with_group_factors(model, parameters, values)
    return Model.of(model.structure.with_values(parameters, values))


def matrix_slopes(model: Model, parameters: Sequence[Property]) -> MatrixSlopes:
    """Return the derivatives of a model's matrices; factors are taken about 1.

    Raises:
        ModelError: when there is no such place.
    """
    if model.structure is None:
        return group_derivatives(model, parameters)
    return derivatives(model.structure, parameters)


def updated_mass(model: Model) -> float:
    """Return the mass in kg that `mass_slopes` are the slopes of."""
    return model.total_mass if model.structure is None else model.structure.total_mass


def mass_slopes(model: Model, parameters: Sequence[Property]) -> FloatArray:
    """Return d total mass / d factor about the present value in kg, (n_parameters,)."""
    if model.structure is not None:
        return element_masses(model.structure, parameters)
    shift = model.dofs.motions[:, :3]
    heaviest = int(np.einsum("nd,nd->d", shift, model.mass_times(shift)).argmax())
    return group_derivatives(model, parameters).masses(shift[:, heaviest])
