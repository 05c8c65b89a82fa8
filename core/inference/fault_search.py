"""Faults of the data and of what was typed in, weighed against physical causes on the same data.

A beam model gets much wrong of a real structure, but a sensor with the wrong sign is like nothing
that it gets wrong. So suspects are tried on the model as drawn, with its own error as noise: first
all of them at the scales of model error that suit the data as they are, then those that promise
something at scales of their own. What is more probable than no fault is corrected, the causes are
sought anew, and all is compared by the density of what was measured, as it was measured: where the
correction multiplies a datum, times that factor; where it widens a deviation, over that deviation.

Source: Kennedy & O'Hagan (2001) for the model error; Box & Tiao (1968) for a datum that is
discounted.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, log

import numpy as np
import scipy.linalg as la
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp
from threadpoolctl import threadpool_limits

from femubench.core.errors import FemubenchError
from femubench.core.fem.model import Model
from femubench.core.fit.extended_model import raw_residual
from femubench.core.fit.modal_fit import State, log_evidence, state_at
from femubench.core.fit.noise import Noise
from femubench.core.fit.residuals import Data
from femubench.core.inference.charge import Charge, Repaired, charges_of
from femubench.core.inference.coordinates import place_data
from femubench.core.inference.effort import Effort
from femubench.core.inference.examine import (
    Examination,
    Terms,
    before_of,
    model_error_of,
    pose_problem,
)
from femubench.core.inference.posterior import Explanation
from femubench.core.inference.search import adequacy
from femubench.core.inference.settings import settings
from femubench.core.modal.eigen import DENSE_LIMIT
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import EffectParameter, Fault
from femubench.core.ties import in_order
from femubench.core.typing import FloatArray

Weighed = list[tuple[Charge, float]]


@dataclass(frozen=True)
class Inquiry:
    """An examination of model and data with the faults corrected that were found.

    Arguments:
        examination: of what is left.
        repaired: the faults.
        loose: deviations that are stated far too large. That hides causes and makes none, so they
            are stated and stay.
    """

    examination: Examination
    repaired: tuple[Repaired, ...] = ()
    loose: tuple[Repaired, ...] = ()


def inquire(
    model: Model,
    measurement: Measurement,
    faults: Iterable[Fault],
    terms: Terms,
) -> Inquiry:
    """Weigh explanations of data by physical causes and by faults.

    Arguments:
        model: the nominal model.
        measurement: the used modes and nothing else.
        faults: what may be wrong with either.
        terms: of every examination. Next to a pure beam model, without any model error, all would
            look like faults: these are sought with an ordinary one.

    Raises:
        NotApplicable: when a used frequency has no standard deviation.
        ModelError: when the model has no modes.
    """
    effort = terms.effort
    # What was typed in is wrong in both states, and so no part of what differs.
    known = tuple(f for f in faults if terms.reference is None or f.side == "data")
    repaired: list[Repaired] = []
    model, measurement = _possible(model, measurement, known, repaired)
    if not known:
        return Inquiry(terms.examine(model, measurement))
    first = now = _Drawn(model, measurement, terms.reference, terms.width or 1.0)
    ranked = _weighed(now, known, effort)
    while len(repaired) < settings.faults_corrected:
        found = _definite(now, ranked, terms)
        if found is None:
            break
        repaired.append(found)
        now = now.remove_fault(found.charge)
        ranked = _weighed(now, known, effort)
    reweighing = [charge for charge, _ in ranked if charge.reweighs]
    with effort.scope({"single": (0.0, float(settings.candidates * bool(reweighing)))}):
        seen = terms.examine(now.model, now.measurement)
        if any(found.charge.single for found in repaired):
            # Suspected next to single causes; several may explain such a frequency as well.
            whole = terms.examine(first.model, first.measurement)
            prior = sum(first.prior(found.charge) for found in repaired)
            odds = log_density(seen, measurement) + prior - log_density(whole, measurement)
            if odds < _sure_odds() and whole.adequacy > settings.noise_p:
                now, seen, repaired = first, whole, []
                ranked = _weighed(now, known, effort)
    # Other deviations would excuse whatever is wrong: they are the last resort.
    other = _reweighed(now, reweighing, seen, terms)
    if other is None:
        return Inquiry(seen, tuple(repaired))
    if other.charge.loosens < 1.0 and not effort.stops():
        return Inquiry(terms.examine(*other.charge.repaired), (*repaired, other))
    surely = replace(other.charge, x=other.charge.x - 2.0 * other.charge.std)
    clearly = surely.loosens > settings.wrong_factor
    return Inquiry(seen, tuple(repaired), (other,) if clearly else ())


def _sure_odds() -> float:
    """Return ln of the odds from which a fault is corrected."""
    return log(settings.sure_fault / (1.0 - settings.sure_fault))


def _definite(now: _Drawn, ranked: Weighed, terms: Terms) -> Repaired | None:
    """Return the most probable fault, but for deviations; None where no fault is as probable."""
    pairs = [(c, g) for c, g in ranked if not c.reweighs and now.mostly(c)]
    if max((gain for _, gain in pairs), default=-np.inf) < _sure_odds():
        return None
    single = terms.single()
    seen = single.examine(now.model, now.measurement)
    without = float(np.logaddexp(log_density(seen, now.measurement), now.log_density))
    sound = seen.adequacy > settings.adequate_p and len(seen.best.parts) < 2
    least = without - now.log_density - (0.0 if sound else settings.lag)
    promising = [(c, gain) for c, gain in pairs if gain > least]
    tried, densities = [], []
    for charge, gain in promising[: settings.candidates]:
        again = single.examine(*charge.repaired)
        # What is wrong with the data leaves noise once it is corrected, as a cause has to.
        if max(again.adequacy, now.remove_fault(charge).adequacy) > settings.noise_p:
            tried.append((charge, gain))
            densities.append(_density(now, charge, gain, again))
    if not tried:
        return None
    best = int(np.argmax(densities))
    weighed = {charge for charge, _ in tried}
    rest = [now.log_density + gain for charge, gain in pairs if charge not in weighed]
    probability = exp(densities[best] - float(logsumexp([without, *densities, *rest])))
    found = now.refine(tried[best][0])
    sure = probability > settings.sure_fault and _inside(found)
    return Repaired(found, probability) if sure else None


def _reweighed(
    now: _Drawn, charges: Sequence[Charge], seen: Examination, terms: Terms
) -> Repaired | None:
    """Return other deviations, if those are more probable than the stated ones."""
    plain, caused = now.log_density, log_density(seen, now.measurement)
    without = float(np.logaddexp(plain, caused))
    best = now.add_causes(seen.best)
    found = [(charge, plain + now.gain(charge)) for charge in charges]
    again = (best.screen(charge) for charge in charges)
    found += [(charge, caused + gain) for charge, gain in again]
    charge, density = max(found, key=lambda pair: pair[1], default=(None, -np.inf))
    if charge is None or density < without - settings.lag:
        return None
    if charge.loosens < 1.0 and seen.adequacy > settings.adequate_p:
        return None
    # Wrong deviations lead to wrong causes, and these to wrong deviations: to and fro.
    for _ in range(settings.few_steps if charge.loosens < 1.0 else 0):
        repaired = terms.single().examine(*charge.repaired)
        density = log_density(repaired, now.measurement) + now.prior(charge)
        charge = now.add_causes(repaired.best).estimate(charge)
        if not _inside(charge):
            return None
    odds = density - without
    return Repaired(charge, 1.0 / (1.0 + exp(-min(odds, 700.0)))) if odds > _sure_odds() else None


def _density(now: _Drawn, charge: Charge, gain: float, repaired: Examination) -> float:
    """Return ln of prior times density with a fault corrected.

    Arguments:
        gain: under model error alone, with the prior, in nats above no fault.
        repaired: the examination without the fault.
    """
    prior = now.prior(charge)
    plain = now.log_density + gain - prior  # under model error alone
    return float(np.logaddexp(log_density(repaired, now.measurement), plain)) + prior


class _Drawn:
    """A model as drawn and its data, what a beam model gets wrong as noise.

    Arguments:
        model, measurement: with the faults corrected that were found before.
        reference, width: as in `inquire`.
    """

    def __init__(
        self,
        model: Model,
        measurement: Measurement,
        reference: Measurement | None,
        width: float,
    ) -> None:
        self.model, self.measurement = model, measurement
        self.reference, self.width = reference, width
        self._without: dict[Charge, _Drawn] = {}

    @cached_property
    def state(self) -> State:
        """Return the prediction, and the noise with scales that suit these data best."""
        problem, _ = pose_problem(self.model, self.measurement, (), 0.0)
        before = None if self.reference is None else before_of(problem, self.reference)
        error = model_error_of(problem, before, self.width, 0.0)
        found = state_at(problem, (), np.zeros(0))
        noise = error.noise(error.fit(found))
        return replace(found, problem=replace(problem, noise=noise))

    @cached_property
    def adequacy(self) -> float:
        """Return the probability of what the model as drawn leaves, were it noise."""
        return adequacy(self.state, 0)

    @cached_property
    def log_density(self) -> float:
        """Return ln of the density of the data, in the units that they were measured in."""
        data = self.state.problem.data
        return log_evidence(self.state) - float(np.log(data.std).sum())

    def add_causes(self, explanation: Explanation) -> _Drawn:
        """Return the same with causes in the model, whose sizes are free to first order."""
        other = _Drawn(self.model, self.measurement, self.reference, self.width)
        state = explanation.fit.state
        factor, moved = state.problem.noise.factor, state.slopes @ state.x
        total = factor @ factor.T + state.slopes @ state.slopes.T
        noise = replace(state.problem.noise, factor=np.asarray(la.cholesky(total, lower=True)))
        problem = replace(state.problem, noise=noise, offset=state.problem.offset + moved)
        other.state = replace(state, problem=problem, raw=state.raw + moved)
        return other

    def remove_fault(self, charge: Charge) -> _Drawn:
        """Return the same without a fault."""
        if charge not in self._without:
            self._without[charge] = _Drawn(*charge.repaired, self.reference, self.width)
        return self._without[charge]

    def exactly(self, charge: Charge, gain: float) -> tuple[Charge, float]:
        """Return a fault with its gain at scales of its own; none where it promises nothing.

        Arguments:
            gain: at the present scales.
        """
        if gain <= -settings.as_well:
            return charge, -np.inf
        found = charge if charge.single else self.refine(charge)
        return found, self.gain(found) if _inside(found) else -np.inf

    def refine(self, charge: Charge) -> Charge:
        """Return a fault with its parameter at the scales that suit the data without it."""
        known = charge.suspect.parameter is None
        return charge if known else self.remove_fault(charge).estimate(charge)

    def gain(self, charge: Charge) -> float:
        """Return by how many nats a fault is likelier than none, at scales of its own."""
        try:
            other = self.remove_fault(charge)
            found = other.log_density
        except (FemubenchError, la.LinAlgError):
            return -np.inf
        found += jacobian(self.state.problem.data, other.state.problem.data)
        return found - self.log_density + self.prior(charge)

    @staticmethod
    def prior(charge: Charge) -> float:
        """Return ln of the prior of a fault at its coordinate, times the width of the posterior."""
        if charge.suspect.parameter is None or charge.single:
            return charge.log_prior
        return charge.log_prior - 0.5 * charge.x**2 + log(max(charge.std, settings.negligible))

    def mostly(self, charge: Charge) -> bool:
        """Tell whether a fault is most of what the drawing gets wrong, where it need be.

        Frequencies of a real structure are off by any amount, and a stubby member is as if it were
        turned: a wrong frequency stands out of the others' errors, and what was typed in wrongly
        leaves little to be wrong.
        """
        if charge.fault.side == "input":
            before, after = self.state.raw, self.remove_fault(charge).state.raw
            return float(after @ after) < settings.fault_remainder * float(before @ before)
        if not charge.single:
            return True
        if len(self.measurement) < settings.telling_modes:
            return False
        wide = self.remove_fault(charge).measurement
        m = self.measurement
        raw = self.state.raw - self.state.problem.noise.mean
        rows = self.state.problem.data.by_mode(raw)[: len(m)]
        error = np.square(rows * m.frequency_std / m.frequencies)
        own = wide.frequency_std != m.frequency_std
        return not own.any() or bool(error[~own].sum() < settings.fault_remainder * error.sum())

    def likelier(self, others: Iterable[Measurement]) -> FloatArray:
        """Return by how many nats other data are likelier, each at the scales of these, (k,)."""
        own, noise = self.state.problem.data, self.state.problem.noise
        data = [replace(own, measurement=other) for other in others]
        found, rows = np.full(len(data), -np.inf), [len(one) == len(own) for one in data]
        same = [one for one in data if len(one) == len(own)]
        if not same:
            return found
        ratio = np.array([own.std / one.std for one in same])
        apart = np.array([self.state.against(one) for one in same])
        chi2, log_det = noise.reweigh(apart / ratio - noise.mean, ratio)
        sizes = np.array([_log_size(one) for one in same]) - self._log_size
        found[rows] = sizes - 0.5 * chi2 - log_det - self._plain
        return found

    @cached_property
    def _plain(self) -> float:
        noise = self.state.problem.noise
        return noise.log_density - noise.log_weight - 0.5 * self.state.chi2

    @cached_property
    def _log_size(self) -> float:
        return _log_size(self.state.problem.data)

    def screen(self, charge: Charge) -> tuple[Charge, float]:
        """Return a fault with its parameter estimated, and what it gains at the present scales."""
        try:
            if charge.suspect.parameter is None or charge.single:
                return charge, float(self.likelier([charge.repaired[1]])[0]) + charge.log_prior
            found = self.estimate(charge)
            if not _inside(found):
                return found, -np.inf
            return found, float(self.likelier([found.repaired[1]])[0]) + self.prior(found)
        except (FemubenchError, la.LinAlgError):
            return charge, -np.inf

    def all_screened(self, charges: Sequence[Charge]) -> Weighed:
        """Return every fault as `screened` does; those without a parameter many at once."""
        fixed = [c for c in charges if c.suspect.parameter is None or c.single]
        gains: dict[Charge, float] = {}
        for first in range(0, len(fixed), settings.block):
            some = fixed[first : first + settings.block]
            with suppress(FemubenchError, la.LinAlgError):
                gains.update(zip(some, self.likelier(c.repaired[1] for c in some), strict=True))
        return [
            (c, float(gains[c]) + c.log_prior) if c in gains else self.screen(c) for c in charges
        ]

    def estimate(self, charge: Charge) -> Charge:
        """Return a fault with its parameter at the most probable value."""
        if charge.suspect.parameter is None:
            return charge

        def costs(points: FloatArray) -> FloatArray:
            gains = self.likelier([charge.correct(float(x))[1] for x in points])
            return 0.5 * np.square(points) - np.where(np.isfinite(gains), gains, -1e300)

        def cost(x: float) -> float:
            return float(costs(np.array([x]))[0])

        grid = np.linspace(*_between(charge.suspect.parameter), settings.grid_points)
        nearest = int(np.argmin(costs(grid)))
        between = grid[max(nearest - 1, 0)], grid[min(nearest + 1, settings.grid_points - 1)]
        found = minimize_scalar(cost, bounds=between, method="bounded", options={"xatol": 1e-3})
        x = float(found.x)
        step = settings.coordinate_margin
        bend = cost(x + step) + cost(x - step) - 2.0 * float(found.fun)
        return replace(charge, x=x, std=max(bend / step**2, 1.0) ** -0.5)

    def worth_solving(self, charges: Sequence[Charge]) -> Sequence[Charge]:
        """Return the faults of what was typed in that are tried: none where no error is gross."""
        problem, count = self.state.problem, len(self.measurement)
        error = problem.data.by_mode(self.state.raw)[:count] * self.measurement.frequency_std
        if not (np.abs(error / self.measurement.frequencies) > settings.gross_error).any():
            return []
        return charges[: settings.shortlist // 2 if self.model.size > DENSE_LIMIT else len(charges)]

    def weigh_input(self, charge: Charge) -> Weighed:
        """Return a fault of what was typed in with what it gains at the present scales."""
        problem, noise = self.state.problem, self.state.problem.noise
        try:
            rest = noise.residual(raw_residual(problem, charge.repaired[0]))
        except (FemubenchError, la.LinAlgError):
            return []
        return [(charge, 0.5 * (self.state.chi2 - float(rest @ rest)) + charge.log_prior)]


def _between(parameter: EffectParameter) -> tuple[float, float]:
    """Return the coordinates between which a parameter is sought."""
    (low, high), widest = parameter.range, settings.widest_coordinate
    return max(low, -widest), min(high, widest)


def _inside(charge: Charge) -> bool:
    """Tell whether a parameter is off its bounds, where it makes up for something else."""
    if charge.suspect.parameter is None:
        return True
    low, high = _between(charge.suspect.parameter)
    return low + settings.coordinate_margin < charge.x < high - settings.coordinate_margin


def _weighed(now: _Drawn, faults: Sequence[Fault], effort: Effort) -> Weighed:
    """Return the suspects that promise something, likeliest first, with nats above no fault."""
    charges = charges_of(now.model, now.measurement, faults)
    data = [charge for charge in charges if charge.fault.side == "data"]
    with threadpool_limits(1), effort.scope({"faults": 1}):
        typed = now.worth_solving([charge for charge in charges if charge.fault.side == "input"])
        effort.expect("typed", len(typed))
        promises: Weighed = []
        for charge in typed:
            if effort.stops():
                break
            with effort.piece("typed"):
                promises += now.weigh_input(charge)
        with effort.piece("faults"):
            promises = [*now.all_screened(data), *promises]
            kinds: dict[str, Weighed] = {}
            for charge, gain in in_order(promises, lambda pair: -pair[1]):
                kinds.setdefault(charge.fault.name, []).append((charge, gain))
            few = [pair for kind in kinds.values() for pair in kind[: settings.of_a_kind]]
            # Those that promise something at scales of their own, likeliest first.
            exact = [now.exactly(charge, gain) for charge, gain in few]
            kept = [(c, gain) for c, gain in exact if c.reweighs or np.isfinite(gain)]
            return in_order(kept, lambda pair: -pair[1])


def _possible(
    model: Model, measurement: Measurement, faults: Sequence[Fault], repaired: list[Repaired]
) -> tuple[Model, Measurement]:
    """Return model and data without what cannot be; `repaired` is filled."""
    while len(repaired) < settings.faults_corrected:
        blatant = [c for c in charges_of(model, measurement, faults) if c.suspect.blatant]
        if not blatant:
            break
        costs = [_half_chi2(charge, model, measurement) for charge in blatant]
        best = int(np.argmin(costs))
        gain = _half_chi2(None, model, measurement) - costs[best]
        if not gain > settings.lag:
            break
        others = float(logsumexp(np.array(costs)[best] - np.array(costs)))
        repaired.append(Repaired(blatant[best], exp(-others) / (1.0 + exp(-gain))))
        model, measurement = blatant[best].repaired
    return model, measurement


def _half_chi2(charge: Charge | None, model: Model, measurement: Measurement) -> float:
    """Return half of chi-square of a model as drawn, without a fault; infinite without modes."""
    try:
        if charge is not None:
            model, measurement = charge.repaired
        data = Data(measurement, np.zeros(0))
        noise = Noise.of(np.zeros((len(data), 0)), 0.0)
        problem = place_data(model, data, noise, ())
        return 0.5 * float(np.square(state_at(problem, (), np.zeros(0)).raw).sum())
    except (FemubenchError, la.LinAlgError):
        return np.inf


def log_density(examination: Examination, measured: Measurement) -> float:
    """Return ln of the density of what was measured, over all explanations.

    Arguments:
        examination: of these data, or of the same with some corrected.
        measured: the data as they were measured.
    """
    data = examination.problem.data
    before = replace(data, measurement=measured)
    weights = [e.log_joint for e in examination.posterior.explanations]
    return float(logsumexp(weights)) + jacobian(before, data) - float(np.log(data.std).sum())


def jacobian(before: Data, after: Data) -> float:
    """Return the sum of ln |d after / d before| of data that were exchanged and multiplied."""
    return _log_size(after) - _log_size(before)


def _log_size(data: Data) -> float:
    """Return the sum of ln |datum| of frequencies and shapes, but for those that are zero."""
    values = np.abs(np.concatenate([data.measurement.frequencies, data.shapes.ravel()]))
    return float(np.log(values[values > 0.0]).sum())
