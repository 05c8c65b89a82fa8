"""Parameters set in a meshed frame, and the exact derivatives of its matrices by them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError
from femubench.core.fem.beam import BeamProperties
from femubench.core.fem.meshed_frame import MeshedFrame
from femubench.core.fem.parameters import QUANTITIES, Property
from femubench.core.typing import FloatArray, IntArray, SparseArray

# GA, which the elements know by its inverse, goes with Young's modulus and with a plane of bending.
_DIVIDED = dict.fromkeys(("E", "bending ry", "bending rz"), ("flex_y", "flex_z"))
_STEP = 1e-30
_SPRING, _RIGID, _KEPT = "spring", "rigid", "touched"
_MASS = ("rhoA", "rhoJp", "density", "rotary")
_BOTH = ("EI", "shear")  # the shape of a shear-flexible element, and with it its mass


@dataclass(frozen=True)
class Touched:
    """Which elements, springs or ends the parameters of one kind touch, in their order.

    Arguments:
        kind: a quantity that is a factor, ``spring``, or the property of a rigid end.
        rows: elements or springs, (n_pairs,).
        columns: the parameter of every row, (n_pairs,).
    """

    kind: str
    rows: IntArray
    columns: IntArray

    def incidence(self, rows: int, parameters: int) -> SparseArray:
        """Return 1 where a parameter touches a row, sparse (n_parameters, rows)."""
        found = self._incidence.get((rows, parameters))
        if found is None:
            pairs = np.ones(len(self.rows)), (self.columns, self.rows)
            found = sp.csr_array(pairs, shape=(parameters, rows))
            self._incidence[rows, parameters] = found
        return found

    @cached_property
    def _incidence(self) -> dict[tuple[int, int], SparseArray]:
        return {}

    @property
    def is_factor(self) -> bool:
        """Tell whether the parameters multiply what is there."""
        return self.kind in QUANTITIES and self.kind != _SPRING

    @property
    def slopes(self) -> tuple[tuple[str, float], ...]:
        """Return the properties that grow with a factor, and with which power of it."""
        divided = _DIVIDED.get(self.kind, ())
        names = QUANTITIES.get(self.kind, ())
        return tuple((name, -1.0 if name in divided else 1.0) for name in names)


def list_touched(structure: MeshedFrame, parameters: Sequence[Property]) -> tuple[Touched, ...]:
    """Return what parameters touch, kind by kind; those of the last call are kept.

    Raises:
        ModelError: when there is no such place.
    """
    wanted = tuple(parameters)
    kept = structure.kept.get(_KEPT)
    if kept is None or kept[0] != wanted:
        kept = structure.kept[_KEPT] = (wanted, _resolved(structure, wanted))
    found: tuple[Touched, ...] = kept[1]
    return found


def _resolved(structure: MeshedFrame, parameters: Sequence[Property]) -> tuple[Touched, ...]:
    kinds: dict[str, list[int]] = {}
    for p, parameter in enumerate(parameters):
        kinds.setdefault(parameter.quantity, []).append(p)
    found = []
    for kind, numbers in kinds.items():
        if kind == _RIGID:
            found += _rigid_ends(structure, parameters, numbers)
            continue
        positions = structure.spring_index if kind == _SPRING else structure.place_index
        places = [_places(parameters[p]) for p in numbers]
        named = list(chain.from_iterable(places))
        try:
            rows = list(map(positions.__getitem__, named))
        except KeyError:
            pairs = ((p, place) for p, own in zip(numbers, places, strict=True) for place in own)
            p, place = next(pair for pair in pairs if pair[1] not in positions)
            raise ModelError(f"{parameters[p].name}: there is no place {place!r}") from None
        columns = np.repeat(np.array(numbers, dtype=np.int64), list(map(len, places)))
        every = np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
        if len(every) > len(rows):  # split elements
            columns = np.repeat(columns, list(map(len, rows)))
        found.append(Touched(kind, every, columns))
    return tuple(found)


def _places(parameter: Property) -> Collection[str]:
    places = parameter.places
    return places if len(places) < 2 else dict.fromkeys(places)


def _rigid_ends(
    structure: MeshedFrame, parameters: Sequence[Property], numbers: Sequence[int]
) -> list[Touched]:
    ends = structure.element_ends
    found: tuple[list[tuple[int, int]], list[tuple[int, int]]] = ([], [])
    for p in numbers:
        for place in _places(parameters[p]):
            if place not in ends:
                raise ModelError(f"{parameters[p].name}: no member end {place!r}")
            element, end = ends[place]
            found[end].append((element, p))
    tables = [np.array(pairs, dtype=np.int64).reshape(-1, 2) for pairs in found]
    return [Touched(f"{_RIGID}_{k + 1}", *table.T) for k, table in enumerate(tables) if len(table)]


def apply_values(
    structure: MeshedFrame, parameters: Sequence[Property], values: Sequence[float] | FloatArray
) -> tuple[BeamProperties, FloatArray]:
    """Return element properties and joint springs with the parameters set to the values."""
    given = np.asarray(values, dtype=float)
    if len(given) != len(parameters):
        raise ValueError(f"{len(parameters)} parameters have {len(given)} values")
    own, springs = structure.properties, structure.springs
    arrays: dict[str, FloatArray] = {}
    for part in list_touched(structure, parameters):
        value = given[part.columns]
        for name in (part.kind,) if not part.is_factor else (n for n, _ in part.slopes):
            if name not in arrays:
                arrays[name] = (springs if name == _SPRING else getattr(own, name)).copy()
        if not part.is_factor:
            arrays[part.kind][part.rows] = value
        for name, exponent in part.slopes:
            np.multiply.at(arrays[name], part.rows, value**exponent)
    springs = arrays.pop(_SPRING, springs)
    return replace(own, **arrays), springs


@dataclass(frozen=True)
class ElementSlopes:
    """How the element matrices move with the parameters of one kind.

    Arguments:
        incidence: 1 where a parameter touches an element, sparse (n_parameters, n_elements).
        stiffness, mass: of every element by a parameter that touches it, (n_elements, 12, 12);
            None where there is none.
    """

    incidence: SparseArray
    stiffness: FloatArray | None
    mass: FloatArray | None


@dataclass(frozen=True)
class Derivatives:
    """dK/dp and dM/dp of several parameters, element by element, never as global matrices.

    Arguments:
        parts: one a kind of parameter.
        gather: local displacements from free dofs, (12 n_elements, n).
        spring_rows: relative displacements of the joint springs, (n_springs, n).
        springs: 1 where a parameter is a spring's stiffness, sparse (n_parameters, n_springs).
    """

    parts: tuple[ElementSlopes, ...]
    gather: SparseArray
    spring_rows: SparseArray
    springs: SparseArray

    @property
    def count(self) -> int:
        """Return the number of parameters."""
        return int(self.springs.shape[0])

    def quadratic(self, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return left_j' dK/dp right_j and the same for dM, two arrays (m, n_parameters).

        Arguments:
            left, right: vectors on the free dofs, (n, m).
        """
        m = left.shape[1]
        u = (self.gather @ left).reshape(-1, 12, m)
        v = u if right is left else (self.gather @ right).reshape(-1, 12, m)
        stiffness, mass = np.zeros((self.count, m)), np.zeros((self.count, m))
        for part in self.parts:
            for batch, total in ((part.stiffness, stiffness), (part.mass, mass)):
                if batch is not None:
                    total += part.incidence @ np.einsum("eim,eim->em", u, batch @ v)
        if self.spring_rows.shape[0]:
            slip = self.spring_rows @ left
            stiffness += self.springs @ (slip * (self.spring_rows @ right))
        return stiffness.T, mass.T

    def inner(self, left: FloatArray, right: FloatArray, matrix: str = "stiffness") -> FloatArray:
        """Return left' dK/dp right, or that of the mass, (n_parameters, m_left, m_right)."""
        u = (self.gather @ left).reshape(-1, 12, left.shape[1])
        v = (self.gather @ right).reshape(-1, 12, right.shape[1])
        found = np.zeros((self.count, left.shape[1], right.shape[1]))
        for part in self.parts:
            batch = part.stiffness if matrix == "stiffness" else part.mass
            if batch is not None:
                force = batch @ v
                for i in range(left.shape[1]):  # all at once are as many as elements times m^2
                    found[:, i] += part.incidence @ np.einsum("ei,eim->em", u[:, :, i], force)
        if self.spring_rows.shape[0] and matrix == "stiffness":
            slips = (self.spring_rows @ left)[:, :, None] * (self.spring_rows @ right)[:, None]
            found += (self.springs @ slips.reshape(len(slips), -1)).reshape(found.shape)
        return found

    def combine(self, vector: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the sum of weights[p] dK/dp @ vector, (n, k).

        Arguments:
            vector: on the free dofs, (n,).
            weights: (n_parameters, k).
        """
        local = (self.gather @ vector).reshape(-1, 12, 1)
        result = self.spring_rows.T @ (
            (self.spring_rows @ vector)[:, None] * (self.springs.T @ weights)
        )
        for part in self.parts:
            if part.stiffness is not None:
                force = (part.stiffness @ local) * (part.incidence.T @ weights)[:, None]
                result = result + self.gather.T @ force.reshape(-1, weights.shape[1])
        return np.asarray(result)

    def products(self, vector: FloatArray, eigenvalue: float) -> FloatArray:
        """Return (dK/dp - eigenvalue dM/dp) @ vector for every parameter, (n, n_parameters)."""
        local = (self.gather @ vector).reshape(-1, 12, 1)
        result = np.zeros((len(vector), self.count))
        for part in self.parts:
            force = np.zeros(local.shape)
            if part.stiffness is not None:
                force += part.stiffness @ local
            if part.mass is not None:
                force -= eigenvalue * (part.mass @ local)
            pairs = sp.coo_array(part.incidence)
            rows = (12 * pairs.col[:, None] + np.arange(12)).ravel()
            spread = sp.csr_array(
                (force[pairs.col].ravel(), (rows, np.repeat(pairs.row, 12))),
                shape=(self.gather.shape[0], self.count),
            )
            result += (self.gather.T @ spread).toarray()
        if self.spring_rows.shape[0]:
            tension = self.springs.multiply(self.spring_rows @ vector)
            result += (self.spring_rows.T @ sp.csr_array(tension).T).toarray()
        return result


def derivatives(structure: MeshedFrame, parameters: Sequence[Property]) -> Derivatives:
    """Return the derivatives of stiffness and mass with respect to parameters.

    Factors are differentiated with respect to the factor at its present value 1, rigid lengths and
    springs with respect to their value.

    Raises:
        ModelError: when there is no such place.
    """
    count, size = len(parameters), len(structure.properties)
    springs = sp.csr_array((count, len(structure.springs)))
    parts = []
    for part in list_touched(structure, parameters):
        if part.kind == _SPRING:
            springs = part.incidence(len(structure.springs), count)
        else:
            # A factor on E leaves the shape of every element, and so its mass, as it is.
            if part.is_factor:
                values = {
                    name: getattr(structure.properties, name) * (1.0 + 1j * exponent * _STEP)
                    for name, exponent in part.slopes
                }
            else:
                values = {part.kind: getattr(structure.properties, part.kind) + 1j * _STEP}
            stepped = replace(structure.properties, **values)
            shear = part.kind in _BOTH and structure.properties.shear_shape.any()
            k = None if part.kind in _MASS else stepped.stiffness_matrices().imag / _STEP
            m = stepped.mass_matrices().imag / _STEP if part.kind in _MASS or shear else None
            parts.append(ElementSlopes(part.incidence(size, count), k, m))
    return Derivatives(tuple(parts), structure.gather, structure.spring_rows, springs)


def element_masses(structure: MeshedFrame, parameters: Sequence[Property]) -> FloatArray:
    """Return d mass / d factor about the present value in kg, (n_parameters,)."""
    p = structure.properties
    mass = p.rhoA * (p.length - p.rigid_mass_1 - p.rigid_mass_2)
    result = np.zeros(len(parameters))
    for part in list_touched(structure, parameters):
        if part.kind in ("rhoA", "density"):
            result += part.incidence(len(p), len(parameters)) @ mass
    return result
