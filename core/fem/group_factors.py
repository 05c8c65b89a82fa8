"""Factors on groups of a model from matrices: the model with them, and the exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import matmul, mul
from typing import ClassVar

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.slopes import Matrix, TermSlopes
from femubench.core.typing import FloatArray, SparseArray

GROUP, SET, MATERIAL = "group:", "set:", "material:"
PRELOAD = "preload:"  # what a preload adds to the stiffness, which lies in other groups
_ALL = "all"
_MATRIX: dict[str, Matrix] = {"E": "stiffness", "density": "mass"}


@dataclass(frozen=True)
class Groups:
    """The groups of a model from matrices, which are places: ``group:NAME``, and their families.

    Arguments:
        model: any model; one of a frame has none.
    """

    PREFIX: ClassVar[str] = GROUP
    MATERIAL: ClassVar[str] = MATERIAL
    PRELOAD: ClassVar[str] = PRELOAD

    model: Model

    def places(self, matrix: Matrix) -> tuple[str, ...]:
        """Return ``group:NAME`` of every group of a model's stiffness or mass.

        Examples:
            >>> fem.Groups(model).places("stiffness")
            ()
        """
        groups = self.model.groups if matrix == "stiffness" else self.model.mass_groups
        return tuple(f"{GROUP}{name}" for name in groups)

    def families(self, matrix: Matrix) -> tuple[str, ...]:
        """Return ``set:NAME`` and ``material:NAME`` of two groups or more that are not all of them.

        Of equal families only the first is there.

        Examples:
            >>> fem.Groups(model).families("mass")
            ()
        """
        groups = self.model.groups if matrix == "stiffness" else self.model.mass_groups
        found: dict[frozenset[str], str] = {}
        for word, names in self.model.families.items():
            own = groups.keys() & names
            if 1 < len(own) < len(groups):
                found.setdefault(frozenset(names), word)
        return tuple(found.values())

    def names(self, place: str) -> tuple[str, ...]:
        """Return the groups at ``group:NAME`` or of a family; nothing elsewhere.

        Examples:
            >>> fem.Groups(model).names("group:deck")
            ('deck',)
        """
        if place.startswith(GROUP):
            return (place.removeprefix(GROUP),)
        return self.model.families.get(place, ())

    def matrix(self, matrix: Matrix, place: str) -> SparseArray:
        """Return the part of the stiffness or mass at ``all``, a group or a family, sparse (n, n).

        Raises:
            ModelError: when there is no such group.

        Examples:
            >>> fem.Groups(model).matrix("mass", "all").shape
            (81, 81)
        """
        return _part(self.model, matrix, (place,))[1]

    def with_factors(
        self, parameters: Sequence[Property], values: Sequence[float] | FloatArray
    ) -> Model:
        """Return a model from matrices with factors on its groups, which stay its groups.

        Arguments:
            parameters: on E (the stiffness) or density (the mass), at ``all``, groups or families.
            values: factors, (p,).

        Raises:
            ModelError: when there is no such group, or for a parameter that matrices do not have.

        Examples:
            >>> factor = fem.Property("stiffness all", "E", ("all",))
            >>> twice = fem.Groups(model).with_factors([factor], [2.0])
            >>> float(abs(twice.stiffness - 2.0 * model.stiffness).max())
            0.0
        """
        model = self.model
        for parameter, value in zip(parameters, values, strict=True):
            matrix, places, factor = _matrix(parameter), parameter.places, float(value)
            own = "groups" if matrix == "stiffness" else "mass_groups"
            groups, change = dict(getattr(model, own)), getattr(model, f"{matrix}_change")
            names, part = _part(model, matrix, places)
            whole = getattr(model, matrix) + (factor - 1.0) * part
            groups |= {name: factor * groups[name] for name in names}
            if change is not None and _ALL in places:
                change = replace(change, core=factor * change.core)
            scales = (factor, 1.0) if matrix == "stiffness" else (1.0, factor)
            at = {f"{GROUP}{name}" for name in names}
            few = {p: pairs for p, pairs in model.powers.items() if _ALL in places or p in at}
            scaled = replace(model, powers=few).map_powers(*(partial(mul, s) for s in scales))
            powers = {**model.powers, **scaled}
            changed = {matrix: whole, f"{matrix}_change": change, own: groups, "powers": powers}
            model = replace(model, **changed)
        return model


def _matrix(parameter: Property) -> Matrix:
    if parameter.quantity not in _MATRIX:
        raise ModelError(f"{parameter.name}: matrices have no {parameter.quantity}")
    return _MATRIX[parameter.quantity]


def _part(model: Model, matrix: Matrix, places: Sequence[str]) -> tuple[list[str], SparseArray]:
    """Return the groups at some places, each once, and their sum."""
    groups, whole = model.groups, model.stiffness
    if matrix == "mass":
        groups, whole = model.mass_groups, model.mass
    if _ALL in places:
        return list(groups), whole
    found: dict[str, SparseArray] = {}
    for place in places:
        own = {name: groups[name] for name in Groups(model).names(place) if name in groups}
        if not own:
            raise ModelError(f"the {matrix} has no group {place!r}")
        found |= own
    first, *rest = found.values()
    return list(found), sum(rest, start=first)


def group_derivatives(model: Model, parameters: Sequence[Property]) -> TermSlopes:
    """Return the derivatives of stiffness and mass by factors on groups, which are now 1.

    Raises:
        ModelError: as in `Groups.with_factors`.
    """
    own = [(_matrix(p), p.places) for p in parameters]
    parts = tuple((m, partial(matmul, _part(model, m, at)[1])) for m, at in own)
    return TermSlopes(parts, np.eye(len(parts)))
