"""The one way in which a model may change: of strategies, groups and effects alike.

    K(values) = K + sum_i a_i(values) A_i ,   M(values) = M + sum_i b_i(values) B_i

The matrices are never global: each knows the few dofs or elements that it touches, so that a
modal basis is projected on them once and every further value costs a small sum. A factor on
elements or groups of matrices, the stiffness of joint springs, a rigid length: these have no terms,
but name the property from which the matrices are made anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from femubench.core.change.parameter import Parameter
from femubench.core.change.terms import Term, sparse_matrix
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.roles import EffectParameter
from femubench.core.typing import FloatArray

Coefficients = Callable[[FloatArray], FloatArray]
_SLOPE_STEP = 1e-5


def _no_coefficients(values: FloatArray) -> FloatArray:
    return np.zeros((len(values), 0))


@dataclass(frozen=True)
class Change:
    """What a model may change by at a place.

    An effect states the terms, their coefficients and the added dofs; the rest is filled in by
    anyone who places it (`change_of`).

    Arguments:
        terms: fixed matrices.
        coefficients: from values (g, n_parameters) to the factors of the terms (g, n_terms).
        extra: dofs that it adds behind those of the model; they have neither mass nor stiffness
            but what the terms give them.
        name: for tables.
        places: where it sits, in the grammar of places.
        parameters: its values, with unit, prior and range.
        quantity: the property of the places that its only value scales or sets, a key of
            `fem.parameters.QUANTITIES`, in place of terms; empty for none.
    """

    terms: tuple[Term, ...] = ()
    coefficients: Coefficients = _no_coefficients
    extra: int = 0
    name: str = ""
    places: tuple[str, ...] = ()
    parameters: tuple[EffectParameter, ...] = ()
    quantity: str = ""

    @property
    def property(self) -> Property:
        """Return the property that it scales or sets."""
        return Property(self.name, self.quantity, self.places, self.parameters[0].unit)

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and the highest coordinates, (k,) each."""
        low, high = np.array([p.range for p in self.parameters]).T
        return low, high

    def values(self, x: FloatArray) -> FloatArray:
        """Return parameter values of coordinates, (g, k) both."""
        columns = [p.value(x[:, i]) for i, p in enumerate(self.parameters)]
        return np.column_stack(columns)

    def factors(self, x: FloatArray) -> FloatArray:
        """Return the factors of the terms, (g, n_terms), of coordinates, (g, k)."""
        return np.asarray(self.coefficients(self.values(x)))

    def slopes(self, x: FloatArray) -> FloatArray:
        """Return d factors / d x at one point, (k, n_terms); one-sided where a bound is near."""
        low, high = self.bounds
        x = np.clip(x, low, high)
        step = _SLOPE_STEP * np.eye(len(x))
        up, down = np.minimum(x + step, high), np.maximum(x - step, low)
        width = (up - down).diagonal()
        return np.asarray((self.factors(up) - self.factors(down)) / width[:, None])

    def add_to(self, model: Model, values: Sequence[float]) -> Model:
        """Return a model of matrices with the terms added; its groups stay as they are.

        Arguments:
            model: with all dofs that the terms act on, `extra` behind its own.
            values: of the parameters.

        Examples:
            >>> mass = effect.ModelPlaces(model).mass_term([fem.Place(joint="J1")])
            >>> heavier = effect.Change.proportional(mass).add_to(model, [0.5])
            >>> round(heavier.total_mass - model.total_mass, 9)
            0.5
        """
        factors = self.coefficients(np.array([values], dtype=float))[0]
        found = {"mass": model.mass, "stiffness": model.stiffness}
        for term, factor in zip(self.terms, factors, strict=True):
            own = sparse_matrix(term.operator, model.size)
            found[term.matrix] = found[term.matrix] + sp.csc_array(factor * own)
        return replace(model, **found)

    def without_prior(self) -> Change:
        """Return the same with nothing known of its values but their range.

        Examples:
            >>> float(update.Changes(model).stiffness(0.1).without_prior().parameters[0].std)
            inf
        """
        free = tuple(replace(p, std=np.inf) for p in map(parameter_of, self.parameters))
        return replace(self, parameters=free)

    @classmethod
    def proportional(cls, *terms: Term, neutral: float = 0.0) -> Change:
        """Return a change that grows with the distance of one value from its neutral one.

        Examples:
            >>> mass = effect.ModelPlaces(model).mass_term([fem.Place(joint="J1")])
            >>> print(effect.Change.proportional(mass).coefficients(np.array([[0.5]])))
            [[0.5]]
        """
        count = len(terms)
        return cls(terms, lambda values: np.repeat(values[:, :1] - neutral, count, axis=1))

    @classmethod
    def scale_property(
        cls,
        name: str,
        quantity: str,
        places: Sequence[str],
        *,
        prior_std: float | None = None,
        lower: float = 0.05,
        upper: float = 20.0,
        fatal: bool = False,
    ) -> Change:
        """Return a factor on a property of elements or groups.

        Arguments:
            name: for tables.
            quantity: what is multiplied, a key of `fem.parameters.QUANTITIES`.
            places: ``member/k`` for elements, ``group:NAME`` or ``all`` of matrices.
            prior_std: standard deviation of the logarithm; None where nothing is known.
            lower, upper: limits of the factor.
            fatal: whether an optimum at a limit is a divergence rather than a result.

        Examples:
            >>> effect.Change.scale_property("E", "E", ("rung-right/1",)).parameters[0].neutral
            1.0
        """
        return cls.set_property(
            *(name, quantity, places, 1.0, lower, upper), prior_std=prior_std, fatal=fatal, unit=""
        )

    @classmethod
    def set_property(
        cls,
        name: str,
        quantity: str,
        places: Sequence[str],
        start: float,
        lower: float,
        upper: float,
        *,
        unit: str,
        signed: bool = False,
        prior_std: float | None = None,
        fatal: bool = False,
    ) -> Change:
        """Return a property of member ends that is set: a spring's stiffness or a rigid length.

        Arguments:
            name, quantity, prior_std, fatal: as in `scale_property`.
            places: ``member@joint`` for rigid lengths, ``member@joint:direction`` for springs.
            start: the value that the model has.
            lower, upper: limits of the value.
            unit: of the value.
            signed: whether it may change its sign; it then moves by multiples of |start|, else by
                factors, so that it stays positive.

        Examples:
            >>> given = ("a@B:ry",), 1e4, 1.0, 1e7
            >>> soft = effect.Change.set_property("k", "spring", *given, unit="N m/rad")
            >>> float(soft.parameters[0].value(np.log(2.0)))
            20000.0
        """
        own = Parameter(
            name,
            unit,
            abs(start) if signed else 1.0,
            start,
            lower,
            upper,
            "linear" if signed else "log",
            std=np.inf if prior_std is None else prior_std,
            reach=np.inf,
            fatal=fatal,
        )
        return cls(name=name, places=tuple(places), parameters=(own,), quantity=quantity)


def parameter_of(parameter: EffectParameter) -> Parameter:
    """Return a parameter that any class may play as one of ours."""
    if isinstance(parameter, Parameter):
        return parameter
    p = parameter
    given = p.name, p.unit, p.scale, p.neutral, p.lower, p.upper, p.scaling, p.one_sided
    return Parameter(*given, p.textbook, p.wording)
