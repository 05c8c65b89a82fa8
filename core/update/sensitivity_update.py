"""The iterative sensitivity method: damped Gauss-Newton steps in scaled parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from femubench.core.change.change import Change
from femubench.core.change.parametric_model import ParametricModel
from femubench.core.errors import Diverged, ModelError, NotApplicable, StrategyFailure
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.fit.dual_least_squares import MANY, DualPosterior
from femubench.core.fit.gauss_newton import Linearised
from femubench.core.modal.eigen import Evaluations
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import BoolArray, FloatArray
from femubench.core.update.residuals import Prediction, Residual, Targets, common_rows
from femubench.core.update.response_residuals import (
    AntiresonancePrediction,
    AntiresonanceTargets,
    ResponsePrediction,
    ResponseTargets,
)
from femubench.core.update.strategy import ParameterEstimate, UpdateResult
from femubench.core.update.uncertainty import Uncertainty, standard_normal

_SMALLEST_STEP = 1e-9
_ROUNDING = 1e-10  # relative, of a modal quantity: some ten times what linear algebra leaves
_NO_GAIN = 1e-6
_PATIENCE = 3
_HALVINGS = 8  # of a step that makes the cost grow
_AWAY = 0.5  # prior deviations
_NOISES, _SETTLED = 20, 1e-4  # estimates of unknown noise at most; q that moves by less


@dataclass(frozen=True)
class UpdateOptions:
    """How the iteration goes.

    Arguments:
        residual: the modal quantity that is fitted: ``eigenvalue``, ``relative-eigenvalue`` or
            ``frequency``.
        weighting: ``unit`` for W_ee = I, ``statistical`` for the inverse covariance of the data.
        shapes: take mode shapes as data too (statistical weighting).
        responses: fit the given frequency responses, weighted by their deviations, in place of the
            modes, from the parameters that fit the frequencies: responses alone have an optimum
            of their own wherever a resonance lies on a wrong one.
        antiresonances: fit those of the given frequency responses next to the frequencies, each
            by its deviation, from the same start.
        unknown_noise: deviations of the responses hold but for a factor of each channel, which is
            estimated with the parameters: it is what the model leaves.
        damping: beta, which stands for alpha / pct^2 of the paper, as a share of z_m'W z_m: of
            what s's is for a factor on the whole stiffness.
        max_iterations: steps at most.
        tolerance: the iteration ends when no scaled parameter moves by more,
        cost_tolerance: or when three steps in a row lower the cost by no more than this share:
            parameters that hardly matter drift on for ever.
        max_step: longest step of a scaled parameter in one iteration.
        max_solves: eigenvalue solutions at most, of all rounds together, each start taking one in
            any case; the best point so far is the result then, not converged. 0 for no limit.
        restarts: how often the end is left, by half a prior deviation in a random direction, and
            the iteration repeated: a saddle, such as that of a symmetric model, is left.
    """

    residual: Residual = "eigenvalue"
    weighting: str = "unit"
    shapes: bool = False
    responses: bool = False
    antiresonances: bool = False
    unknown_noise: bool = False
    damping: float = 1e-5
    max_iterations: int = 100
    tolerance: float = 1e-6
    cost_tolerance: float = 1e-4
    max_step: float = 0.5
    restarts: int = 0
    max_solves: int = 0

    def __post_init__(self) -> None:
        if self.max_solves < 0:
            raise ValueError(f"max_solves is {self.max_solves}, not 0 (no limit) or more")
        if self.weighting not in ("unit", "statistical"):
            raise ValueError(f"weighting {self.weighting!r} is neither 'unit' nor 'statistical'")
        if self.shapes and self.weighting != "statistical":
            raise ValueError("mode shapes as data need statistical weighting")
        if self.responses and self.antiresonances:
            raise ValueError("either responses or antiresonances are fitted, not both")
        if self.unknown_noise and not self.responses:
            raise ValueError("noise is unknown of responses: it needs responses=true")


@dataclass(frozen=True)
class Iterate:
    """Coordinates q, (p,), and what the model predicts there."""

    q: FloatArray
    prediction: Prediction | ResponsePrediction | AntiresonancePrediction

    def cost(self, rows: BoolArray, precision: FloatArray) -> float:
        """Return r'Wr over some data plus the prior's share."""
        residual = self.prediction.residual[rows]
        return float(residual @ residual + precision @ np.square(self.q))


class Iteration:
    """State of one update."""

    def __init__(
        self,
        parametric: ParametricModel,
        data: Targets | ResponseTargets | AntiresonanceTargets,
        options: UpdateOptions,
        solves: Evaluations | None = None,
    ) -> None:
        self.parametric, self.data, self.options = parametric, data, options
        self.solves = solves or Evaluations(most=options.max_solves)
        self.history: list[Mapping[str, float]] = []
        self.beta = 0.0
        self.converged = False

    def model_at(self, q: FloatArray) -> Model:
        """Return the model at coordinates, (p,), taken within their limits."""
        return self.parametric.at(np.clip(q, self.parametric.lower, self.parametric.upper))

    def at(self, q: FloatArray, previous: Any = None) -> Iterate:  # noqa: ANN401 - of its kind
        """Return the prediction at coordinates, its pairs continued from a previous one."""
        model = self.parametric.at(q)
        self.solves.count += 1
        mass = self.parametric.mass(q, model)
        return Iterate(q, self.data.predict(model, previous, mass))

    def linearise(self, point: Iterate) -> Linearised:
        """Return the least-squares problem about a point, of the data that have a partner."""
        parametric, prediction = self.parametric, point.prediction
        known = np.isfinite(prediction.residual)
        slopes = parametric.slopes(point.q, prediction.model)
        masses = partial(parametric.mass_slopes, point.q, prediction.model)
        s = (prediction.jacobian(slopes, masses) * parametric.steps(point.q))[known]
        return Linearised(s, prediction.residual[known], point.q, parametric.precision)

    def gain(self, before: Iterate, after: Iterate) -> float:
        """Return the share of the cost that a step took away."""
        rows, precision = (
            common_rows(before.prediction.residual, after.prediction.residual),
            self.parametric.precision,
        )
        cost = before.cost(rows, precision)
        return 1.0 - after.cost(rows, precision) / cost if cost > 0.0 else 0.0

    def rounding(self, cost: float) -> float:
        """Return how much two costs near a given one may differ by rounding alone."""
        blur = _ROUNDING * self.data.norm
        return blur * (2.0 * float(np.sqrt(cost)) + blur)

    def advance(self, point: Iterate, step: FloatArray) -> Iterate | None:
        """Return the next point, the step halved until the cost does not grow; None for none.

        Costs that differ by no more than rounding are equal, so that the last steps towards an
        optimum, too short for the cost to show, are taken on every processor.
        """
        precision = self.parametric.precision
        for halving in range(_HALVINGS + 1):
            q = np.clip(point.q + step / 2**halving, self.parametric.lower, self.parametric.upper)
            if not self.solves.left or np.abs(q - point.q).max() < _SMALLEST_STEP:
                return None
            try:
                trial = self.at(q, point.prediction)
            except ModelError:
                continue
            rows = common_rows(point.prediction.residual, trial.prediction.residual)
            cost = point.cost(rows, precision)
            if rows.any() and trial.cost(rows, precision) <= cost + self.rounding(cost):
                return trial
        return None

    def run(self, start: FloatArray | None = None) -> Iterate:
        """Return the optimum, from a start, (p,), or 0; raises StrategyFailure or Diverged."""
        parametric = self.parametric
        _ = parametric.start  # raises where changes do not go together
        begun = np.zeros(len(parametric)) if start is None else start
        point = self.at(np.clip(begun, parametric.lower, parametric.upper))
        if not (point.prediction.partner >= 0).any():
            raise StrategyFailure("no mode of the model looks like any measured mode")
        self.beta = self.options.damping * self.data.norm**2
        self.record(0, point, 0.0)
        point, rng = self.descend(point), np.random.default_rng(0)
        for _ in range(self.options.restarts):
            if not self.solves.left:
                break
            point = self.improve(point, rng.standard_normal(len(parametric)))
        self.check(point)
        return point

    def improve(self, point: Iterate, direction: FloatArray) -> Iterate:
        """Return the better of an end and of where the iteration goes from a point near it."""
        parametric, kept = self.parametric, (self.history, self.converged)
        away = _AWAY * np.where(parametric.precision, parametric.precision, np.inf) ** -0.5
        q = np.clip(point.q + away * direction, parametric.lower, parametric.upper)
        self.history = [*self.history]
        with suppress(ModelError, Diverged):
            other = self.descend(self.at(q, point.prediction))
            self.check(other)
            lost = (point.prediction.partner >= 0) & (other.prediction.partner < 0)
            if not lost.any() and self.gain(point, other) > self.options.cost_tolerance:
                return other
        self.history, self.converged = kept
        return point

    def descend(self, point: Iterate) -> Iterate:
        """Return where the steps from a point end."""
        slow, self.converged, begun = 0, False, len(self.history)
        for iteration in range(begun, begun + self.options.max_iterations):
            problem = self.linearise(point)
            low, high = self.parametric.lower, self.parametric.upper
            step = problem.step(low, high, self.options.max_step, ridge=self.beta)
            following = self.advance(point, step)
            if following is None:
                little = problem.promise(step) < _NO_GAIN * problem.cost
                self.converged = little and self.solves.left > 0
                break
            moved = float(np.abs(following.q - point.q).max())
            slow = slow + 1 if self.gain(point, following) < self.options.cost_tolerance else 0
            point = following
            self.record(iteration, point, moved)
            if moved < self.options.tolerance or slow == _PATIENCE:
                self.converged = True
                break
        return point

    def record(self, iteration: int, point: Iterate, step: float) -> None:
        """Add a step to the history."""
        rows = np.isfinite(point.prediction.residual)
        entry = {
            "iteration": float(iteration),
            "cost": point.cost(rows, self.parametric.precision),
            "step": step,
        }
        if len(self.parametric) <= MANY:  # nobody follows more, and they are too much to keep
            values = self.parametric.values(point.q)
            pairs = zip(self.parametric.names, values, strict=True)
            entry.update((name, float(value)) for name, value in pairs)
        self.history.append(entry)

    def check(self, point: Iterate) -> None:
        """Raise Diverged where a parameter ended at the limit of its sense."""
        at_limit = (point.q <= self.parametric.lower) | (point.q >= self.parametric.upper)
        for p, out in zip(self.parametric.parameters, at_limit, strict=True):
            if p.fatal and out:
                raise Diverged(
                    f"{p.name} left its range {p.lower:g}..{p.upper:g}"
                    f" at iteration {len(self.history) - 1}"
                )

    def concluded(self, point: Iterate) -> Linearised:
        """Return the problem about the end; deviations are as wide as what is left over says."""
        problem = self.linearise(point)
        spare = len(problem.residual) - len(point.q)
        if not self.data.scattered or spare <= 0:
            return problem
        wide = max(float(np.sqrt(np.square(problem.residual).sum() / spare)), 1.0)
        return replace(problem, jacobian=problem.jacobian / wide, residual=problem.residual / wide)

    def covariance(self, point: Iterate) -> FloatArray | None:
        """Return the posterior covariance of q, (p, p); None without statistics."""
        if not self.data.statistical:
            return None
        problem = self.concluded(point)
        normal = problem.normal
        if self.options.unknown_noise and isinstance(self.data, ResponseTargets):
            normal = normal - self.data.conceded(problem.jacobian, problem.residual)
        try:
            return np.asarray(np.linalg.inv(normal))
        except np.linalg.LinAlgError:
            return np.full(normal.shape, np.inf)

    def estimate_deviations(self, point: Iterate) -> tuple[FloatArray | None, Uncertainty | None]:
        """Return the deviations of q, (p,), and models of the posterior, where there are any."""
        if len(point.q) > MANY:
            return self.estimate_many_deviations(point)
        covariance = self.covariance(point)
        if covariance is None:
            return None, None
        variance = np.diagonal(covariance)
        if not (np.isfinite(variance) & (variance > 0.0)).all():
            return None, None  # the end is no maximum of the posterior in every direction
        std = np.sqrt(variance)
        try:
            even = 0.5 * (covariance + covariance.T)
            return std, Uncertainty.draw(self.model_at, point.q, even)
        except StrategyFailure:  # rounding made it no covariance; the model is none the worse
            return std, None

    def estimate_many_deviations(
        self, point: Iterate
    ) -> tuple[FloatArray | None, Uncertainty | None]:
        """Return the same without a matrix of the size of the parameters."""
        precision = self.parametric.precision
        if not self.data.statistical or not (precision > 0.0).all():
            return None, None
        posterior = DualPosterior.of(self.concluded(point).jacobian, precision)
        draws = posterior.draws(standard_normal(len(point.q)))
        return posterior.std, Uncertainty.of_draws(self.model_at, point.q + draws)


def estimate_parameters(
    parametric: ParametricModel, q: FloatArray, std: FloatArray | None
) -> tuple[ParameterEstimate, ...]:
    """Return the parameters before and after.

    Arguments:
        q: coordinates after, (p,).
        std: their standard deviations, (p,); None where unknown.
    """
    values = parametric.values(q)
    deviations = (
        [None] * len(q) if std is None else [*map(float, np.abs(std * parametric.growth(q)))]
    )
    names, owners, parameters = parametric.names, parametric.owners, parametric.parameters
    return tuple(
        ParameterEstimate(name, float(p.neutral), float(value), p.unit, deviation, owner.places)
        for name, owner, p, value, deviation in zip(
            names, owners, parameters, values, deviations, strict=True
        )
    )


def sensitivity_update(
    source: Model | Structure,
    changes: Sequence[Change],
    measurement: Measurement,
    options: UpdateOptions | None = None,
) -> UpdateResult:
    """Return a model whose parameters fit the measured modes, or responses.

    Every iteration pairs by shape and makes one eigenvalue solution; a step after which the cost
    is larger is halved, at one solution each.

    Arguments:
        source: the nominal model, matrices with groups or a frame, or the latter's structure;
            factors multiply its present properties.
        changes: what may change, with ranges and priors.
        measurement: the used modes.
        options: residual, weighting, damping, ends.

    Raises:
        NotApplicable: when there is no parameter to change.
        StrategyFailure: when no measured mode has a partner at the start.
        Diverged: when a parameter leaves the range in which it makes sense.

    Source: Horton, Gurgenci, Veidt & Friswell (1999), equations (1), (2), (3) and (4).

    Examples:
        >>> factor = update.Changes(structure).stiffness()
        >>> update.sensitivity_update(structure, [factor], measurement).parameter_count
        1
    """
    if not changes:
        raise NotApplicable("there is no parameter to update")
    options = UpdateOptions() if options is None else options
    statistical = options.weighting == "statistical"
    data: Targets | ResponseTargets | AntiresonanceTargets
    data = Targets(measurement, options.residual, statistical, options.shapes, statistical)
    model = Model.of(source) if isinstance(source, Structure) else source
    parametric, start = ParametricModel(model, tuple(changes)), None
    solves = Evaluations(most=options.max_solves)
    if options.responses or options.antiresonances:
        frequencies = Targets(measurement, "frequency", True)
        start = Iteration(parametric, frequencies, options, solves).run().q
        data = (ResponseTargets if options.responses else AntiresonanceTargets)(measurement)
    iteration = Iteration(parametric, data, options, solves)
    point = iteration.run(start)
    for _ in range(_NOISES * options.unknown_noise):
        prediction, before = point.prediction, point.q
        assert isinstance(prediction, ResponsePrediction)
        rescaled = prediction.data.rescaled(prediction.answer.receptances)
        iteration = Iteration(parametric, rescaled, options, solves)
        point = iteration.run(before)
        if not solves.left or np.abs(point.q - before).max() < _SETTLED:
            break
    std, uncertainty = iteration.estimate_deviations(point)
    return UpdateResult(
        model=point.prediction.model,
        parameter_count=len(iteration.parametric),
        parameters=estimate_parameters(iteration.parametric, point.q, std),
        history=tuple(iteration.history),
        diagnostics={
            "iterations": float(len(iteration.history) - 1),
            "converged": float(iteration.converged),
            "paired_modes": float((point.prediction.partner >= 0).sum()),
        },
        uncertainty=uncertainty,
    )
