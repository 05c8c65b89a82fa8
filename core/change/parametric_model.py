"""A model as a function of the coordinates of its changes, with the slopes of its matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from femubench.core.change.change import Change, parameter_of
from femubench.core.change.parameter import Parameter
from femubench.core.change.terms import Term, sparse_matrix, weigh_term
from femubench.core.errors import ModelError, NotApplicable
from femubench.core.fem.model import Model
from femubench.core.fem.model_parameters import (
    find_updated_mass,
    mass_slopes,
    matrix_slopes,
    with_values,
)
from femubench.core.fem.parameters import Property
from femubench.core.fem.slopes import JoinedSlopes, MatrixSlopes, TermSlopes
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.receptances import PredictedResponses
from femubench.core.typing import AnyArray, BoolArray, FloatArray, SparseArray


@dataclass(frozen=True)
class ParametricModel:
    """A model as a function of the coordinates x of its changes.

    It is as it is at x = 0, but for what an effect has at any size: the arms of joints that rotate.

    Changes of properties are made in the frame or the groups; what terms add is summed on top of
    them, on the dofs of the model.

    Arguments:
        model: a frame, or matrices.
        changes: what may change; none adds degrees of freedom.

    Raises:
        NotApplicable: for a change that does.
    """

    model: Model
    changes: tuple[Change, ...]

    def __post_init__(self) -> None:
        for change in self.changes:
            if change.extra:
                raise NotApplicable(
                    f"{change.name} adds degrees of freedom, which this method keeps as they are"
                )

    def __len__(self) -> int:
        return len(self.parameters)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters of all changes, in their order."""
        return tuple(parameter_of(p) for change in self.changes for p in change.parameters)

    @cached_property
    def owners(self) -> tuple[Change, ...]:
        """Return the change of every parameter."""
        return tuple(change for change in self.changes for _ in change.parameters)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return a name for every parameter."""
        pairs = zip(self.owners, self.parameters, strict=True)
        return tuple(c.name if len(c.parameters) == 1 else f"{c.name}: {p.name}" for c, p in pairs)

    @cached_property
    def is_property(self) -> BoolArray:
        """Tell which parameters are properties, (p,)."""
        return np.array([bool(change.quantity) for change in self.owners], dtype=bool)

    @cached_property
    def properties(self) -> tuple[Property, ...]:
        """Return what these scale or set."""
        return tuple(change.property for change in self.owners if change.quantity)

    @cached_property
    def _ranges(self) -> FloatArray:
        return np.array([p.range for p in self.parameters]).reshape(-1, 2).T

    @property
    def lower(self) -> FloatArray:
        """Return the lowest coordinates, (p,)."""
        return np.asarray(self._ranges[0])

    @property
    def upper(self) -> FloatArray:
        """Return the highest coordinates, (p,)."""
        return np.asarray(self._ranges[1])

    @cached_property
    def precision(self) -> FloatArray:
        """Return the inverse variances of the coordinates beforehand, 0 where unknown, (p,)."""
        return 1.0 / np.square([p.std for p in self.parameters])

    def values(self, x: FloatArray) -> FloatArray:
        """Return parameter values of coordinates, (p,) both."""
        return np.array([float(p.value(own)) for p, own in zip(self.parameters, x, strict=True)])

    def growth(self, x: FloatArray) -> FloatArray:
        """Return d value / dx, (p,)."""
        return np.array([p.slope(float(own)) for p, own in zip(self.parameters, x, strict=True)])

    @cached_property
    def _terms(self) -> tuple[tuple[Change, slice], ...]:
        """Return the changes that are sums of terms, with their coordinates."""
        last, found = 0, []
        for change in self.changes:
            first, last = last, last + len(change.parameters)
            if not change.quantity:
                found.append((change, slice(first, last)))
        return tuple(found)

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Return the terms of all changes."""
        return tuple(term for change, _ in self._terms for term in change.terms)

    @cached_property
    def _matrices(self) -> tuple[SparseArray, ...]:
        return tuple(sparse_matrix(term.operator, self.model.size) for term in self.terms)

    @cached_property
    def _weights(self) -> FloatArray:
        return np.array([weigh_term(self.model, term) for term in self.terms])

    def factors(self, x: FloatArray) -> FloatArray:
        """Return the factors of the terms, (n_terms,)."""
        own = [change.factors(x[None, columns])[0] for change, columns in self._terms]
        return np.concatenate([*own, np.zeros(0)])

    def factor_slopes(self, x: FloatArray) -> FloatArray:
        """Return d factor / dx of the terms, (p, n_terms)."""
        found, last = np.zeros((len(self), len(self.terms))), 0
        for change, columns in self._terms:
            first, last = last, last + len(change.terms)
            found[columns, first:last] = change.slopes(x[columns])
        return found

    def at(self, x: FloatArray) -> Model:
        """Return the model at coordinates, (p,).

        Raises:
            ModelError: when there is no such place.
        """
        model = self.model
        if self.properties:
            model = with_values(model, self.properties, self.values(x)[self.is_property])
        if not self.terms:
            return model
        sums = {"stiffness": model.stiffness, "mass": model.mass}
        for factor, term, matrix in zip(self.factors(x), self.terms, self._matrices, strict=True):
            if factor != 0.0:
                sums[term.matrix] = sums[term.matrix] + factor * matrix
        return replace(model, stiffness=sums["stiffness"], mass=sums["mass"])

    def mass(self, x: FloatArray, model: Model) -> float:
        """Return the total mass in kg.

        Arguments:
            x: coordinates, (p,).
            model: the model there.
        """
        # A frame weighs what its members weigh; matrices have the terms in them.
        framed = self.terms and model.structure is not None
        return find_updated_mass(model) + (
            float(self.factors(x) @ self._weights) if framed else 0.0
        )

    def mass_slopes(self, x: FloatArray, model: Model) -> FloatArray:
        """Return d mass / dx in kg, that of a factor about its present value, (p,)."""
        if not self.terms:
            return mass_slopes(model, self.properties)
        found = self.factor_slopes(x) @ self._weights
        if self.properties:
            found[self.is_property] = mass_slopes(model, self.properties)
        return np.asarray(found)

    def slopes(self, x: FloatArray, model: Model) -> MatrixSlopes:
        """Return the slopes of the matrices by x; factors are taken about their present values.

        Arguments:
            x: coordinates, (p,).
            model: the model there.
        """
        if not self.terms:
            return matrix_slopes(model, self.properties)
        terms = self._term_slopes(x)
        if not self.properties:
            return terms
        own, known = np.flatnonzero(~self.is_property), np.flatnonzero(self.is_property)
        parts = (matrix_slopes(model, self.properties), known), (terms.take(own), own)
        return JoinedSlopes(parts, len(self))

    def _term_slopes(self, x: FloatArray) -> TermSlopes:
        parts = tuple((term.matrix, term.operator.apply) for term in self.terms)
        return TermSlopes(parts, self.factor_slopes(x))

    def steps(self, x: FloatArray) -> FloatArray:
        """Return what the units of `slopes` are in x: that of a set value, 1 of all else, (p,)."""
        set_alone = [
            bool(change.quantity) and not change.property.is_factor for change in self.owners
        ]
        return np.where(set_alone, self.growth(x), 1.0)

    def answer(
        self, x: FloatArray, measured: Measurement
    ) -> tuple[PredictedResponses, MatrixSlopes]:
        """Return what gives the responses at coordinates, (p,), and slopes of the matrices by x.

        Raises: as of `responses`.
        """
        model = self.at(x)
        return PredictedResponses.of(model, measured), self.slopes(x, model)

    def responses(self, x: FloatArray, measured: Measurement) -> tuple[AnyArray, AnyArray]:
        """Return receptances H where responses were measured, and dH/dx, complex.

        They have the shapes (n_f, n_responses, n_references) and (..., p). Modes have the measured
        damping ratios of their partners, the usual one without, and keep them as x moves.

        Arguments:
            x: coordinates, (p,).
            measured: with responses, whose lines, sensors and forces hold.

        Raises:
            NotApplicable: when there are no responses.
            ModelError: when there is no such model.

        Examples:
            >>> members = update.Changes(structure).parameterise("members")
            >>> from dataclasses import replace
            >>> held = replace(measurement, responses=responses)
            >>> members.responses(np.zeros(len(members)), held)[1].shape
            (401, 13, 1, 7)
        """
        found, slopes = self.answer(x, measured)
        return found.receptances, found.slopes(slopes) * self.steps(x)

    @cached_property
    def start(self) -> Model:
        """Return the model at x = 0, as near to there as the ranges allow.

        Raises:
            NotApplicable: when changes do not go together: their terms leave no model.
        """
        if not self.terms:
            return self.model
        model = self.at(np.clip(np.zeros(len(self)), self.lower, self.upper))
        try:
            solve_modes(model, 1)
        except ModelError as error:
            names = ", ".join(change.name for change in self.changes)
            raise NotApplicable(f"{names} do not go together in this model: {error}") from None
        return model

    @cached_property
    def start_slopes(self) -> MatrixSlopes:
        """Return the slopes of the matrices by x at the model as it is."""
        return self.slopes(np.zeros(len(self)), self.model)

    def energies(self, left: FloatArray, right: FloatArray) -> FloatArray:
        """Return left_i' dK/dx right_k at the model as it is, (p, m_left, m_right)."""
        return self.start_slopes.inner(left, right)

    def inertias(self, left: FloatArray, right: FloatArray) -> FloatArray | None:
        """Return left_i' dM/dx right_k of the terms there, (p, m_left, m_right); None for none."""
        if not any(term.matrix == "mass" for term in self.terms):
            return None
        return self._term_slopes(np.zeros(len(self))).inner(left, right, "mass")

    def of(self, chosen: Sequence[int]) -> ParametricModel:
        """Return the same model with the changes of some of the parameters only."""
        wanted = {id(self.owners[j]): self.owners[j] for j in chosen}
        return ParametricModel(self.model, tuple(wanted.values()))
