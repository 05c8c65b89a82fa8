"""Modal data and their derivatives by the changes of a model, in a space of its shapes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.linalg as la
from scipy.optimize import least_squares

from femubench.core.change.parametric_model import ParametricModel
from femubench.core.errors import ModelError, StrategyFailure
from femubench.core.fem.model import Model
from femubench.core.modal.correlation import find_seen_modes
from femubench.core.modal.eigen import (
    DENSE_LIMIT,
    Evaluations,
    Modes,
    count_evaluation,
    enough_modes,
    solve_modes,
)
from femubench.core.modal.group_prior import STRUCTURE_STD
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import WINDOW_WITHOUT_SHAPE, pair_modes
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import BoolArray, FloatArray, IntArray

_SPARE = 10  # modes above the measured ones that may become their partners
_LOST = 1.0 - 1.0 / WINDOW_WITHOUT_SHAPE  # what a mode without a partner counts as, relative
_DEPENDENT = 1e-8
_NO_MODEL = 10.0  # more than any residual of a model
_LONGEST = 0.5  # step of ln theta
_HALVINGS = 6
_ITERATIONS, _SMALL = 20, 1e-3
_EVALUATIONS, _TOLERANCE = 30, 1e-6
_MOST_FORCES = 4_000_000  # numbers, 32 MB
_INSIDE = 0.999  # a start at a bound could not leave it
_LARGEST_LOG = np.log(5.0)  # a factor beyond 1/5 .. 5 is no error of a stiffness,
_WIDER = 3.0  # but of a support, whose bounds are so many times as wide in ln theta at most


@dataclass(frozen=True)
class ModalFit:
    """How a model with some factors meets the measured modes.

    Arguments:
        residual: relative errors of the frequencies, then the weighted misfit of shapes of unit
            length, (m + m n_sensors,) or (m,).
        slope: d residual / dx, (n_rows, p).
        paired: how many measured modes have a partner.
    """

    residual: FloatArray
    slope: FloatArray
    paired: int

    @property
    def cost(self) -> float:
        """Return the sum of squares."""
        return float(self.residual @ self.residual)


@dataclass(frozen=True)
class ModalSpace:
    """The problem K phi = lambda M phi in a space of shapes, as a function of the coordinates x.

    x is ln theta of a factor on stiffness, and the coordinate of an effect. Rigid-body motions are
    part of it where an effect may give them stiffness or mass.

    Arguments:
        measurement: the used modes.
        parametric: the model with its changes.
        stiffness, mass: V' K_0 V and V' M_0 V, (r, r), V being orthonormal with the mass where it
            was taken.
        parts: V' K_j V of the factors on stiffness, (p_factors, r, r).
        terms: V' A_t V of the terms of effects, (n_terms, r, r).
        readings: of the shapes at the sensors, (n_sensors, r).
        shape_weight: of a shape error of 1 (MAC of 0) against a frequency error of 1 (100 %); 0 to
            leave shapes out.
        scaled: the model's shapes by their share along the measured ones, `length`, or to agree
            with them where these are `largest`.
        solves: eigenvalue solutions made so far, that of the shapes included.
    """

    measurement: Measurement
    parametric: ParametricModel
    stiffness: FloatArray
    mass: FloatArray
    parts: FloatArray
    terms: FloatArray
    readings: FloatArray
    shape_weight: float
    scaled: str = "length"
    solves: Evaluations = field(default_factory=Evaluations)

    @cached_property
    def spread(self) -> FloatArray:
        """Return the prior deviations of the coordinates, in that of a structure's ln E, (p,)."""
        std = np.array([p.std for p in self.parametric.parameters])
        return np.where(np.isfinite(std), std / STRUCTURE_STD, 1.0)

    @cached_property
    def _is_mass(self) -> BoolArray:
        return np.array([term.matrix == "mass" for term in self.parametric.terms], dtype=bool)

    def bounds(self, factor: float | FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and highest coordinates, (p,) each.

        Arguments:
            factor: logarithm of the largest factor; the least is its inverse.
        """
        model = self.parametric
        low = np.where(model.is_property, -factor, model.lower)
        return low, np.where(model.is_property, factor, model.upper)

    def eigenpairs(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return eigenvalues (r,) and vectors (r, r) at coordinates, (p,).

        Raises:
            ModelError: when the mass is not positive definite there.
        """
        count_evaluation()
        self.solves.count += 1
        change = np.tensordot(np.expm1(x[self.parametric.is_property]), self.parts, axes=1)
        stiffness, mass = self.stiffness + change, None
        if len(self.terms):
            own, factors = self._is_mass, self.parametric.factors(x)
            stiffness += np.tensordot(factors[~own], self.terms[~own], axes=1)
            if own.any():
                mass = self.mass + np.tensordot(factors[own], self.terms[own], axes=1)
        driver = "evd" if mass is None else "gvd"
        try:
            values, vectors = la.eigh(stiffness, mass, check_finite=False, driver=driver)
        except la.LinAlgError as error:
            raise ModelError("the mass is not positive definite") from error
        return np.asarray(values), np.asarray(vectors)

    def forces(self, x: FloatArray, vector: FloatArray, value: float) -> FloatArray:
        """Return (dK/dx - value dM/dx) @ vector, (p, r)."""
        factors = self.parametric.is_property
        found = np.zeros((len(x), len(vector)))
        found[factors] = (self.parts @ vector) * np.exp(x[factors])[:, None]
        if len(self.terms):
            weight = np.where(self._is_mass, -value, 1.0)
            found += self.parametric.factor_slopes(x) @ (weight[:, None] * (self.terms @ vector))
        return found

    def partners(self, eigenvalues: FloatArray, readings: FloatArray) -> IntArray:
        """Return the partner of every measured mode, -1 where there is none, (m,)."""
        measured = self.measurement
        count = 3 * len(measured) + _SPARE + (6 if len(self.terms) else 0)
        own = np.sqrt(np.abs(eigenvalues[:count])) / (2.0 * np.pi)
        return pair_modes(measured.frequencies, measured.shapes, own, readings[:, :count]).index

    def fit(self, x: FloatArray, *, slopes: bool = True) -> ModalFit:
        """Return residual and slope at coordinates, (p,).

        The residual of a shape is that of both shapes at unit length, the measured less its share
        along the model's: the sum of its squares is 1 - MAC, whose own slope vanishes at its best.
        """
        m, shapes, size = len(self.measurement), self._unit_shapes, len(x) if slopes else 0
        try:
            eigenvalues, vectors = self.eigenpairs(x)
        except ModelError:  # changes together leave no mass
            rows = np.full(m + self._unit_shapes.size * bool(shapes.any()), _NO_MODEL)
            return ModalFit(rows, np.zeros((len(rows), size)), 0)
        readings = self.readings @ vectors
        partner = self.partners(eigenvalues, readings)
        rows, shape_rows = np.full(m, _LOST), np.zeros((m, len(readings) if shapes.any() else 0))
        slope, shape_slope = np.zeros((m, size)), np.zeros((*shape_rows.shape, size))
        there = np.flatnonzero(partner >= 0)
        own = np.sqrt(np.maximum(eigenvalues[partner[there]], 0.0)) / (2.0 * np.pi)
        rows[there] = 1.0 - own / self.measurement.frequencies[there]
        for i in there:
            j = partner[i]
            if slopes:
                gain = self.forces(x, vectors[:, j], float(eigenvalues[j])) @ vectors  # p, r
                slope[i] = -(1.0 - rows[i]) * gain[:, j] / (2.0 * eigenvalues[j])
            if not shapes[i].any():
                continue
            read = np.where(self._known[i], readings[:, j], 0.0)
            # The measured shape less s times the model's: s = (a . shape) / (a . read).
            along = read if self.scaled == "length" else self._largest[i]
            square = float(along @ read)
            square = np.copysign(max(abs(square), 1e-300), square)
            scale = float(shapes[i] @ along) / square
            shape_rows[i] = shapes[i] - scale * read
            if slopes:
                gap = eigenvalues[j] - eigenvalues
                gap[np.abs(gap) <= _DEPENDENT * np.abs(eigenvalues[j])] = np.inf
                turn = np.where(self._known[i][:, None], readings @ (gain / gap).T, 0.0)
                moved = shapes[i] - 2.0 * scale * read if along is read else -scale * along
                scale_slope = (moved @ turn) / square
                shape_slope[i] = -scale * turn - np.outer(read, scale_slope)
        weight = self.shape_weight
        return ModalFit(
            np.append(rows, weight * shape_rows.ravel()),
            np.vstack([slope, weight * shape_slope.reshape(shape_rows.size, size)]),
            int((partner >= 0).sum()),
        )

    @cached_property
    def _known(self) -> BoolArray:
        """Tell which components of measured shapes there are, (m, n_sensors)."""
        return np.isfinite(self.measurement.shapes).T

    @cached_property
    def _largest(self) -> FloatArray:
        """Return 1 where a measured shape is largest, else 0, (m, n_sensors)."""
        size = np.abs(self._unit_shapes)
        return np.asarray(np.arange(size.shape[1]) == size.argmax(axis=1)[:, None], dtype=float)

    @cached_property
    def _unit_shapes(self) -> FloatArray:
        """Return the measured shapes at unit length, zero where they do not count, (m, n_sensors).

        They count where they have a weight and the sensors see the mode.
        """
        shapes = np.where(self._known, self.measurement.shapes.T, 0.0)
        counted = find_seen_modes(self.measurement.shapes) & (self.shape_weight > 0.0)
        length = [np.linalg.norm(s) if c else np.inf for s, c in zip(shapes, counted, strict=True)]
        return np.asarray(shapes / np.array(length)[:, None])

    def fit_penalised(
        self,
        weigh: Callable[[FloatArray, FloatArray], float],
        solve: Callable[[FloatArray, FloatArray, float], FloatArray],
        *,
        squares: bool,
    ) -> tuple[FloatArray, ModalFit, list[dict[str, float]], float]:
        """Return coordinates, fit, history and weight, linearised anew until nothing moves.

        Arguments:
            weigh: from S (m, p) and b (m,) to the weight of the penalty.
            solve: from S, b and the weight to the x / spread of least cost.
            squares: whether the penalty is mu^2 |x|^2, else it is 2 mu sum |x_j|.
        """
        x = np.zeros(len(self.spread))
        fit, history, weight = self.fit(x), list[dict[str, float]](), 0.0
        for _ in range(_ITERATIONS):
            right = fit.slope @ x - fit.residual
            if not (fit.slope.T @ right).any():
                break
            slope = fit.slope * self.spread
            weight = weigh(slope, right)
            wanted, before = self.spread * solve(slope, right, weight), x
            cost = {"squares": weight**2} if squares else {"sizes": 2.0 * weight}
            x, fit = self.advance(x, fit, wanted, **cost)
            moved = float(np.abs(x - before).max())
            history.append({"cost": fit.cost, "step": moved, "weight": weight})
            if moved < _SMALL:
                break
        return x, fit, history, weight

    def advance(
        self,
        x: FloatArray,
        fit: ModalFit,
        wanted: FloatArray,
        *,
        squares: float = 0.0,
        sizes: float = 0.0,
    ) -> tuple[FloatArray, ModalFit]:
        """Return the next point: shortened, and halved until cost and penalty do not grow.

        Arguments:
            x: coordinates, (p,).
            fit: the fit there.
            wanted: where a linear problem has its optimum, (p,).
            squares, sizes: what the sums of squares and of absolute values of x / spread
                weigh in the penalty, against the sum of squares of the residual.
        """

        def penalty(point: FloatArray) -> float:
            z = point / self.spread
            return squares * float(z @ z) + sizes * float(np.abs(z).sum())

        low, high = self.bounds(_LARGEST_LOG * np.clip(self.spread, 1.0, _WIDER))
        step = wanted - x
        step *= min(1.0, _LONGEST / max(float(np.abs(step).max()), _LONGEST))
        before = fit.cost + penalty(x)
        for halving in range(_HALVINGS):
            if not self.solves.left:
                break
            trial = np.clip(x + step / 2**halving, low, high)
            found = self.fit(trial)
            if found.cost + penalty(trial) <= before:
                return trial, found
        return x, fit

    @classmethod
    def of(
        cls,
        parametric: ParametricModel,
        measurement: Measurement,
        *,
        shape_weight: float,
        scaled: str = "length",
        at: FloatArray | None = None,
        size: int | None = None,
        max_solves: int = 0,
    ) -> ModalSpace:
        """Return the problem in all elastic modes of a model, or in a few shapes.

        The few are the lowest modes, and the static answers to a change of every parameter in the
        measured ones, those that matter most: they keep frequencies true where parameters move far.

        Arguments:
            parametric: the model and its changes, factors on stiffness and effects.
            measurement: the used modes.
            shape_weight, scaled: as of `ModalSpace`.
            at: coordinates where the shapes are taken, (p,); None for the nominal model.
            size: number of shapes at most; None for all, of a large model a hundred.
            max_solves: eigenvalue solutions at most, after which fits end at the best point so far;
                the shapes and the start take two in any case. 0 for no limit.

        Raises:
            StrategyFailure: when no mode of the model looks like any measured mode.

        Source: Fox & Miura (1971), an approximate analysis technique for design calculations, for
        the reduced basis of shapes and their derivatives.

        Examples:
            >>> members = update.Changes(model).parameterise("members")
            >>> space = update.ModalSpace.of(members, measurement, shape_weight=0.1)
            >>> space.fit(np.zeros(7)).paired
            3
        """
        _ = parametric.start  # raises where changes do not go together
        x = np.zeros(len(parametric)) if at is None else at
        model = parametric.model if not x.any() else parametric.at(x)
        modes = solve_modes(model, enough_modes(model, len(measurement)))
        observer = model.observe(measurement.sensors)
        terms = parametric.terms
        basis = modes.shapes if terms else modes.elastic.shapes
        # A spring's softness runs over decades, for which few shapes are too few.
        whole = model.size <= DENSE_LIMIT and (bool(terms) or size is None)
        limit = basis.shape[1] if whole else size or 100
        if limit < basis.shape[1] or model.size > DENSE_LIMIT:
            basis = _few_shapes(parametric, measurement, model, modes, limit)
            if terms:
                basis = np.hstack([modes.shapes[:, modes.rigid], basis])
        factors = parametric.is_property
        inner = parametric.energies(basis, basis)[factors]
        nominal = basis.T @ model.stiffness_times(basis)
        nominal -= np.tensordot(np.expm1(x[factors]), inner, axes=1)
        mass = np.eye(len(nominal))
        projected = np.array([term.operator.project(basis) for term in terms])
        # At the nominal model the terms are not in it yet.
        for own, term, factor in zip(projected, terms, parametric.factors(x), strict=True):
            if x.any():
                {"stiffness": nominal, "mass": mass}[term.matrix][:] -= factor * own
        given = nominal, mass, inner, projected, observer @ basis, shape_weight, scaled
        solves = Evaluations(1, max_solves)
        space = cls(measurement, parametric, *given, solves)
        if space.fit(x, slopes=False).paired == 0:
            raise StrategyFailure("no mode of the model looks like any measured mode")
        return space

    def fit_bounded(self, start: FloatArray, largest: float) -> tuple[FloatArray, float]:
        """Return the local optimum of the coordinates between their bounds, and the cost there.

        Arguments:
            start: coordinates, (p,).
            largest: bound of a factor; the least is its inverse.

        Source: Branch, Coleman & Li (1999), trust-region reflective least squares.

        Examples:
            >>> sections = update.Changes(model).parameterise("sections")
            >>> space = update.ModalSpace.of(sections, measurement, shape_weight=0.0)
            >>> x, cost = space.fit_bounded(np.zeros(1), 3.0)
            >>> cost < space.fit(np.zeros(1)).cost
            True
        """
        low, high = self.bounds(float(np.log(largest)))
        middle, half, kept = 0.5 * (low + high), 0.5 * (high - low), {}

        def residual(x: FloatArray) -> FloatArray:
            kept[0] = (x.copy(), self.fit(x))
            return kept[0][1].residual

        def slope(x: FloatArray) -> FloatArray:
            at, fit = kept[0]
            return (fit if np.array_equal(at, x) else self.fit(x)).slope

        found = least_squares(
            residual,
            np.clip(start, middle - _INSIDE * half, middle + _INSIDE * half),
            slope,
            bounds=(low, high),
            max_nfev=min(_EVALUATIONS, max(self.solves.left, 1)),
            xtol=_TOLERANCE,
            ftol=_TOLERANCE,
        )
        return np.asarray(found.x), 2.0 * float(found.cost)


def _few_shapes(
    parts: ParametricModel, measurement: Measurement, model: Model, modes: Modes, limit: int
) -> FloatArray:
    """Return at most so many shapes, orthonormal with the mass and to the rigid ones, (n, r)."""
    low = modes.elastic.shapes[:, : len(measurement) + _SPARE]
    first = float(modes.elastic.eigenvalues[0])
    shifted, moved = ShiftedModel(model, -first), low[:, : len(measurement) + 2].T
    if parts.terms or moved.size * len(parts) <= _MOST_FORCES:
        pulled = np.hstack([parts.start_slopes.products(shape, 0.0) for shape in moved])
        # How the terms of an effect share its force depends on its size: each by itself.
        alone = [term.operator.apply(moved.T) for term in parts.terms if term.matrix == "stiffness"]
        pulled = np.hstack([pulled, *alone])
        answers = shifted.solve(pulled)
    else:
        answers = _largest_answers(parts, shifted, moved, limit)
    fixed = np.hstack([modes.shapes[:, modes.rigid], low])
    answers = answers - fixed @ (fixed.T @ model.mass_times(answers))
    # The largest by strain energy: what adds flexibility that the low modes lack.
    energy = answers.T @ (model.stiffness_times(answers) + first * model.mass_times(answers))
    values, turn = la.eigh(0.5 * (energy + energy.T))
    chosen = [i for i in range(len(values))[::-1] if values[i] > _DEPENDENT * values[-1]]
    chosen = chosen[: max(limit - low.shape[1], 0)]
    basis = np.hstack([low, answers @ turn[:, chosen] / np.sqrt(values[chosen])])
    gram = basis.T @ model.mass_times(basis)
    values, turn = la.eigh(0.5 * (gram + gram.T))
    keep = values > _DEPENDENT * values[-1]
    return np.asarray(basis @ (turn[:, keep] / np.sqrt(values[keep])))


def _largest_answers(
    parts: ParametricModel, shifted: ShiftedModel, moved: FloatArray, limit: int
) -> FloatArray:
    """Return the largest of too many static answers, (n, limit): subspace iteration.

    Arguments:
        moved: the shapes, (m, n), that every parameter changes the forces of.

    Source: Halko, Martinsson & Tropp (2011), randomised range finder.
    """
    weights = np.random.default_rng(2).standard_normal((len(moved), len(parts), limit))
    for last in (False, False, True):
        forces = np.zeros((moved.shape[1], limit))
        for shape, own in zip(moved, weights, strict=True):
            forces += parts.start_slopes.combine(shape, own)
        answers = shifted.solve(forces)
        if not last:
            answers = la.qr(answers, mode="economic")[0]
            products = [parts.start_slopes.inner(shape[:, None], answers)[:, 0] for shape in moved]
            weights = np.array(products)
    return np.asarray(answers)
