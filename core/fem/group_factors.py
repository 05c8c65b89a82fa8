"""Factors on groups of a model from matrices: the model with them, and the exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.typing import FloatArray, SparseArray

GROUP = "group:"
_ALL = "all"
Matrix = Literal["mass", "stiffness"]
_MATRIX: dict[str, Matrix] = {"E": "stiffness", "density": "mass"}


def group_places(model: Model, matrix: Matrix) -> tuple[str, ...]:
    """Return ``group:NAME`` of every group of a model's stiffness or mass.

    Examples:
        >>> fem.group_places(model, "stiffness")
        ()
    """
    groups = model.groups if matrix == "stiffness" else model.mass_groups
    return tuple(f"{GROUP}{name}" for name in groups)


def group_matrix(model: Model, matrix: Matrix, place: str) -> SparseArray:
    """Return the part of a model's stiffness or mass at ``all`` or ``group:NAME``, sparse (n, n).

    Raises:
        ModelError: when there is no such group.

    Examples:
        >>> fem.group_matrix(model, "mass", "all").shape
        (81, 81)
    """
    groups, whole = model.groups, model.stiffness
    if matrix == "mass":
        groups, whole = model.mass_groups, model.mass
    if place == _ALL:
        return whole
    name = place.removeprefix(GROUP)
    if not place.startswith(GROUP) or name not in groups:
        raise ModelError(f"the {matrix} has no group {place!r}")
    return groups[name]


def with_group_factors(
    model: Model, parameters: Sequence[Property], values: Sequence[float] | FloatArray
) -> Model:
    """Return a model from matrices with factors on its groups, which stay its groups.

    Arguments:
        model: whose groups are as large as they are now.
        parameters: on E (the stiffness) or density (the mass), at ``all`` or groups.
        values: factors, (p,).

    Raises:
        ModelError: when there is no such group, or for a parameter that matrices do not have.

    Examples:
        >>> factor = fem.Property("stiffness all", "E", ("all",))
        >>> twice = fem.with_group_factors(model, [factor], [2.0])
        >>> float(abs(twice.stiffness - 2.0 * model.stiffness).max())
        0.0
    """
    for parameter, value in zip(parameters, values, strict=True):
        matrix, places, factor = _matrix(parameter), parameter.places, float(value)
        own = "groups" if matrix == "stiffness" else "mass_groups"
        groups, change = dict(getattr(model, own)), getattr(model, f"{matrix}_change")
        names = groups if _ALL in places else [place.removeprefix(GROUP) for place in places]
        whole = getattr(model, matrix) + (factor - 1.0) * _part(model, matrix, places)
        groups |= {name: factor * groups[name] for name in names}
        if change is not None and _ALL in places:
            change = replace(change, core=factor * change.core)
        model = replace(model, **{matrix: whole, f"{matrix}_change": change, own: groups})
    return model


def _matrix(parameter: Property) -> Matrix:
    if parameter.quantity not in _MATRIX:
        raise ModelError(f"{parameter.name}: matrices have no {parameter.quantity}")
    return _MATRIX[parameter.quantity]


def _part(model: Model, matrix: Matrix, places: Sequence[str]) -> SparseArray:
    parts = [group_matrix(model, matrix, place) for place in places]
    return sum(parts[1:], start=parts[0])


@dataclass(frozen=True)
class GroupDerivatives:
    """dK/dp and dM/dp of factors on groups, about their present values as 1.

    Arguments:
        parts: what each factor scales, and the matrix.
        size: number of dofs n.
    """

    parts: tuple[tuple[Matrix, SparseArray], ...]
    size: int

    @property
    def count(self) -> int:
        """Return the number of parameters."""
        return len(self.parts)

    def quadratic(self, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return left_j' dK/dp right_j and the same for dM, two arrays (m, n_parameters)."""
        found = {name: np.zeros((left.shape[1], self.count)) for name in ("stiffness", "mass")}
        for p, (matrix, part) in enumerate(self.parts):
            found[matrix][:, p] = np.einsum("nm,nm->m", left, part @ right)
        return found["stiffness"], found["mass"]

    def inner(self, left: FloatArray, right: FloatArray) -> FloatArray:
        """Return left' dK/dp right of every parameter, (n_parameters, m_left, m_right)."""
        found = np.zeros((self.count, left.shape[1], right.shape[1]))
        for p, (matrix, part) in enumerate(self.parts):
            if matrix == "stiffness":
                found[p] = left.T @ (part @ right)
        return found

    def combined(self, vector: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the sum of weights[p] dK/dp @ vector, (n, k), of weights (n_parameters, k)."""
        return self.products(vector, 0.0) @ weights

    def products(self, vector: FloatArray, eigenvalue: float) -> FloatArray:
        """Return (dK/dp - eigenvalue dM/dp) @ vector for every parameter, (n, n_parameters)."""
        result = np.zeros((self.size, self.count))
        for p, (matrix, part) in enumerate(self.parts):
            result[:, p] = (1.0 if matrix == "stiffness" else -eigenvalue) * (part @ vector)
        return result

    def masses(self, shift: FloatArray) -> FloatArray:
        """Return shift' dM/dp shift, (n_parameters,), of a motion of all dofs, (n,)."""
        return np.asarray(self.quadratic(shift[:, None], shift[:, None])[1][0])


def group_derivatives(model: Model, parameters: Sequence[Property]) -> GroupDerivatives:
    """Return the derivatives of stiffness and mass with respect to factors on groups.

    Raises:
        ModelError: as in `with_group_factors`.
    """
    parts: list[tuple[Matrix, SparseArray]] = [
        (_matrix(p), _part(model, _matrix(p), p.places)) for p in parameters
    ]
    return GroupDerivatives(tuple(parts), model.size)
