"""Whether data that did not name a cause support it, and what the cause gains there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import log

import numpy as np
import scipy.linalg as la
from scipy.special import chdtrc, logsumexp

from femubench.core.case.case import Case
from femubench.core.diagnosis.verdict import elsewhere, fitted_otherwise, inseparable
from femubench.core.fem.model import Model
from femubench.core.fit.discrepancy import Discrepancy
from femubench.core.fit.extended_model import extend_model, raw_residual
from femubench.core.fit.mesh_error import mesh_bias, mesh_corrections
from femubench.core.fit.modal_fit import Fit, Problem, State, bounds_of, state_at, variance_of
from femubench.core.fit.noise import Noise
from femubench.core.fit.residuals import Data
from femubench.core.inference.effort import Effort
from femubench.core.inference.examine import Examination
from femubench.core.inference.posterior import Explanation, Posterior
from femubench.core.inference.settings import settings
from femubench.core.modal.eigen import enough_modes, keep_last, modes_of
from femubench.core.modal.measurement import Measurement
from femubench.core.schema.diagnosis import Gain, States
from femubench.core.schema.results import Block
from femubench.core.score.responses import rms
from femubench.core.score.scoring import frequency_error, many_modifications, pair_modified
from femubench.core.typing import BoolArray, FloatArray

Blocks = Mapping[str, Block]


def _log_likelihood(errors: FloatArray, std: FloatArray) -> float:
    """Return ln of the probability of errors, integrated over the size of a model error.

    A beam model gets nothing wrong of a frequency as often as not, else a log-normal share.
    """
    widest = settings.widest_coordinate
    z = np.linspace(-widest, widest, 2 * settings.grid_points - 1)
    own = Discrepancy(*settings.unseen_error)
    sizes = own.std(z)
    weights = np.exp(-0.5 * np.square(z))
    sizes, weights = np.append(sizes, 0.0), np.append(0.5 * weights / weights.sum(), 0.5)
    variance = np.square(std) + np.square(sizes)[:, None]
    terms = -0.5 * (np.square(errors) / variance + np.log(variance)).sum(axis=1)
    return float(logsumexp(terms, b=weights))


@dataclass(frozen=True)
class Unseen:
    """Relative frequency errors of unseen modes, without and with the causes.

    Arguments:
        before, after: f_measured / f_predicted - 1 or alike, (k,).
        std: of a datum: measurement, scatter, and the uncertainty of the causes, (k,).
        plain_std: the same without the causes where it is another, since what either takes for
            model error has a size of its own; that is then known, and no more is granted.
    """

    before: FloatArray
    after: FloatArray
    std: FloatArray
    plain_std: FloatArray | None = None

    @cached_property
    def sound(self) -> Unseen:
        """Return the same without gross misses, which no cause explains and none can answer for."""
        miss = np.minimum(np.abs(self.before), np.abs(self.after))
        typical, unusual = float(np.median(miss)) if len(miss) else 0.0, settings.unusual_error
        return self._of(miss <= unusual * max(1.5 * typical, settings.gross_error / unusual))

    def _of(self, rows: BoolArray) -> Unseen:
        plain = None if self.plain_std is None else self.plain_std[rows]
        return Unseen(self.before[rows], self.after[rows], self.std[rows], plain)

    @cached_property
    def seeing(self) -> Unseen:
        """Return those of the sound ones that the causes change."""
        sound = self.sound
        least = settings.telling_deviations * sound.std
        return sound._of(np.abs(sound.before - sound.after) > least)

    @property
    def size(self) -> float:
        """Return by how many deviations in all the causes change the unseen modes."""
        return float(np.linalg.norm((self.before - self.after) / self.std))

    @property
    def visible(self) -> bool:
        """Tell whether the causes change unseen modes by more than noise."""
        return self.sound.size > settings.visible_deviations

    @property
    def log_bayes(self) -> float:
        """Return ln of the Bayes factor of the causes against nothing added.

        Of modes that can see the causes; what either model gets wrong has a size of its own.

        Source: Kass & Raftery (1995), JASA 90, 773-795.
        """
        seeing = self.seeing
        after = np.hypot(seeing.std, settings.idealisation_error * (seeing.before - seeing.after))
        plain = seeing.std if seeing.plain_std is None else seeing.plain_std
        return _log_likelihood(seeing.after, after) - _log_likelihood(seeing.before, plain)

    @property
    def probability(self) -> float:
        """Return the probability of errors as large as those left, were they noise.

        A cause is an idealisation: of what it changes, one part in twenty is its own error.
        """
        sound = self.sound
        own = settings.idealisation_error * (sound.before - sound.after)
        rest = sound.after / np.hypot(sound.std, own)
        return float(chdtrc(len(rest), rest @ rest)) if len(rest) else 1.0

    @property
    def holds(self) -> bool:
        """Tell whether unseen data get no worse by the causes, or cannot see them.

        No real structure is a beam: where more than noise is left, they must get decisively better.
        """
        least = -settings.decisive if self.probability > settings.noise_p else settings.decisive
        return not self.visible or self.log_bayes >= least


def predict_held_out(
    case: Case,
    nominal: Problem,
    best: Problem,
    found: Fit,
    extended: Model,
    scatter: float,
    examination: Examination | None = None,
) -> Unseen:
    """Return the errors of the held-out modes.

    Arguments:
        case: with its held-out modes.
        nominal, best: data and modal coordinates without and with textbook effects.
        found: the causes, in the coordinates of `best`.
        extended: the model with the causes.
        scatter: relative standard deviation of a frequency by ordinary tolerances.
        examination: where what the model gets wrong of the used modes says what it gets wrong of
            the others.
    """
    used, hidden = len(case.used), len(case.held_out)
    if hidden == 0:
        return Unseen(np.zeros(0), np.zeros(0), np.zeros(0))
    everything = case.measurement.select([*case.used, *case.held_out])
    std = _relative_std(everything) * everything.frequencies
    everything = replace(everything, frequency_std=std)
    label = settings.shape_label
    data = Data(everything, nominal.data.bias, nominal.data.still, label)
    noise = Noise.of(np.zeros((len(data), 0)), 0.0)
    rows = slice(used, used + hidden)
    before = state_at(Problem(nominal.model, nominal.space, data, noise), (), np.zeros(0))
    whole = Problem(best.model, best.space, data, noise)
    after = state_at(whole, found.parts, found.state.x)
    modes_of(extended, enough_modes(extended, 2 * len(everything)))  # the most that is asked for
    # A cause may add a mode: the extended model has corrections of its own for the mesh.
    own_bias = mesh_bias(extended, len(nominal.data.bias))
    own_data = data if own_bias is None else Data(everything, own_bias, shape_label=label)
    exact = raw_residual(replace(whole, data=own_data), extended)
    relative = everything.frequency_std[rows] / everything.frequencies[rows]
    spread = data.by_mode(after.jacobian)[rows]
    own = variance_of(spread, found.covariance) if spread.shape[1] else 0.0
    std = np.sqrt(np.square(relative) * (1.0 + own) + scatter**2)
    first, last = data.by_mode(before.raw)[rows], data.by_mode(exact)[rows]
    if examination is None or found.state.problem.noise.beam:
        return Unseen(first * relative, last * relative, std)
    nothing = examination.posterior.nothing.fit.state
    (plain, spared), (mean, error) = examination.foreseen(
        [(nothing, before.raw), (found.state, exact)], data
    )
    error = np.hypot(error, examination.own_share(found.state) * (first - last))
    return Unseen(
        (first - plain) * relative,
        (last - mean) * relative,
        np.hypot(std, relative * error),
        np.hypot(np.hypot(relative, scatter), relative * spared),
    )


def predict_modified(
    case: Case, extended: Model, scatter: float, neighbours: Sequence[Model] = ()
) -> Unseen:
    """Return the errors of the modified structures, all modes in one list.

    Each prediction is corrected for the mesh by that of the same mode of the same model: causes
    and modifications may add modes and change their order.

    Arguments:
        case: with its modifications.
        extended: the model with the causes.
        scatter: relative standard deviation of a frequency by ordinary tolerances.
        neighbours: the model with the causes off by one deviation in independent directions.
    """
    models = (case.model, extended, *neighbours)
    for model in models:
        many = many_modifications(model, case.modifications)
        for change in case.modifications:
            pair_modified(model, change, many=many)
    before, after, std = [], [], []
    for change in case.modifications:
        m = change.measurement
        predicted = np.array(
            [
                [mode.predicted_hz or np.nan for mode in pair_modified(model, change)]
                for model in models
            ]
        )
        pairs = zip((case.model, extended), predicted, strict=False)
        found = [mesh_corrections(change.modify(model), hertz) for model, hertz in pairs]
        # One mesh serves both where the other is not known.
        known = [row for row in found if row is not None]
        rows = [known[0] if row is None and known else row for row in found]
        correct = np.array([np.ones(len(m)) if row is None else 1.0 + row for row in rows])
        errors = m.frequencies / (predicted[:2] * correct) - 1.0
        spread = np.square(predicted[2:] / predicted[1] - 1.0).sum(axis=0)
        deviation = np.sqrt(np.square(_relative_std(m)) + scatter**2 + spread)
        paired = np.isfinite(errors).all(axis=0) & np.isfinite(deviation)
        before.append(errors[0, paired])
        after.append(errors[1, paired])
        std.append(deviation[paired])
    empty = np.zeros(0)
    return Unseen(*(np.concatenate([*rows, empty]) for rows in (before, after, std)))


def _relative_std(measurement: Measurement) -> FloatArray:
    """Return the relative deviations of frequencies; the median where one has none."""
    std = measurement.frequency_std / measurement.frequencies
    known = np.isfinite(std) & (std > 0.0)
    typical = float(np.median(std[known])) if known.any() else float("nan")
    return np.where(known, std, typical)


def predict_left_out(posterior: Posterior, leader: Explanation) -> Unseen:
    """Return the errors of every used mode, predicted from the others by all that bear a name.

    In closed form: every explanation is linear in its causes nearby, and is weighed anew without
    the frequency and the shape of the mode, so that these have no part in what predicts it.

    Source: Sundararajan & Keerthi (2001), Neural Computation 13, 1103-1118, for leaving out in
    closed form.
    """
    m = leader.fit.state.problem.data.measurement
    relative = m.frequency_std / m.frequencies
    members = [e for e, _ in posterior.members(posterior.key(leader))][: settings.leading]
    known = [_leave_out(e.fit.state) for e in members]
    trust = [e.fit.state.problem.noise.trust for e in members]
    errors, variances, densities = (np.array(rows) for rows in zip(*known, strict=True))
    logs = np.array([e.log_weight for e in members])[:, None] - np.array(trust)[:, None] * densities
    weights = np.exp(logs - logsumexp(logs, axis=0))
    after = (weights * errors).sum(axis=0)
    variance = (weights * (variances + np.square(errors - after))).sum(axis=0)
    before, plain, _ = _leave_out(posterior.nothing.fit.state)
    rows = before, after, np.sqrt(variance), np.sqrt(plain)
    return Unseen(*(relative * row for row in rows))


def _leave_out(state: State) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return errors of frequencies from all other modes, variances, ln density of each mode.

    Of the mode means its frequency and its shape; in deviations of the measurement, (m,) each.
    """
    data, noise = state.problem.data, state.problem.noise
    total = noise.factor @ noise.factor.T + state.slopes @ state.slopes.T
    total = data.by_mode(data.by_mode(total).T).T
    rest = data.by_mode(state.raw - noise.mean + state.slopes @ state.x)
    precision = la.inv(total)
    pulled, count = precision @ rest, len(data.measurement)
    found = []
    for j in range(count):
        rows = np.append(j, count + np.flatnonzero(data.shape_rows[0] == j))
        spread = la.inv(precision[np.ix_(rows, rows)])
        error = spread @ pulled[rows]
        density = -0.5 * (error @ pulled[rows] + np.linalg.slogdet(spread)[1])
        found.append((error[0], spread[0, 0], density))
    errors, variances, densities = np.array(found).reshape(-1, 3).T
    return errors, variances, densities


def change_left(states: States, before: Blocks, after: Blocks) -> tuple[float, float] | None:
    """Return the rms change since the reference and what the causes leave of it, in percent.

    Over all modes that both states and both models have; None where there is none.

    Arguments:
        states: the two measurements compared.
        before, after: modes of the present state with those of the model without and with causes.
    """
    known = {row.mode: np.log(row.present_hz / row.reference_hz) for row in states.modes}
    rows = []
    for name in before.keys() & {"used", "higher"}:
        for one, other in zip(before[name].modes, after[name].modes, strict=True):
            hertz = one.predicted_hz or 0.0, other.predicted_hz or 0.0
            if one.number in known and min(hertz) > 0.0:
                rows.append((known[one.number], known[one.number] - np.log(hertz[1] / hertz[0])))
    if not rows:
        return None
    measured, left = 100.0 * np.sqrt(np.square(rows).mean(axis=0))
    return float(measured), float(left)


def rms_gain_of(before: Blocks, after: Blocks, crossed: Unseen | None) -> Gain:
    """Return root mean squares of relative frequency errors in percent, before and after.

    The measure of `Block`: a measured mode without a partner counts 100 %.
    """
    pairs = {
        name: (before[name].rms_percent, after[name].rms_percent)
        for name in ("used", "higher", "modified")
        if name in before and name in after
    }
    cross = None
    if crossed is not None and len(crossed.before):
        cross = 100.0 * rms(crossed.before), 100.0 * rms(crossed.after)
    return Gain(pairs["used"], pairs.get("higher"), pairs.get("modified"), cross)


def gain_of(before: Blocks, after: Blocks, crossed: Unseen | None) -> Gain:
    """Return medians of absolute frequency errors in percent, before and after.

    Of modes that have a partner in both models; nan where there is none.
    """

    def pair(name: str) -> tuple[float, float] | None:
        if name not in before or name not in after:
            return None
        pairs = zip(before[name].modes, after[name].modes, strict=True)
        both = [pair for pair in pairs if all(mode.predicted_hz is not None for mode in pair)]
        errors = [[frequency_error(mode) for mode in pair] for pair in both]
        first, second = 100.0 * np.median(errors, axis=0) if both else (np.nan, np.nan)
        return float(first), float(second)

    used = pair("used")
    assert used is not None
    cross = None
    if crossed is not None and len(crossed.before):
        cross = tuple(100.0 * float(np.median(np.abs(e))) for e in (crossed.before, crossed.after))
    return Gain(used, pair("higher"), pair("modified"), cross)  # type: ignore[arg-type]


def extend_by(model: Model, explanation: Explanation) -> Model:
    """Return the model with textbook effects and causes in it."""
    # The last one alone: an explanation holds all that it was fitted with.
    make = partial(_extended, model, explanation, explanation.fit.state.x)
    return keep_last(model, "extended by", explanation, make)


def _extended(model: Model, explanation: Explanation, x: FloatArray) -> Model:
    """Return a model of its own with an explanation in it, at coordinates of its causes."""
    base = extend_model(model, explanation.base.parts, explanation.base.x)
    return extend_model(base, explanation.parts, x)


def unseen_of(
    case: Case,
    examination: Examination,
    explanation: Explanation,
    model: Model,
    *,
    sharply: bool = True,
) -> tuple[Unseen, ...]:
    """Return the errors of an explanation on held-out modes and on the modified structures.

    Arguments:
        case: what holds them.
        examination: what the explanation was weighed in.
        explanation: base and causes.
        model: with the explanation in it.
        sharply: take the sizes of the causes for certain on the modified structures, which saves
            a solution a size; held-out modes know their uncertainty anyway.
    """
    near = () if sharply else _neighbours(case.model, explanation)
    return (
        predict_held_out(
            case,
            examination.problem,
            examination.problem_of(explanation),
            explanation.fit,
            model,
            examination.scatter,
            examination,
        ),
        predict_modified(case, model, examination.scatter, near),
    )


def _neighbours(model: Model, explanation: Explanation) -> list[Model]:
    """Return the model with the causes off by one deviation in independent directions."""
    found = explanation.fit
    size, turn = np.linalg.eigh(found.covariance)
    low, high = bounds_of(found.parts)
    steps = [
        np.clip(found.state.x + np.sqrt(s) * t, low, high)
        for s, t in zip(size, turn.T, strict=True)
    ]
    return [_extended(model, explanation, x) for x in steps]


def holds(
    case: Case,
    examination: Examination,
    explanation: Explanation,
    model: Model,
    unseen: Sequence[Unseen],
) -> bool:
    """Tell whether unseen data get no worse by an explanation."""
    if all(part.holds for part in unseen):
        return True
    if not explanation.parts or not case.modifications:
        return False
    unseen = unseen_of(case, examination, explanation, model, sharply=False)
    return all(part.holds for part in unseen)


def find_held(
    case: Case,
    examination: Examination,
    effort: Effort | None = None,
    known: Sequence[Unseen] = (),
) -> Explanation | None:
    """Return what unseen data bear out of all that the used data cannot tell from the best guess.

    That is the best guess, unless all data together, used and unseen, speak for another name of
    the group: decisively, or at all where unseen data refute the best guess. Where no name is
    borne out, it is the same name with other sizes fitted or at a place about as likely, or None.

    Arguments:
        case: what holds the unseen data.
        examination: of the used ones.
        effort: counts the explanations that are judged.
        known: what `unseen_of` says of the best guess, where that is known.
    """
    effort = effort or Effort()
    posterior, best = examination.posterior, examination.best
    name = posterior.key(best)
    others = inseparable(posterior)[0][1:] if name else ()
    with effort.piece("unseen"):
        first = _judged(case, examination, best, known)
    kinds = (fitted_otherwise, elsewhere) if name and not first[0] else ()
    places = [e for of in kinds for e in of(posterior, best)][: settings.largest_group]
    effort.expect("unseen", len(others) + len(places))
    rivals = []
    for key in others:
        if effort.stops():
            break
        with effort.piece("unseen"):
            is_held, log_bayes = _judged(case, examination, posterior.best(key))
        gain = log_bayes - first[1] + log(posterior.names[key] / posterior.names[name])
        if is_held and gain > (settings.decisive if first[0] else 0.0):
            rivals.append((gain, posterior.best(key)))
    if rivals:
        return max(rivals, key=lambda pair: pair[0])[1]
    if first[0]:
        return best
    for found in places:
        if effort.stops():
            break
        with effort.piece("unseen"):
            is_held, _ = _judged(case, examination, found)
        if is_held:
            return found
    return None


def _judged(
    case: Case, examination: Examination, found: Explanation, known: Sequence[Unseen] = ()
) -> tuple[bool, float]:
    """Tell whether unseen data bear an explanation out, and its ln Bayes factor on them."""
    if found is examination.best:
        model = extend_by(case.model, found)
    else:  # asked for once: it and its modes need not last
        model = _extended(case.model, found, found.fit.state.x)
    unseen = known or unseen_of(case, examination, found, model)
    log_bayes = sum(part.log_bayes for part in unseen)
    return holds(case, examination, found, model, unseen), log_bayes
