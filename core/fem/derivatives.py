"""Parameters set in a meshed frame, and the exact derivatives of its matrices by them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.beam import BeamProperties, mass_matrices, stiffness_matrices
from femubench.core.fem.meshed_frame import MeshedFrame
from femubench.core.fem.parameters import QUANTITIES, Parameter
from femubench.core.typing import FloatArray, IntArray, SparseArray

# Young's modulus is in GA too, which the elements know by its inverse.
_DIVIDED = {"E": ("flex_y", "flex_z")}
_STEP = 1e-30


def _targets(structure: MeshedFrame, parameter: Parameter) -> list[tuple[str, IntArray]]:
    """Return (property, element indices) pairs; springs come under the property ``spring``."""
    if parameter.quantity == "spring":
        return [("spring", _lookup(structure.spring_index, parameter))]
    if parameter.quantity == "rigid":
        ends = structure.element_ends
        found = [ends.get(place) for place in parameter.places]
        if None in found:
            raise ModelError(f"{parameter.name}: no member end {parameter.places}")
        pairs = [pair for pair in found if pair is not None]
        return [
            (f"rigid_{end + 1}", np.array([e for e, k in pairs if k == end], dtype=np.int64))
            for end in (0, 1)
            if any(k == end for _, k in pairs)
        ]
    index = _lookup(structure.label_index, parameter)
    return [(name, index) for name in QUANTITIES[parameter.quantity]]


def _exponent(parameter: Parameter, name: str) -> float:
    """Return the power of a factor with which a property grows."""
    return -1.0 if name in _DIVIDED.get(parameter.quantity, ()) else 1.0


def _lookup(positions: Mapping[str, IntArray], parameter: Parameter) -> IntArray:
    missing = [place for place in parameter.places if place not in positions]
    if missing:
        raise ModelError(f"{parameter.name}: there is no place {missing[0]!r}")
    found = [positions[place] for place in dict.fromkeys(parameter.places)]
    return np.concatenate(found) if found else np.zeros(0, dtype=np.int64)


def present_value(structure: MeshedFrame, parameter: Parameter) -> float:
    """Return a parameter's value: 1 for a factor, else the mean rigid length or stiffness."""
    if parameter.is_factor:
        return 1.0
    values = [
        structure.springs[index] if name == "spring" else getattr(structure.properties, name)[index]
        for name, index in _targets(structure, parameter)
    ]
    return float(np.concatenate(values).mean())


def apply_values(
    structure: MeshedFrame, parameters: Sequence[Parameter], values: Sequence[float] | FloatArray
) -> tuple[BeamProperties, FloatArray]:
    """Return element properties and joint springs with the parameters set to the values."""
    arrays = {f.name: getattr(structure.properties, f.name).copy() for f in fields(BeamProperties)}
    springs = structure.springs.copy()
    for parameter, value in zip(parameters, values, strict=True):
        for name, index in _targets(structure, parameter):
            if name == "spring":
                springs[index] = value
            elif parameter.is_factor:
                arrays[name][index] *= value ** _exponent(parameter, name)
            else:
                arrays[name][index] = value
    return BeamProperties(**arrays), springs


@dataclass(frozen=True)
class Derivatives:
    """dK/dp and dM/dp of several parameters, element by element, never as global matrices.

    Arguments:
        stiffness, mass: from a property to the element derivatives, (n_elements, 12, 12).
        weights: from a property to (n_elements, n_parameters), sparse: d property / d parameter.
        gather: local displacements from free dofs, (12 n_elements, n).
        spring_rows: relative displacements of the joint springs, (n_springs, n).
        spring_weights: d stiffness / d parameter, (n_springs, n_parameters).
        count: number of parameters.
    """

    stiffness: dict[str, FloatArray]
    mass: dict[str, FloatArray]
    weights: dict[str, SparseArray]
    gather: SparseArray
    spring_rows: SparseArray
    spring_weights: SparseArray
    count: int

    def quadratic(self, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return left_j' dK/dp right_j and the same for dM, two arrays (m, n_parameters).

        Arguments:
            left, right: vectors on the free dofs, (n, m).
        """
        m = left.shape[1]
        u = (self.gather @ left).reshape(-1, 12, m)
        v = (self.gather @ right).reshape(-1, 12, m)
        stiffness, mass = np.zeros((m, self.count)), np.zeros((m, self.count))
        for name, weight in self.weights.items():
            for batch, total in ((self.stiffness, stiffness), (self.mass, mass)):
                if name in batch:
                    energy = np.einsum("eim,eim->me", u, batch[name] @ v)
                    total += (weight.T @ energy.T).T
        slip = (self.spring_rows @ left) * (self.spring_rows @ right)
        return stiffness + (self.spring_weights.T @ slip).T, mass

    def products(self, vector: FloatArray, eigenvalue: float) -> FloatArray:
        """Return (dK/dp - eigenvalue dM/dp) @ vector for every parameter, (n, n_parameters)."""
        local = (self.gather @ vector).reshape(-1, 12, 1)
        result = np.zeros((len(vector), self.count))
        for name, weight in self.weights.items():
            force = np.zeros(local.shape)
            if name in self.stiffness:
                force += self.stiffness[name] @ local
            if name in self.mass:
                force -= eigenvalue * (self.mass[name] @ local)
            spread = sp.csr_array(sp.kron(weight, np.ones((12, 1)))).multiply(force.reshape(-1, 1))
            result += (self.gather.T @ sp.csr_array(spread)).toarray()
        slip = (self.spring_rows @ vector)[:, None]
        tension = sp.csr_array(self.spring_weights.multiply(slip))
        result += (self.spring_rows.T @ tension).toarray()
        return result


def _element_derivatives(
    properties: BeamProperties, name: str
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return dk/d property and dm/d property by the complex step (Squire & Trapp 1998)."""
    value = getattr(properties, name)
    step = _STEP * max(float(np.abs(value).max(initial=0.0)), 1e-30)
    stepped = replace(properties, **{name: value + 1j * step})
    k, m = (f(stepped).imag / step for f in (stiffness_matrices, mass_matrices))
    return (k if k.any() else None), (m if m.any() else None)


def derivatives(structure: MeshedFrame, parameters: Sequence[Parameter]) -> Derivatives:
    """Return the derivatives of stiffness and mass with respect to parameters.

    Factors are differentiated with respect to the factor at its present value 1, rigid lengths and
    springs with respect to their value.
    """
    entries: dict[str, list[tuple[IntArray, FloatArray, int]]] = {}
    for p, parameter in enumerate(parameters):
        for name, index in _targets(structure, parameter):
            slope = np.ones(len(index))
            if parameter.is_factor:
                present = getattr(structure.properties, name)[index]
                slope = _exponent(parameter, name) * present
            if slope.any():
                entries.setdefault(name, []).append((index, slope, p))
    count, size = len(parameters), len(structure.properties)

    def weights(name: str, rows: int) -> SparseArray:
        listed = entries.get(name, [])
        if not listed:
            return sp.csr_array((rows, count))
        index = np.concatenate([i for i, _, _ in listed])
        data = np.concatenate([d for _, d, _ in listed])
        column = np.concatenate([np.full(len(i), p) for i, _, p in listed])
        return sp.csr_array((data, (index, column)), shape=(rows, count))

    names = [name for name in entries if name != "spring"]
    stiffness, mass = {}, {}
    for name in names:
        k, m = _element_derivatives(structure.properties, name)
        if k is not None:
            stiffness[name] = k
        if m is not None:
            mass[name] = m
    return Derivatives(
        stiffness,
        mass,
        {name: weights(name, size) for name in names},
        structure.gather,
        structure.spring_rows,
        weights("spring", len(structure.springs)),
        count,
    )
