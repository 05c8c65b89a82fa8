"""Fit hypotheses to the data: exact modes in modal coordinates, damped Gauss-Newton, evidence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
import scipy.linalg as la
from scipy.special import log_ndtr

from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.fit.gauss_newton import Linearised
from femubench.core.fit.modal_basis import Space, solve_pencil
from femubench.core.fit.noise import Noise
from femubench.core.fit.projection import Projection
from femubench.core.fit.residuals import Data
from femubench.core.typing import FloatArray, IntArray

_STEPS = 12
_SETTLED = 2e-2  # of chi-square plus prior: a hundredth of a nat
_SPARE = 8  # modes beyond twice the measured ones
_LONGEST = 1.5  # prior deviations a step
# Two modes closer than this share of an eigenvalue turn into each other at the least change; a
# linear rule has no more to say there.
_CLOSE = 1e-3
_Kept = TypeVar("_Kept")


@dataclass(frozen=True)
class Problem:
    """What a fit needs apart from the hypotheses.

    Arguments:
        offset: added to every residual, in standard deviations of the measurement, (n_data,);
            what the modal coordinates are known to get wrong near the point of interest.
        kept: what was worked out for the space and the data, whatever the noise.
    """

    model: Model
    space: Space = field(repr=False)
    data: Data = field(repr=False)
    noise: Noise = field(repr=False)
    offset: FloatArray | float = field(default=0.0, repr=False)
    kept: dict[object, Any] = field(default_factory=dict, compare=False, repr=False)

    @property
    def compared(self) -> int:
        """Return how many of the lowest modes are compared with the measured ones."""
        return self.space.rigid + 2 * len(self.data.measurement) + _SPARE

    def keep(
        self, what: str, parts: Sequence[Projection], x: FloatArray, make: Callable[[], _Kept]
    ) -> _Kept:
        """Return what was made before of some hypotheses at the same coordinates, or make it.

        Searches with other scales of the model error come by the same points.
        """
        key = what, id(self.space), id(self.data), x.tobytes(), *map(id, parts)
        if key not in self.kept:
            # With what it is of, so that an id in the key is no other's.
            self.kept[key] = make(), self.space, self.data, tuple(parts)
        value: _Kept = self.kept[key][0]
        return value


@dataclass(frozen=True)
class SolvedModes:
    """The modes in the coordinates of a space: the lowest ones, and above them what follows causes.

    Arguments:
        eigenvalues: (q,).
        again: solves for the modes once more, which are too large to be kept for long.
        first: the modes, (N, q), where they have just been solved.
    """

    eigenvalues: FloatArray
    again: Callable[[], FloatArray]
    first: FloatArray | None = None

    @cached_property
    def vectors(self) -> FloatArray:
        """Return the modes, (N, q)."""
        return self.again() if self.first is None else self.first


@dataclass(frozen=True)
class State:
    """Hypotheses at definite coordinates, and what they predict.

    Arguments:
        parts: the hypotheses; none for the model as it is.
        x: coordinates, (k,).
        modes: modes in the coordinates of the space.
        partner: of every measured mode, (m,).
        mass: total mass in kg.
        raw: residuals in standard deviations of the measurement, (n_data,).
    """

    problem: Problem = field(repr=False)
    parts: tuple[Projection, ...]
    x: FloatArray
    modes: SolvedModes = field(repr=False)
    partner: IntArray = field(repr=False)
    mass: float
    raw: FloatArray = field(repr=False)

    @property
    def eigenvalues(self) -> FloatArray:
        """Return the eigenvalues of the modes, (q,)."""
        return self.modes.eigenvalues

    @property
    def vectors(self) -> FloatArray:
        """Return the modes in the coordinates of the space, (N, q)."""
        return self.modes.vectors

    @cached_property
    def residual(self) -> FloatArray:
        """Return the residuals in units of the noise, (n_data,)."""
        return self.problem.noise.residual(self.raw)

    @property
    def chi2(self) -> float:
        """Return chi-square."""
        return float(self.residual @ self.residual)

    @property
    def cost(self) -> float:
        """Return chi-square plus the share of the prior."""
        return self.chi2 + float(self.x @ self.x)

    @cached_property
    def predicted(self) -> tuple[FloatArray, FloatArray]:
        """Return frequencies with the correction for the mesh, (1, q), and readings of modes."""
        return _predicted(self.problem, self.eigenvalues, self.vectors)

    def against(self, data: Data) -> FloatArray:
        """Return the residuals of other data on the same modes and sensors, (n_data,)."""
        raw, _ = _compared(data, *self.predicted, self.mass)
        ratio = self.problem.data.std / data.std if len(data) == len(self.raw) else 1.0
        return np.asarray(raw + ratio * self.problem.offset)

    @property
    def frequencies(self) -> FloatArray:
        """Return all predicted frequencies in Hz, without the correction for the mesh."""
        return signed_hz(self.eigenvalues)

    @cached_property
    def readings(self) -> FloatArray:
        """Return the readings of the partners at the sensors, 0 of still ones, (n_sensors, m)."""
        space = self.problem.space
        seen = space.pad_readings(len(self.vectors)) @ self.vectors[:, self.partner]
        return np.where(space.still(self.eigenvalues[self.partner]), 0.0, seen)

    @cached_property
    def slopes(self) -> FloatArray:
        """Return d prediction / d x in standard deviations of the measurement, (n_data, k)."""
        if not self.parts:
            return np.zeros((len(self.raw), 0))
        return self.problem.keep("slopes", self.parts, self.x, self._worked_out)

    def _worked_out(self) -> FloatArray:
        near, values = self.vectors[:, self.partner], self.eigenvalues[self.partner]
        return self.rows(*self.problem.space.forces(self.parts, self.x, near, values))

    @cached_property
    def jacobian(self) -> FloatArray:
        """Return d prediction / d x in units of the noise, (n_data, k)."""
        return self.problem.noise.whiten(self.slopes.T).T

    @cached_property
    def linearised(self) -> Linearised:
        """Return the least-squares problem about the state."""
        one = np.ones(len(self.x))
        return Linearised(self.jacobian, self.residual, self.x, one, well_posed=True)

    def rows(self, forces: FloatArray, masses: FloatArray) -> FloatArray:
        """Return d prediction / d x in standard deviations from modal forces, (n_data, p).

        Arguments:
            forces: (dK - lambda_j dM) phi_j in the coordinates of the space, (N, m, p).
            masses: d mass / d x in kg, (p,).
        """
        share = np.tensordot(self.vectors, forces, axes=(0, 0))
        values = self.eigenvalues[self.partner]
        gap = values - self.eigenvalues[:, None]
        least = _CLOSE * np.abs(values)
        gap = np.where(np.abs(gap) < least, np.copysign(least, gap), gap)
        # Close modes are turned to what was seen: how they mix is no datum.
        gap[np.abs(gap) <= 2.0 * self.problem.data.closeness * np.abs(values)] = np.inf
        gap[self.partner, np.arange(len(values))] = np.inf
        still = self.problem.space.still(self.eigenvalues)
        gap[np.logical_and.outer(still, still[self.partner])] = np.inf
        slope = share[self.partner, np.arange(len(values))]
        turn = share / gap[:, :, None]
        seen = self.problem.space.pad_readings(len(self.vectors)) @ self.vectors
        change = np.tensordot(seen, turn, axes=1)
        moving = np.where(still[self.partner], np.inf, np.abs(signed_hz(values)))
        hertz = slope / (8.0 * np.pi**2 * moving)[:, None]
        return self.problem.data.slope(hertz, self.readings, change, masses)


def signed_hz(eigenvalues: FloatArray) -> FloatArray:
    """Return frequencies in Hz, negative for imaginary ones."""
    return np.asarray(np.copysign(np.sqrt(np.abs(eigenvalues)), eigenvalues) / (2.0 * np.pi))


def state_at(
    problem: Problem, parts: Sequence[Projection], x: FloatArray, *, every: bool = False
) -> State:
    """Return the prediction of some hypotheses at given coordinates.

    Arguments:
        problem, parts, x: as in `State`.
        every: return every mode, for what is not measured and not moved by the hypotheses.

    Raises:
        ModelError: when they make the mass indefinite.
    """
    first: list[FloatArray] = []

    def make() -> tuple[FloatArray, IntArray, float, FloatArray]:
        values, vectors, weight = _modes(problem, parts, x, every)
        first.append(vectors)
        raw, partner = _compared(problem.data, *_predicted(problem, values, vectors), weight)
        return values, partner, weight, raw

    what = "every mode" if every else "modes"
    found = problem.keep(what, parts, x, make) if parts else make()
    values, partner, weight, raw = found
    again = partial(_vectors, problem, parts, x, every)
    modes = SolvedModes(values, again, first[0] if first else None)
    return State(problem, tuple(parts), x, modes, partner, weight, raw + problem.offset)


def _modes(
    problem: Problem, parts: Sequence[Projection], x: FloatArray, every: bool
) -> tuple[FloatArray, FloatArray, float]:
    """Return eigenvalues (q,), modes (N, q) and the total mass in kg."""
    data = problem.data
    if parts:
        few = problem.space.condense(parts, len(problem.space) if every else problem.compared)
        stiffness, mass, weight = few.space.assemble(few.parts, x)
        values, vectors = solve_pencil(stiffness, mass)
        vectors = few.expand(vectors)
    else:
        order = np.argsort(problem.space.eigenvalues, kind="stable")
        values, vectors = problem.space.eigenvalues[order], np.eye(len(order))[:, order]
        weight = problem.space.mass
    count = min(len(values), problem.compared)
    seen = problem.space.pad_readings(len(vectors)) @ vectors[:, :count]
    hertz = signed_hz(values[:count])
    for group, turn in data.turns(hertz, seen, problem.space.zero) if data.closeness else ():
        vectors[:, group] = vectors[:, group] @ turn
        seen[:, group] = seen[:, group] @ turn
    return values, vectors, weight


def _vectors(
    problem: Problem, parts: Sequence[Projection], x: FloatArray, every: bool
) -> FloatArray:
    return _modes(problem, parts, x, every)[1]


def _predicted(
    problem: Problem, values: FloatArray, vectors: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the frequencies and readings of enough modes, (1, q) and (1, n_sensors, q)."""
    space, data = problem.space, problem.data
    count = min(len(values), problem.compared)
    seen = space.pad_readings(len(vectors)) @ vectors[:, :count]
    return data.predict(signed_hz(values[None, :count]), seen[None], space.zero)


def _compared(
    data: Data, hertz: FloatArray, seen: FloatArray, mass: float
) -> tuple[FloatArray, IntArray]:
    """Return the residuals of data, (n_data,), and the partners of their modes, (m,)."""
    partner = data.pair(hertz, seen)[0]
    raw = data.residual(hertz[:, partner], seen[:, :, partner], np.array([mass]))
    return np.asarray(raw[0]), partner


@dataclass(frozen=True)
class Fit:
    """The best fit of some hypotheses.

    Arguments:
        log_evidence: ln of the probability of the data, up to a constant of the data; without
            the prior of the hypotheses themselves.
    """

    state: State
    log_evidence: float

    @property
    def parts(self) -> tuple[Projection, ...]:
        """Return the hypotheses."""
        return self.state.parts

    @cached_property
    def covariance(self) -> FloatArray:
        """Return the covariance of the coordinates, (k, k)."""
        normal = self.state.linearised.normal
        return np.asarray(la.inv(normal)) if len(normal) else normal


def bounds_of(parts: Sequence[Projection]) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest coordinates of all parameters, (k,) each."""
    pairs = [part.hypothesis.bounds for part in parts]
    if not pairs:
        return np.zeros(0), np.zeros(0)
    return np.concatenate([low for low, _ in pairs]), np.concatenate([high for _, high in pairs])


def fit(
    problem: Problem,
    parts: Sequence[Projection],
    start: FloatArray,
    *,
    give_up: float = np.inf,
    steps: int = _STEPS,
) -> Fit | None:
    """Return the most probable coordinates of some hypotheses by damped Gauss-Newton steps.

    Arguments:
        start: where to start, (k,).
        give_up: stop when the next step cannot bring the cost below this.
    """
    low, high = bounds_of(parts)
    try:
        point = state_at(problem, parts, np.clip(start, low, high))
    except ModelError:
        return None
    damping = 0.0
    for _ in range(steps if len(start) else 0):
        step = point.linearised.step(low, high, _LONGEST, damping=damping)
        step = np.clip(point.x + step, low, high) - point.x
        promised = point.linearised.promise(step)
        if promised < _SETTLED or point.cost - 3.0 * promised > give_up:
            break
        try:
            trial = state_at(problem, parts, np.clip(point.x + step, low, high))
        except ModelError:
            trial = None
        if trial is not None and trial.cost < point.cost:
            gained, point = point.cost - trial.cost, trial
            damping = damping / 10.0 if damping > 1e-3 else 0.0
            if gained < _SETTLED:
                break
        else:
            damping = max(10.0 * damping, 1.0)
            if damping > 1e6:
                break
    return Fit(point, log_evidence(point))


def log_evidence(point: State) -> float:
    """Return ln of the integral of likelihood times prior by Laplace's method.

    A coordinate that cannot be negative has a half-normal prior, and the integral over it ends at
    zero: with slope g and curvature h of the cost's half there, the Gaussian integral over the
    line is replaced by that over x >= 0 (Kass & Raftery 1995, section 4.1, with the boundary).
    """
    jacobian, x = point.jacobian, point.x
    curvature = point.linearised.normal
    gradient = x - jacobian.T @ point.residual
    result = -0.5 * point.cost + point.problem.noise.log_density
    if len(x) == 0:
        return result
    result -= float(np.log(la.cholesky(curvature).diagonal()).sum())
    one_sided = np.concatenate([part.hypothesis.one_sided for part in point.parts])
    spread = np.sqrt(la.inv(curvature).diagonal())
    for i in np.flatnonzero(one_sided):
        centre = x[i]
        if x[i] <= 0.0 and gradient[i] > 0.0:
            slip = gradient[i] * spread[i]
            result += float(0.5 * slip**2)
            centre = -gradient[i] * spread[i] ** 2
        result += float(np.log(2.0) + log_ndtr(centre / spread[i]))
    return result


def variance_of(slopes: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the variance of values by their slopes in the coordinates, (m, k), as (m,)."""
    return np.asarray(np.einsum("mk,kl,ml->m", slopes, covariance, slopes))
