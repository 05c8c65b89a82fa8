"""An effect at a place as a change: its own, or read off the models that it gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Literal

import numpy as np
import scipy.sparse as sp

from femubench.core.change.change import Change
from femubench.core.change.interpolation import ChebyshevPoints
from femubench.core.change.terms import Term
from femubench.core.errors import ModelError
from femubench.core.fem.model import Model, common_dofs
from femubench.core.modal.factorisation import LU
from femubench.core.roles import Effect, EffectParameter
from femubench.core.typing import FloatArray, IntArray, SparseArray

_MATRICES: tuple[Literal["mass", "stiffness"], ...] = ("mass", "stiffness")
_NODES = {1: 9, 2: 4}
_WIDEST = 3.0  # deviations to either side that a table covers
_AFFINE = 1e-9


def change_of(effect: Effect, model: Model, place: str) -> Change:
    """Return what an effect does at a place, with its parameters.

    Raises:
        ModelError: as `tabulated_change`.
    """
    return place_change(effect, model, place, tuple(effect.parameters(model, place)))


def place_change(
    effect: Effect, model: Model, place: str, parameters: tuple[EffectParameter, ...]
) -> Change:
    """Return the same with parameters that are known."""
    own = getattr(effect, "change", None)
    made: Change = (
        own(model, place) if callable(own) else tabulate_change(effect, model, place, parameters)
    )
    return replace(made, name=effect.name, places=(place,), parameters=parameters)


def tabulate_change(
    effect: Effect, model: Model, place: str, parameters: Sequence[EffectParameter]
) -> Change:
    """Return the change of an effect that does not state one, interpolated between values.

    Polynomials through Chebyshev points in the coordinates of the parameters; dofs that the
    extended model has in addition to those of the nominal one are condensed statically.

    Raises:
        ModelError: for more than two parameters, or when the extended model has lost dofs.
    """
    count = _NODES.get(len(parameters))
    if count is None:
        raise ModelError(f"{effect.name} has {len(parameters)} parameters and states no change()")
    affine = _affine(effect, model, place, parameters) if len(parameters) == 1 else None
    if affine is not None:
        return affine
    ranges = [_within(parameter) for parameter in parameters]
    nodes = [ChebyshevPoints(*bounds, count) for bounds in ranges]
    terms: list[Term] = []
    for point in product(*(own.points for own in nodes)):
        values = [float(p.value(np.array(x))) for p, x in zip(parameters, point, strict=True)]
        mass, stiffness = _difference(model, effect.extend(model, place, values))
        terms += [Term.of("mass", mass), Term.of("stiffness", stiffness)]

    def coefficients(values: FloatArray) -> FloatArray:
        share = np.ones((len(values), 1))
        for i, parameter in enumerate(parameters):
            x = np.array([parameter.coordinate(float(v)) for v in values[:, i]])
            x = np.clip(x, *ranges[i])
            own = nodes[i].shares(x)
            share = (share[:, :, None] * own[:, None, :]).reshape(len(values), -1)
        return np.repeat(share, 2, axis=1)

    return Change(tuple(terms), coefficients)


def _affine(
    effect: Effect, model: Model, place: str, parameters: Sequence[EffectParameter]
) -> Change | None:
    """Return a change that grows with the value itself, None where it does not."""
    (parameter,) = parameters
    if parameter.scaling == "compliance":
        return None
    low, high = parameter.range
    x = np.array([0.25, 1.0]) * (high if high > 0.0 else low) / 3.0
    first, second = (float(v) - parameter.neutral for v in parameter.value(x))
    near, far = (
        _difference(model, effect.extend(model, place, [parameter.neutral + value]))
        for value in (first, second)
    )
    for one, two in zip(near, far, strict=True):
        size = abs(two).max() if two.nnz else 0.0
        if size > 0.0 and abs(one / first - two / second).max() > _AFFINE * size / abs(second):
            return None
    terms = zip(_MATRICES, far, strict=True)
    own = (Term.of(matrix, part / second) for matrix, part in terms if part.nnz)
    return Change.proportional(*own, neutral=parameter.neutral)


def _within(parameter: EffectParameter) -> tuple[float, float]:
    """Return the range of x that is tabulated; a spring is never infinitely stiff."""
    low, high = parameter.range
    low, high = max(low, -_WIDEST), min(high, _WIDEST)
    return (max(low, 1e-6), high) if parameter.scaling == "compliance" else (low, high)


def _difference(model: Model, extended: Model) -> tuple[SparseArray, SparseArray]:
    """Return what the extended model adds to mass and stiffness on the nominal dofs."""
    mass, stiffness = extended.mass, extended.stiffness
    old, new = model.structure, extended.structure
    if extended.size != model.size or (old and new and old.mesh is not new.mesh):
        if old is None or new is None:
            raise ModelError("an effect on matrices must keep the degrees of freedom")
        mass, stiffness = _condensed(mass, stiffness, common_dofs(old, new))
    return sp.csr_array(mass - model.mass), sp.csr_array(stiffness - model.stiffness)


def _condensed(
    mass: SparseArray, stiffness: SparseArray, keep: IntArray
) -> tuple[SparseArray, SparseArray]:
    """Return both matrices on some dofs, the others following statically (Guyan 1965)."""
    rest = np.setdiff1d(np.arange(mass.shape[0]), keep)
    k = sp.csr_array(stiffness)
    unit = sp.eye_array(k.shape[0], format="csr")
    pick = unit[:, keep]
    if len(rest) == 0:
        return sp.csr_array(pick.T @ mass @ pick), sp.csr_array(pick.T @ k @ pick)
    inner, cross = k[rest][:, rest], k[rest][:, keep]
    follow = -sp.csr_array(LU(inner, pivot=0.01).solve(cross.toarray()))
    expand = pick + unit[:, rest] @ follow
    return sp.csr_array(expand.T @ mass @ expand), sp.csr_array(expand.T @ k @ expand)
