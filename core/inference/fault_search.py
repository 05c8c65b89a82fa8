"""Faults of the data and of what was typed in, weighed beside physical causes on the same data.

A suspect is first tried on explanations that are known: their predictions stay, their sizes are
free to first order. What promises enough is mended, and the physical causes are sought anew. All
are compared by the density of what was measured, as it was measured: where mending multiplies a
datum, times that factor; where it widens a deviation, over that deviation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, log
from typing import Literal

import numpy as np
import scipy.linalg as la
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp

from femubench.core.effect.suspect import Corrected, Suspect
from femubench.core.errors import FemubenchError
from femubench.core.fem.model import Model
from femubench.core.inference.examine import Examination
from femubench.core.inference.extended_model import raw_residual
from femubench.core.inference.fit import state_at
from femubench.core.inference.noise import Noise
from femubench.core.inference.posterior import Explanation
from femubench.core.inference.residuals import Data
from femubench.core.inference.static_response import Basis, placed
from femubench.core.modal.eigen import DENSE_LIMIT
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Fault
from femubench.core.ties import in_order
from femubench.core.typing import BoolArray, FloatArray

# That data or input are wrong somewhere, before any datum is seen: over kinds, then suspects.
PRIOR_OF_FAULT = 0.1
_SLACK = 3.0  # nats behind the best explanation within which a suspect is worth a search
_NAMES, _TRIED, _MOST, _SOLVED = 5, 2, 3, 20
_MOSTLY, _PART, _DOMINANT, _FAR = 0.5, 0.3, 0.7, 0.1  # shares of chi-square, of what is promised
_CLEARLY, _SHARE = 20.0, 0.1  # nats, and of half chi-square, that mending what was typed in gains
_ADEQUATE, _GOOD, _UNLIKELY, _GROSS = 1e-3, 0.05, 3.0, 0.1
_FREE = 1e3  # deviation of the scale of a shape, in those of the data
# Of a coordinate: for a slope, for a curvature, and what counts as at a bound.
_STEP, _CURVED, _EDGE = 1e-4, 0.02, 0.01

Depth = Literal["nothing", "one", "several"]
Examine = Callable[[Model, Measurement, Depth], Examination]


@dataclass(frozen=True, eq=False)
class Charge:
    """A suspect, and the model and the data that it was found in.

    Arguments:
        fault: the kind.
        suspect: the place.
        model, measurement: as they are.
        log_prior: ln of the odds of this fault here, against no fault at all.
        x: coordinate of its parameter, 0 without one.
        std: deviation of the coordinate.
        score: ln of prior times evidence, as known explanations promise it.
    """

    fault: Fault
    suspect: Suspect
    model: Model
    measurement: Measurement
    log_prior: float
    x: float = 0.0
    std: float = 0.0
    score: float = -np.inf

    def corrected(self, x: float) -> Corrected:
        """Return model and data as they are right at a coordinate of the parameter."""
        parameter = self.suspect.parameter
        value = 0.0 if parameter is None else float(parameter.value(np.array(x)))
        return self.suspect.corrected(self.model, self.measurement, value)

    @cached_property
    def rows(self) -> BoolArray:
        """Return which data it concerns: frequencies, then readings by mode, (m + m n_sensors,)."""
        _, other = self.corrected(1.0)
        parts = []
        for names in (("frequencies", "frequency_std"), ("shapes", "shape_std")):
            pairs = [(getattr(self.measurement, name), getattr(other, name)) for name in names]
            differ = [(one != two) & ~(np.isnan(one) & np.isnan(two)) for one, two in pairs]
            parts.append(np.logical_or(*differ).T.ravel())
        return np.concatenate(parts)

    @cached_property
    def reweighs(self) -> bool:
        """Tell whether it is a matter of deviations alone."""
        if self.fault.side == "input":
            return False
        _, other = self.corrected(1.0)
        names = ("frequencies", "shapes")
        pairs = [(getattr(self.measurement, name), getattr(other, name)) for name in names]
        return all(np.array_equal(one, two, equal_nan=True) for one, two in pairs)

    @property
    def single(self) -> bool:
        """Tell whether a parameter is to be found from a single datum."""
        return self.suspect.parameter is not None and int(self.rows.sum()) == 1

    @property
    def mended(self) -> Corrected:
        """Return model and data without the fault.

        A single datum cannot tell its own error: it is discounted, by what the error may be.
        """
        if not self.single:
            return self.corrected(self.x)
        (_, less), (_, more) = self.corrected(-_STEP), self.corrected(_STEP)
        wide = {
            std: np.hypot(
                getattr(self.measurement, std),
                np.nan_to_num(getattr(more, name) - getattr(less, name)) / (2.0 * _STEP),
            )
            for name, std in (("frequencies", "frequency_std"), ("shapes", "shape_std"))
        }
        return self.model, replace(self.measurement, **wide)


@dataclass(frozen=True)
class Mended:
    """A fault that was found, with the probability that it is this one at this place."""

    charge: Charge
    probability: float


@dataclass(frozen=True)
class Inquiry:
    """An examination of model and data with the faults mended that were found."""

    examination: Examination
    mended: tuple[Mended, ...] = ()


def inquire(
    model: Model, measurement: Measurement, faults: Iterable[Fault], examine: Examine
) -> Inquiry:
    """Weigh explanations of data by physical causes, and by faults beside them.

    Arguments:
        model: the nominal model.
        measurement: the used modes and nothing else.
        faults: what may be wrong with either.
        examine: from model, data and how many causes are sought to their examination.

    Raises:
        NotApplicable: when a used frequency has no standard deviation.
        ModelError: when the model has no modes.
    """
    known = tuple(faults)
    mended: list[Mended] = []
    model, measurement = _possible(model, measurement, known, mended)
    if not known:
        return Inquiry(examine(model, measurement, "several"))
    file = _File(model, measurement, known, examine)
    # The long search for several causes of data that are wrong is put off.
    depth: Depth = "one" if file.promised else "several"
    while len(mended) < _MOST:
        found = file.without_fault(depth)
        if found is not None:
            file, fault = found
            mended.append(fault)
        elif depth == "several":
            break
        depth = "several"
    return Inquiry(file.seen("several"), tuple(mended))


class _File:
    """All suspects in a model and its data, and what was seen of them.

    Arguments:
        model, measurement: with the faults mended that were found before.
        faults, examine: as in `inquire`.
    """

    def __init__(
        self, model: Model, measurement: Measurement, faults: Sequence[Fault], examine: Examine
    ) -> None:
        self.model, self.measurement = model, measurement
        self.faults, self.examine = faults, examine
        charges = _charges(model, measurement, faults)
        self.data = [charge for charge in charges if charge.fault.side == "data"]
        self.input = [charge for charge in charges if charge.fault.side == "input"]
        self._seen: dict[Depth, Examination] = {}
        self._mended: dict[tuple[str, str], _File] = {}

    def seen(self, depth: Depth) -> Examination:
        """Return the examination of model and data as they are."""
        if depth not in self._seen:
            self._seen[depth] = self.examine(self.model, self.measurement, depth)
        return self._seen[depth]

    def mended(self, charge: Charge) -> _File:
        """Return the file without a fault."""
        key = charge.suspect.place, charge.suspect.words
        if key not in self._mended:
            self._mended[key] = _File(*charge.mended, self.faults, self.examine)
        return self._mended[key]

    @cached_property
    def gains(self) -> list[tuple[Charge, float]]:
        """Return what was typed in with what mending it gains on the model as drawn, in nats."""
        bare = self.seen("nothing")
        state = bare.posterior.explanations[0].fit.state
        most = _SOLVED if self.model.size > DENSE_LIMIT else len(self.input)
        found = []
        for charge in self.input[:most]:
            try:
                raw = raw_residual(bare.problem, charge.mended[0])
            except (FemubenchError, la.LinAlgError):
                continue
            white = state.residual + state.problem.noise.whiten(raw - state.raw)
            found.append((charge, 0.5 * (state.chi2 - float(white @ white))))
        return found

    @cached_property
    def gross(self) -> bool:
        """Tell whether the model as drawn misses a frequency by more than causes explain."""
        state = self.seen("nothing").posterior.explanations[0].fit.state
        m = self.measurement
        error = state.raw[: len(m)] * m.frequency_std / m.frequencies
        return bool((np.abs(error) > _GROSS).any())

    @property
    def promised(self) -> bool:
        """Tell whether a single fault mends most of what the model as drawn gets wrong."""
        before = self.seen("nothing").posterior.explanations[0]
        if self.seen("nothing").adequacy > _ADEQUATE:
            return False
        scores = (c.score for c in self.promising("nothing") if not c.reweighs)
        best = max(scores, default=-np.inf)
        return best - before.log_weight > max(_CLEARLY, _MOSTLY * 0.5 * before.chi2)

    def promising(self, depth: Depth) -> list[Charge]:
        """Return the suspects that are worth a search, best first."""
        now = self.seen(depth)
        explanations = now.posterior.explanations
        good = now.adequacy > _GOOD and len(now.best.parts) < 2
        plain = next(e for e in explanations if not e.parts and not e.base.parts)
        top = explanations[0].log_weight
        floor = top - (0.0 if good else _SLACK)
        names = list(now.posterior.names)[: 1 if good else _NAMES]
        # With fewer causes too: one of many may stand for the fault.
        counts = {len(e.parts): e for e in reversed(explanations)} if not good else {}
        chosen = (*map(now.posterior.best, names), *counts.values(), plain)
        known = [_Known(e) for e in {id(e): e for e in chosen}.values()]
        some = now.adequacy < _ADEQUATE
        tried = (_best_on(known, charge, floor, some=some) for charge in self.data)
        found = [charge for charge in tried if charge is not None]
        if self.gross or (depth != "nothing" and _strained(now)):
            for charge, gain in self.gains:
                score = plain.log_weight + gain + charge.log_prior
                clearly = gain > max(_CLEARLY, _SHARE * 0.5 * plain.chi2)
                if score > floor or (now.adequacy < _ADEQUATE and clearly):
                    found.append(replace(charge, score=score))
        return in_order(found, lambda charge: -charge.score)

    def widens(self, charge: Charge) -> bool:
        """Tell whether mending a fault widens deviations."""
        _, other = charge.mended
        wider = other.frequency_std > self.measurement.frequency_std
        return bool(wider.any() or (other.shape_std > self.measurement.shape_std).any())

    def density(self, charge: Charge) -> float:
        """Return ln of prior times density without a fault and with one cause at most."""
        try:
            seen = self.mended(charge).seen("one")
        except (FemubenchError, la.LinAlgError):
            return -np.inf
        return log_density(seen, self.measurement) + charge.log_prior

    def without_fault(self, depth: Depth) -> tuple[_File, Mended] | None:
        """Return the file without the most probable fault; None where none is more likely.

        Arguments:
            depth: to which the data as they are were searched; if not for several causes, a fault
                must explain all by itself, where no single cause does.
        """
        found = self.promising(depth)
        top = self.seen(depth).posterior.explanations[0].log_weight
        data = [charge for charge in found if charge.fault.side == "data"]
        typed = [charge for charge in found if charge.fault.side == "input"]
        definite = [charge for charge in data if not charge.reweighs]
        # What was typed in was tried without any cause, which is a worse promise than the others.
        # Other deviations would excuse whatever is wrong: they are the last resort.
        near = [*_near(definite, top)[:_TRIED], *_near(typed, top)[:1]]
        for charges in (near, _near([charge for charge in data if charge.reweighs], top)[:1]):
            mended = self._without(charges, depth)
            if mended is not None:
                return mended
        return None

    def _without(self, charges: Sequence[Charge], depth: Depth) -> tuple[_File, Mended] | None:
        """Return the file without the most probable of some faults, if it stands."""
        if not charges:
            return None
        pairs = [(self.density(charge) if len(charges) > 1 else 0.0, charge) for charge in charges]
        (least, best), *others = in_order(pairs, lambda pair: -pair[0])
        if least == -np.inf:
            return None
        mended = self.mended(best)
        if best.reweighs and self.widens(best) and mended.seen("one").best.parts:
            return None
        now, seen = self.seen(depth), mended.seen("several")
        if best.suspect.parameter is not None:
            again = _Known(seen.best).estimated(best)
            best = replace(best, x=again.x, std=again.std)
        found = log_density(seen, self.measurement) + best.log_prior
        rivals = [log_density(now, self.measurement), *(density for density, _ in others)]
        probability = exp(found - float(logsumexp([found, *rivals])))
        if depth == "one" and (seen.best.parts or now.adequacy > _ADEQUATE):
            return None
        explained = seen.adequacy > _ADEQUATE or (
            not best.reweighs and seen.best.chi2 < (1.0 - _DOMINANT) * now.best.chi2
        )
        if probability < 0.5 or not explained:
            return None
        return mended, Mended(best, probability)


def _near(ranked: Sequence[Charge], top: float) -> list[Charge]:
    """Return the first few suspects that promise about as much as the best one of them."""
    if not ranked:
        return []
    best = ranked[0].score
    return [c for c in ranked if c.score > best - max(10.0, _FAR * (best - top))]


def _strained(now: Examination) -> bool:
    """Tell whether physical causes explain the data badly, or by several or unlikely sizes."""
    x = now.best.fit.state.x
    unlikely = bool((np.abs(x) > _UNLIKELY).any())
    return now.adequacy < _ADEQUATE or len(now.best.parts) > 1 or unlikely


def _charges(model: Model, measurement: Measurement, faults: Sequence[Fault]) -> list[Charge]:
    """Return every suspect with its prior."""
    kinds = [(fault, fault.suspects(model, measurement)) for fault in faults]
    kinds = [(fault, suspects) for fault, suspects in kinds if suspects]
    each = log(PRIOR_OF_FAULT / (1.0 - PRIOR_OF_FAULT) / max(len(kinds), 1))
    return [
        Charge(fault, suspect, model, measurement, each - log(len(suspects)))
        for fault, suspects in kinds
        for suspect in suspects
    ]


def _possible(
    model: Model, measurement: Measurement, faults: Sequence[Fault], mended: list[Mended]
) -> Corrected:
    """Return model and data without what cannot be; `mended` is filled."""
    while len(mended) < _MOST:
        blatant = [c for c in _charges(model, measurement, faults) if c.suspect.blatant]
        if not blatant:
            break
        costs = [_half_chi2(*charge.mended) for charge in blatant]
        best = int(np.argmin(costs))
        gain = _half_chi2(model, measurement) - costs[best]
        if not gain > _CLEARLY:
            break
        others = float(logsumexp(np.array(costs)[best] - np.array(costs)))
        mended.append(Mended(blatant[best], exp(-others) / (1.0 + exp(-gain))))
        model, measurement = blatant[best].mended
    return model, measurement


def _half_chi2(model: Model, measurement: Measurement) -> float:
    """Return half of chi-square of a model as drawn; infinite where it has no modes."""
    try:
        data = Data(measurement, np.zeros(0))
        noise = Noise.of(np.zeros((len(data), 0)), 0.0)
        problem = placed(Basis.of(model, measurement), data, noise, ())
        return 0.5 * float(np.square(state_at(problem, (), np.zeros(0)).raw).sum())
    except (FemubenchError, la.LinAlgError):
        return np.inf


def log_density(examination: Examination, measured: Measurement) -> float:
    """Return ln of the density of what was measured, over all explanations.

    Arguments:
        examination: of these data, or of the same with some mended.
        measured: the data as they were measured.
    """
    data = examination.problem.data
    before = replace(data, measurement=measured)
    weights = [e.log_weight for e in examination.posterior.explanations]
    return float(logsumexp(weights)) + _jacobian(before, data) - float(np.log(_std(data)).sum())


def _std(data: Data) -> FloatArray:
    """Return the standard deviation of every datum, (n_data,)."""
    mode, sensor = data.shape_rows
    mass = [] if data.mass is None else [data.mass[1]]
    return np.concatenate([data.measurement.frequency_std, 1.0 / data.weight[sensor, mode], mass])


def _jacobian(before: Data, after: Data) -> float:
    """Return the sum of ln |d after / d before| of data that were exchanged and multiplied."""
    sizes = []
    for data in (after, before):
        values = np.abs(np.concatenate([data.measurement.frequencies, data.shapes.ravel()]))
        sizes.append(np.log(values[values > 0.0]).sum())
    return float(sizes[0] - sizes[1])


class _Known:
    """An explanation, its sizes free to first order.

    Arguments:
        explanation: fitted.
    """

    def __init__(self, explanation: Explanation) -> None:
        self.explanation = explanation
        state = self.state = explanation.fit.state
        factor = state.problem.noise.factor
        slopes = factor @ state.jacobian
        self.covariance = factor @ factor.T + slopes @ slopes.T
        self.rest = factor @ state.residual + slopes @ state.x
        self.std = _std(state.problem.data)
        self.base = self._density(self.rest, self.covariance)

    def _density(self, rest: FloatArray, covariance: FloatArray) -> float:
        lower = la.cholesky(covariance, lower=True)
        white = la.solve_triangular(lower, rest, lower=True)
        return -0.5 * float(white @ white) - float(np.log(lower.diagonal()).sum())

    def gain(self, measurement: Measurement) -> float:
        """Return by how much other data are more probable, in nats."""
        own = self.state.problem.data
        data = replace(own, measurement=measurement)
        if len(data) != len(own):
            return -np.inf
        ratio = _std(data) / self.std
        rest = self.rest + ratio * self.state.against(data) - self.state.raw
        covariance = self.covariance + np.diag(np.square(ratio) - 1.0)
        return self._density(rest, covariance) - self.base + _jacobian(own, data)

    @cached_property
    def freed(self) -> tuple[FloatArray, FloatArray]:
        """Return the inverse covariance with the scales of all shapes free, and times the rest."""
        data = self.state.problem.data
        mode, sensor = data.shape_rows
        scaled, _ = data.scaled(self.state.readings[None])
        count = len(data.measurement)
        scale = np.zeros((len(data), count))
        scale[count + np.arange(len(mode)), mode] = (data.weight * scaled[0])[sensor, mode]
        inverse = la.inv(self.covariance + _FREE**2 * scale @ scale.T)
        return inverse, inverse @ self.rest

    @cached_property
    def slack(self) -> float:
        """Return what chi-square falls by where the scales of all shapes are free."""
        fixed = float(self.rest @ la.solve(self.covariance, self.rest, assume_a="pos"))
        return max(fixed - float(self.rest @ self.freed[1]), 0.0)

    def most(self, rows: BoolArray) -> float:
        """Return what could be gained at most without some data, (n_data,), in nats."""
        inverse, pull = self.freed
        own = np.flatnonzero(rows)
        if not len(own):
            return 0.0
        dropped = float(pull[own] @ np.linalg.solve(inverse[np.ix_(own, own)], pull[own]))
        return 0.5 * (dropped + self.slack)

    def tried(self, charge: Charge) -> Charge:
        """Return a charge with its parameter estimated, and what it promises here."""
        if charge.suspect.parameter is None or charge.single:
            gain = self.gain(charge.mended[1])
            return self._with(charge, 0.0, 0.0, gain + charge.log_prior)
        # At its bounds a parameter makes up for something else.
        low, high = charge.suspect.parameter.range
        found = self.estimated(charge)
        return found if low + _EDGE < found.x < high - _EDGE else replace(found, score=-np.inf)

    def estimated(self, charge: Charge) -> Charge:
        """Return a charge with its parameter at its most probable value."""
        assert charge.suspect.parameter is not None

        def cost(x: float) -> float:
            gain = self.gain(charge.corrected(x)[1])
            return 0.5 * x**2 - (gain if np.isfinite(gain) else -1e300)

        found = minimize_scalar(cost, bounds=charge.suspect.parameter.range, method="bounded")
        x, least = float(found.x), float(found.fun)
        bend = cost(x + _CURVED) + cost(x - _CURVED) - 2.0 * least
        curvature = max(bend / _CURVED**2, 1.0)
        prior = charge.log_prior - 0.5 * (x**2 + log(curvature))
        return self._with(
            replace(charge, log_prior=prior),
            x,
            curvature**-0.5,
            charge.log_prior - least - 0.5 * log(curvature),
        )

    def _with(self, charge: Charge, x: float, std: float, gain: float) -> Charge:
        return replace(charge, x=x, std=std, score=self.explanation.log_weight + gain)


def _best_on(known: Sequence[_Known], charge: Charge, floor: float, *, some: bool) -> Charge | None:
    """Return a charge on the explanation where it promises most; None where it is not enough.

    Arguments:
        known: explanations.
        charge: of the data.
        floor: of ln prior times evidence.
        some: whether it also does to take away a good part of what an explanation leaves.
    """
    best: Charge | None = None
    for one in known:
        data = one.state.problem.data
        mode, sensor = data.shape_rows
        count, sensors = len(data.measurement), len(data.weight)
        rows = np.zeros(len(data), dtype=bool)
        chosen = np.concatenate([np.arange(count), count + mode * sensors + sensor])
        rows[: len(chosen)] = charge.rows[chosen]
        own = one.explanation.log_weight
        part = own + max(_CLEARLY, _PART * 0.5 * one.state.chi2) if some else np.inf
        enough = min(floor, part)
        if not charge.reweighs and own + charge.log_prior + one.most(rows) < enough:
            continue
        tried = one.tried(charge)
        if tried.score > max(enough, -np.inf if best is None else best.score):
            best = tried
    return best
