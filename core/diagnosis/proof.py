"""Whether data that did not name a cause support it, and what the cause gains there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from femubench.core.case.case import Case
from femubench.core.diagnosis.verdict import inseparable
from femubench.core.fem.model import Model
from femubench.core.inference.examine import Examination
from femubench.core.inference.extended_model import extended, raw_residual
from femubench.core.inference.fit import Fit, Problem, bounds_of, fit, state_at
from femubench.core.inference.noise import Noise
from femubench.core.inference.posterior import Explanation, Key, Posterior
from femubench.core.inference.residuals import Data
from femubench.core.modal.measurement import Measurement
from femubench.core.schema.diagnosis import Gain
from femubench.core.schema.results import Block, PairedMode
from femubench.core.score.scoring import frequency_error, modified_modes
from femubench.core.typing import FloatArray

# Below this many deviations unseen data cannot tell one model from another.
_CLEARLY = 3.0
_HALF_WAY = 0.5
_IDEAL = 0.05
_INADEQUATE, _GOOD = 2e-3, 0.05
# What unseen errors must fall by where they stay more than noise: no real structure is a beam.
# Physics from the textbook need not be all that is missing; a fitted cause must carry further.
_HALVED, _FOURFOLD = 2.0, 4.0
_FEW = 2


@dataclass(frozen=True)
class Unseen:
    """Relative frequency errors of unseen modes, without and with the causes.

    Arguments:
        before, after: f_measured / f_predicted - 1 or alike, (k,).
        std: of a datum: measurement, scatter, and the uncertainty of the causes, (k,).
    """

    before: FloatArray
    after: FloatArray
    std: FloatArray

    @property
    def size(self) -> float:
        """Return by how many deviations in all the causes change the unseen modes."""
        return float(np.linalg.norm((self.before - self.after) / self.std))

    @property
    def share(self) -> float:
        """Return how far the causes move the prediction towards the data: 1 for all the way.

        Its standard deviation is 1 / `size`.
        """
        shift = (self.before - self.after) / self.std
        size = float(shift @ shift)
        return float(shift @ (self.before / self.std)) / size if size > 0.0 else 1.0

    @property
    def visible(self) -> bool:
        """Tell whether the causes change unseen modes by more than noise."""
        return self.size > _CLEARLY

    @property
    def probability(self) -> float:
        """Return the probability of errors as large as those left, were they noise.

        A cause is an idealisation: of what it changes, one part in twenty is its own error.
        """
        rest = self.after / np.hypot(self.std, _IDEAL * (self.before - self.after))
        return float(chdtrc(len(rest), rest @ rest)) if len(rest) else 1.0

    def confirms(self, fitted: int) -> bool:
        """Tell whether unseen data bear the causes out, or cannot see them.

        More than two fitted causes may bend to any used data: what they leave of unseen data must
        be noise.

        Arguments:
            fitted: number of causes that are more than textbook physics.
        """
        if len(self.before) == 0:
            return True
        if self.share < _HALF_WAY and (1.0 - self.share) * self.size > _CLEARLY:
            return False
        if fitted > _FEW:
            return self.probability > _GOOD
        if self.probability > _INADEQUATE:
            return True
        before, after = (np.median(np.abs(e / self.std)) for e in (self.before, self.after))
        return bool(before >= (_FOURFOLD if fitted else _HALVED) * after)


def held_out(
    case: Case, nominal: Problem, best: Problem, found: Fit, extended: Model, scatter: float
) -> Unseen:
    """Return the errors of the held-out modes.

    Arguments:
        case: with its held-out modes.
        nominal, best: data and modal coordinates without and with textbook effects.
        found: the causes, in the coordinates of `best`.
        extended: the model with the causes.
        scatter: relative standard deviation of a frequency by ordinary tolerances.
    """
    used, hidden = len(case.used), len(case.held_out)
    if hidden == 0:
        return Unseen(np.zeros(0), np.zeros(0), np.zeros(0))
    everything = case.measurement.select([*case.used, *case.held_out])
    std = _relative_std(everything) * everything.frequencies
    everything = replace(everything, frequency_std=std)
    data = Data(everything, nominal.data.bias)
    noise = Noise.of(np.zeros((len(data), 0)), 0.0)
    rows = slice(used, used + hidden)
    before = state_at(Problem(nominal.model, nominal.space, data, noise), (), np.zeros(0))
    whole = Problem(best.model, best.space, data, noise)
    after = state_at(whole, found.parts, found.state.x)
    exact = raw_residual(whole, extended)
    relative = everything.frequency_std[rows] / everything.frequencies[rows]
    spread = after.jacobian[rows]
    own = np.einsum("ik,kl,il->i", spread, found.covariance, spread) if spread.shape[1] else 0.0
    std = np.sqrt(np.square(relative) * (1.0 + own) + scatter**2)
    return Unseen(before.raw[rows] * relative, exact[rows] * relative, std)


def modified(
    case: Case,
    extended: Model,
    bias: FloatArray,
    scatter: float,
    neighbours: Sequence[Model] = (),
) -> Unseen:
    """Return the errors of the modified structures, all modes in one list.

    Arguments:
        case: with its modifications.
        extended: the model with the causes.
        bias: relative corrections of predicted frequencies for the mesh, by elastic mode.
        scatter: relative standard deviation of a frequency by ordinary tolerances.
        neighbours: the model with the causes off by one deviation in independent directions.
    """
    before, after, std = [], [], []
    for change in case.modifications:
        m = change.measurement
        predicted = np.array(
            [
                [mode.predicted_hz or np.nan for mode in modified_modes(model, change)]
                for model in (case.model, extended, *neighbours)
            ]
        )
        count = len(m)
        correct = np.ones(count)
        correct[: len(bias)] += bias[:count]
        errors = m.frequencies / (predicted * correct) - 1.0
        spread = np.square(predicted[2:] / predicted[1] - 1.0).sum(axis=0)
        deviation = np.sqrt(np.square(_relative_std(m)) + scatter**2 + spread)
        paired = np.isfinite(errors[:2]).all(axis=0) & np.isfinite(deviation)
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


def left_out(
    nominal: Problem,
    problem: Problem,
    found: Fit,
    slopes: FloatArray,
    tolerance: float,
    scatter: float,
) -> Unseen:
    """Return the errors of every used mode, predicted by a fit to the others.

    Arguments:
        nominal: data and modal coordinates of the model as drawn.
        problem: with the textbook effects of the explanation.
        found: its causes.
        slopes: sensitivities of the data to scatter, (n_data, n_scatter).
        tolerance: standard deviation of the scatter.
        scatter: that of a frequency, relative.
    """
    data = problem.data
    numbers = data.measurement.numbers
    nothing = state_at(nominal, (), np.zeros(0))
    mode, _ = data.shape_rows
    before, after, std = [], [], []
    for j, number in enumerate(numbers):
        kept = [other for other in numbers if other != number]
        if not kept:
            break
        rows = np.ones(len(data), dtype=bool)
        rows[: len(numbers) + len(mode)] = np.append(np.arange(len(numbers)), mode) != j
        part = Data(data.measurement.select(kept), data.bias)
        noise = Noise.of(slopes[rows], tolerance)
        again = fit(Problem(problem.model, problem.space, part, noise), found.parts, found.state.x)
        if again is None:
            continue
        point = state_at(problem, found.parts, again.state.x)
        relative = data.measurement.frequency_std[j] / data.measurement.frequencies[j]
        before.append(nothing.raw[j] * relative)
        after.append(point.raw[j] * relative)
        std.append(float(np.hypot(relative, scatter)))
    return Unseen(np.array(before), np.array(after), np.array(std))


def gain_of(before: dict[str, Block], after: dict[str, Block], crossed: Unseen | None) -> Gain:
    """Return medians of absolute frequency errors in percent, before and after."""

    def pair(name: str) -> tuple[float, float] | None:
        if name not in before or name not in after:
            return None
        return _median(before[name].modes), _median(after[name].modes)

    used = pair("used")
    assert used is not None
    cross = None
    if crossed is not None and len(crossed.before):
        cross = tuple(100.0 * float(np.median(np.abs(e))) for e in (crossed.before, crossed.after))
    return Gain(used, pair("higher"), pair("modified"), cross)  # type: ignore[arg-type]


def _median(modes: Sequence[PairedMode]) -> float:
    return 100.0 * float(np.median([frequency_error(mode) for mode in modes]))


_TIED, _PLACES = 0.1, 6


def extended_by(model: Model, explanation: Explanation) -> Model:
    """Return the model with textbook effects and causes in it.

    Examples:
        >>> diagnosis.extended_by(model, examination.best).size == model.size
        True
    """
    base = extended(model, explanation.base.parts, explanation.base.x)
    return extended(base, explanation.parts, explanation.fit.state.x)


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
    nominal, problem = examination.problem, examination.problem_of(explanation)
    near = () if sharply else _neighbours(case.model, explanation)
    return (
        held_out(case, nominal, problem, explanation.fit, model, examination.scatter),
        modified(case, model, nominal.data.bias, examination.scatter, near),
    )


def _neighbours(model: Model, explanation: Explanation) -> list[Model]:
    """Return the model with the causes off by one deviation in independent directions."""
    found = explanation.fit
    size, turn = np.linalg.eigh(found.covariance)
    low, high = bounds_of(found.parts)
    base = extended(model, explanation.base.parts, explanation.base.x)
    steps = [
        np.clip(found.state.x + np.sqrt(s) * t, low, high)
        for s, t in zip(size, turn.T, strict=True)
    ]
    return [extended(base, found.parts, x) for x in steps]


def stands(
    case: Case,
    examination: Examination,
    explanation: Explanation,
    model: Model,
    unseen: Sequence[Unseen],
) -> bool:
    """Tell whether unseen data bear an explanation out.

    Arguments:
        case: what holds them.
        examination: what the explanation was weighed in.
        explanation: base and causes.
        model: with the explanation in it.
        unseen: its errors.
    """
    count = len(explanation.parts)
    if all(part.confirms(count) for part in unseen):
        return True
    if not count or not case.modifications:
        return False
    unseen = unseen_of(case, examination, explanation, model, sharply=False)
    return all(part.confirms(count) for part in unseen)


def another_stands(case: Case, examination: Examination) -> bool:
    """Tell whether unseen data bear out what the used data cannot tell from the best guess.

    That is another name of the group, or the same name at a place about as likely.
    """
    posterior = examination.posterior
    if not any(posterior.names) or not (case.held_out or case.modifications):
        return False
    group = inseparable(posterior)[0]
    others = [posterior.best(key) for key in group[1:]]
    others += _other_places(posterior, group[0])
    for other in others:
        model = extended_by(case.model, other)
        if stands(case, examination, other, model, unseen_of(case, examination, other, model)):
            return True
    return False


def _other_places(posterior: Posterior, key: Key) -> list[Explanation]:
    """Return the explanations of a name at other places that are not much less likely."""
    (_, most), *rest = posterior.members(key)
    return [e for e, p in rest if p >= _TIED * most][:_PLACES]
