"""The naming itself: from a model and the used modes to weighed explanations; nothing held out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import log

import numpy as np
from threadpoolctl import threadpool_limits

from femubench.core.case.case import BEAM_SHARE
from femubench.core.change.hypothesis import (
    Hypothesis,
    by_themselves,
    holding_to_ground,
    hypotheses_of,
)
from femubench.core.errors import FemubenchError, NotApplicable
from femubench.core.fem.model import Model
from femubench.core.fit.extended_model import extend_model
from femubench.core.fit.mesh_error import mesh_bias
from femubench.core.fit.modal_fit import Fit, Problem, State, fit, log_evidence, state_at
from femubench.core.fit.noise import Noise
from femubench.core.fit.residuals import Data
from femubench.core.inference.coordinates import modes_for, place_data
from femubench.core.inference.effort import Effort
from femubench.core.inference.model_error import (
    Fitted,
    Inadequacy,
    class_widths,
    condition_noise,
    error_slopes,
    general_slopes,
    scatter_slopes,
)
from femubench.core.inference.posterior import Explanation, Posterior, by_weight
from femubench.core.inference.search import Found, Search, adequacy
from femubench.core.inference.settings import settings
from femubench.core.modal.eigen import Modes, zero_tolerance
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Effect
from femubench.core.schema.diagnosis import LeftOut
from femubench.core.typing import FloatArray


@dataclass(frozen=True)
class Examination:
    """What the used modes say of a model.

    Arguments:
        model: the nominal model.
        problem: the data in its modal coordinates.
        slopes: sensitivities of the frequencies to the scatter of elements, (m, n_scatter).
        tolerance: standard deviation of that scatter.
        posterior: all explanations.
        found: the atlas of every textbook set that was searched.
        modes: of the model, in the coordinates of the problem.
        error: what a beam model gets wrong, where that was asked.
        reference: as in `examine`.
        antiresonances: how many were weighed next to the modes.
    """

    model: Model
    problem: Problem = field(repr=False)
    slopes: FloatArray = field(repr=False)
    tolerance: float
    posterior: Posterior
    found: tuple[Found, ...] = field(repr=False)
    modes: Modes
    error: Inadequacy | None = field(default=None, repr=False)
    reference: Measurement | None = None
    antiresonances: int = 0

    @cached_property
    def nominal(self) -> State:
        """Return the model as drawn."""
        return state_at(self.problem, (), np.zeros(0))

    @property
    def best(self) -> Explanation:
        """Return the best explanation: nothing where that is as likely as not, else a name's."""
        names = self.posterior.names
        if names.get((), 0.0) >= settings.nothing_missing:
            return self.posterior.best(())
        return self.posterior.best(next(key for key in names if key))

    @cached_property
    def adequacy(self) -> float:
        """Return the probability of what the best explanation leaves, were it noise."""
        best = self.best.fit.state
        return adequacy(best, len(best.x))

    @property
    def scatter(self) -> float:
        """Return the relative standard deviation of a frequency by ordinary scatter."""
        if self.slopes.shape[1] == 0 or self.tolerance == 0.0:
            return 0.0
        m = self.problem.data.measurement
        size = np.linalg.norm(self.slopes, axis=1)
        return float(self.tolerance * np.median(size * m.frequency_std / m.frequencies))

    @property
    def like_a_beam(self) -> float:
        """Return the probability that the structure is a beam model but for ordinary scatter."""
        pairs = zip(self.posterior.explanations, self.posterior.probabilities, strict=True)
        return sum(p for e, p in pairs if e.fit.state.problem.noise.beam)

    def own_share(self, state: State) -> float:
        """Return which share of what an explanation changes is its own error."""
        scales = state.problem.noise.scales
        return 0.0 if self.error is None or scales is None else self.error.own_share(scales)

    def unexplained_share(self, state: State) -> float:
        """Return which share of what differs an explanation leaves to its own error.

        Either that of what it changes, or of a model error that the two states do not share.
        """
        scales = state.problem.noise.scales
        if self.error is None or scales is None:
            return 0.0
        return max(self.own_share(state), self.error.unshared_share(scales))

    def own_error(self, state: State, *, rigid: bool = False) -> float:
        """Return by which share the size of a cause is in error, or of a spring drawn as rigid.

        That a cause fits every datum well does not tell: all data may be moved by one factor.
        """
        own = self.own_share(state)
        return max(own, settings.own_error_of_size[rigid]) if own > 0.0 else 0.0

    def foreseen(
        self, explained: Iterable[tuple[State, FloatArray]], data: Data
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Return mean and deviation of what the model error makes of unseen frequencies.

        One pair an explanation, in standard deviations of their measurement; nothing where it
        takes the structure for a beam model. With a reference nothing is unseen but the modes of
        modified structures.

        Arguments:
            explained: explanations, and the residuals of used and unseen modes under each, (n,).
            data: used modes, then unseen ones.
        """
        used, count = len(self.problem.data.measurement), len(data.measurement)
        assert self.error is not None
        mode, _ = data.shape_rows
        # Shapes of unseen modes are not asked for, and would say what is sought.
        kept = np.flatnonzero(
            np.concatenate([np.ones(count), mode < used, np.ones(1)])[: len(data)]
        )
        everything = error_slopes(replace(self.problem, data=data), self.modes)
        unseen = np.arange(used, count)
        found = []
        for state, raw in explained:
            scales, own = state.problem.noise.scales, everything
            if scales is not None and _moves_error(state):
                whole = replace(state.problem, data=data, offset=0.0)
                own = everything | slopes_with(state_at(whole, state.parts, state.x))
            slopes = {name: rows[kept] for name, rows in own.items()}
            found.append(
                (np.zeros(len(unseen)), np.zeros(len(unseen)))
                if scales is None
                else self.error.foreseen(scales, slopes, raw[kept], unseen)
            )
        return found

    def problem_of(self, explanation: Explanation) -> Problem:
        """Return the data in the coordinates of an explanation's textbook effects."""
        return replace(explanation.fit.state.problem, offset=0.0)


@dataclass(frozen=True)
class Terms:
    """On what terms explanations are weighed, whatever model and data are examined.

    Arguments:
        effects, tolerance, pairs, reference, width, beam, effort: as in `examine`.
    """

    effects: tuple[Effect, ...]
    tolerance: float
    pairs: bool = True
    reference: Measurement | None = None
    width: float = 0.0
    beam: float = BEAM_SHARE
    effort: Effort = field(default_factory=Effort)

    def single(self) -> Terms:
        """Return the same without a search for several causes."""
        return replace(self, pairs=False)

    def examine(self, model: Model, measurement: Measurement) -> Examination:
        """Weigh every explanation of what a model gets wrong; see `examine`."""
        return examine(
            *(model, measurement, self.effects),
            tolerance=self.tolerance,
            pairs=self.pairs,
            reference=self.reference,
            width=self.width,
            beam=self.beam,
            effort=self.effort,
        )


def examine(
    model: Model,
    measurement: Measurement,
    effects: Iterable[Effect],
    *,
    tolerance: float,
    pairs: bool = True,
    reference: Measurement | None = None,
    width: float = 0.0,
    beam: float = BEAM_SHARE,
    effort: Effort | None = None,
) -> Examination:
    """Weigh every explanation of what a model gets wrong.

    Arguments:
        model: the nominal model.
        measurement: the used modes and nothing else.
        effects: what may be missing.
        tolerance: standard deviation of the relative scatter of every element.
        pairs: whether more than one cause is sought.
        reference: modes of the structure as it was, without the causes that are sought.
        width: factor on the widths of the model error; 0 takes the structure for a beam model.
        beam: prior probability that it is one, but for the scatter of its elements.
        effort: counts the pieces; the search for several causes ends with its time.

    Raises:
        NotApplicable: when a used frequency has no standard deviation.
        ModelError: when the model has no modes.
    """
    effort = effort or Effort()
    # Thousands of small matrices: threads would wait for each other most of the time.
    with threadpool_limits(1):
        effects = tuple(effects)
        hypotheses, known = _candidates(model, effects, reference)
        problem, slopes = pose_problem(model, measurement, hypotheses, tolerance)
        before = None if reference is None else before_of(problem, reference)
        explanations: list[Explanation] = []
        error = None
        if width > 0.0:
            error = model_error_of(problem, before, width, log(1.0 - beam))
            with effort.scope():
                explanations = search_explanations(problem, error, known, pairs, effort)
        own = replace(problem, noise=beam_noise(slopes, before, tolerance, log(beam)))
        slopes = slopes[: len(measurement)].copy()  # those of shapes fill the memory
        floor = max((e.log_weight for e in explanations), default=-np.inf) - settings.lag
        more, atlas = Search(own, known, pairs=pairs, floor=floor, effort=effort).run()
    posterior = Posterior.of([*explanations, *more])
    return Examination(
        *(model, own, slopes, tolerance, posterior, tuple(atlas), modes_for(model)),
        error,
        reference,
    )


def _candidates(
    model: Model, effects: tuple[Effect, ...], reference: Measurement | None
) -> tuple[tuple[Hypothesis, ...], tuple[Effect, ...]]:
    """Return the hypotheses that are screened, and the effects that may come in."""
    damage = damage_of(model, reference)
    if reference is None:
        effects = tuple(e for e in effects if not getattr(e, "acquired", False))
        return hypotheses_of(model, by_themselves(effects), damage), effects
    alone = by_themselves(effects)
    offered = hypotheses_of(model, alone, damage)
    innate = {id(h.effect) for h in offered if is_innate(h)}
    kept = tuple(e for e in effects if id(e) not in innate)
    return tuple(h for h in offered if id(h.effect) not in innate), kept


def damage_of(model: Model, reference: Measurement | None) -> float:
    """Return how far damage goes, as ln of a factor; 0 where a cause may be mere tolerance.

    That of groups is a class of the model error.
    """
    grouped = model.structure is None and bool(model.groups)
    return settings.damage_of_part if grouped or reference is not None else 0.0


def list_left_out(
    model: Model, effects: Iterable[Effect], reference: Measurement | None
) -> tuple[LeftOut, ...]:
    """Return the effects that are no candidates, with their places and the reason."""
    offered = model, by_themselves(effects), damage_of(model, reference)
    free = Counter(h.effect.name for h in holding_to_ground(*offered))
    innate: Counter[str] = Counter()
    if reference is not None:
        innate.update(h.effect.name for h in hypotheses_of(*offered) if is_innate(h))
    reasons = ((free, "the structure hangs free"), (innate, "the reference has them too"))
    return tuple(LeftOut(*item, why) for count, why in reasons for item in count.items())


def is_innate(hypothesis: Hypothesis) -> bool:
    """Tell whether an effect is there from the first day, and so in a reference too."""
    return bool(getattr(hypothesis.effect, "innate", hypothesis.textbook is not None))


def before_of(problem: Problem, reference: Measurement) -> State:
    """Return the nominal model compared with the reference.

    Raises:
        NotApplicable: when its sensors are others, or a frequency has no deviation.
    """
    if reference.sensors.labels != problem.data.measurement.sensors.labels:
        raise NotApplicable("the reference was measured with other sensors")
    data = Data(reference, problem.data.bias, problem.data.still)
    return state_at(replace(problem, data=data, noise=Noise(np.eye(len(data)))), (), np.zeros(0))


def search_explanations(
    problem: Problem, error: Inadequacy, effects: Sequence[Effect], pairs: bool, effort: Effort
) -> list[Explanation]:
    """Return explanations under a model error, each with scales of its own where it matters.

    Scales that leave room for no cause hide it, those of a good explanation do not: what leads is
    sought with its own.
    """
    nothing = state_at(problem, (), np.zeros(0))

    def sought(scales: Fitted, pairs: bool) -> list[Explanation]:
        own = replace(problem, noise=error.noise(scales))
        return Search(own, effects, pairs=pairs, effort=effort).run()[0]

    scales = error.fit(nothing)
    explanations: list[Explanation] = []
    effort.expect_alike(settings.scale_rounds, pairs)
    if len(error.residual) or problem.model.structure is None:
        # Scales that do without a cause see none: those of the structure as it was do, and those
        # before any data. Frames without a reference lack more than any one cause.
        earlier = error.before()
        single = by_weight(e for e in sought(earlier, False) if e.parts)[: settings.partners]
        explanations += [with_scales(error, e, scales, nothing) for e in single]
    for left in reversed(range(settings.scale_rounds)):
        if left < settings.scale_rounds - 1 and effort.stops():
            break
        effort.expect_alike(left, pairs)
        explanations += sought(scales, pairs)
        best = by_weight(explanations)[0].fit.state
        before, scales = scales, error.fit(best, scales)
        gain = error.log_density(best, scales.v) - error.log_density(best, before.v)
        if gain < settings.worth_scales:
            break
    ranked = list({_causes(e): e for e in reversed(by_weight(explanations))}.values())[::-1]
    close = [i for i, e in enumerate(ranked) if e.log_weight > ranked[0].log_weight - settings.near]
    # One cause and its own error may do what otherwise takes a second one.
    few = [i for i, e in enumerate(ranked) if len(e.parts) < 2]
    near = sorted({*close[: settings.leading], *few[: settings.leading]})
    settled = settle(error, (ranked[i] for i in near), scales, nothing)
    return [*settled, *(e for i, e in enumerate(ranked) if i not in near)]


def _causes(explanation: Explanation) -> tuple[object, ...]:
    """Return what is the same of explanations that differ in their scales alone."""
    return (explanation.base.names, *sorted(p.hypothesis.cause for p in explanation.parts))


def with_scales(
    error: Inadequacy, explanation: Explanation, near: Fitted, nothing: State
) -> Explanation:
    """Return an explanation with the scales of model error that suit it best."""
    state = explanation.fit.state
    if state.parts:
        if len(error.residual) or _moves_error(state):
            error = error.moved(slopes_with(state))
        error = error.add_own_error(nothing, state)
    problem = replace(state.problem, noise=error.noise(error.fit(state, near)))
    found: Fit | None
    if state.parts:
        found = fit(problem, state.parts, state.x, steps=settings.few_steps)
    else:
        # A textbook set without causes is a state of its own, which no fit of nothing leads to.
        there = replace(state, problem=problem)
        found = Fit(there, log_evidence(there))
    return explanation if found is None else replace(explanation, fit=found)


def settle(
    error: Inadequacy, explanations: Iterable[Explanation], scales: Fitted, nothing: State
) -> list[Explanation]:
    """Return explanations with scales of their own, the likeliest where their causes settle.

    Where the model error is that of the model with the causes in it, other scales move these: what
    leads where they no longer are may be far behind where they go.
    """
    found = [(e, with_scales(error, e, scales, nothing)) for e in explanations]
    for _ in range(settings.few_steps - 1):
        for i, (before, e) in enumerate(found):
            moved = np.abs(e.fit.state.x - before.fit.state.x).max(initial=0.0)
            least = max(other.log_weight for _, other in found) - settings.near
            moves = len(error.residual) or _moves_error(e.fit.state)
            if moves and moved > settings.coordinate_margin and e.log_weight > least:
                found[i] = e, with_scales(error, e, scales, nothing)
    return [e for _, e in found]


def _moves_error(state: State) -> bool:
    """Tell whether what matrices get wrong is that of the model with the causes in it.

    A joint may be a thousand times softer than drawn, and the modes are then others.
    """
    known = (q for part in state.parts for q in part.hypothesis.parameters)
    loose = any(q.scaling == "factor" and q.scale > 1.0 for q in known)
    return loose and state.problem.model.structure is None


def slopes_with(state: State) -> dict[str, FloatArray]:
    """Return what `error_slopes` does of the model with the causes of a state in it.

    The same perturbations change what a cause does, which is no error that two states do not share.
    Nothing where the causes make no model.
    """
    problem = state.problem
    with suppress(FemubenchError):
        model = extend_model(problem.model, state.parts, state.x)
        own = place_data(model, problem.data, problem.noise, ())
        return {**error_slopes(own, modes_for(model)), "general": general_slopes(state)}
    return {}


def model_error_of(
    problem: Problem, before: State | None, width: float, log_prior: float
) -> Inadequacy:
    """Return the model error of a problem, and of a reference where there is one."""
    modes = modes_for(problem.model)
    present = error_slopes(problem, modes)
    reference = None if before is None else error_slopes(before.problem, modes)
    residual = np.zeros(0) if before is None else before.raw
    widths = {name: width * value for name, value in class_widths().items()}
    unshared = settings.width_between_states
    return Inadequacy.of(present, reference, residual, widths, unshared, log_prior)


def beam_noise(slopes: FloatArray, before: State | None, tolerance: float, weight: float) -> Noise:
    """Return the noise of a structure that is a beam model but for the scatter of its elements.

    Arguments:
        slopes: sensitivities of the data to the scatter, (n_data, n_scatter).
        before: the nominal model compared with the reference, if any.
        tolerance: standard deviation of the scatter.
        weight: ln of the probability.
    """
    rows, known = slopes, np.zeros(0)
    if before is not None:
        earlier = scatter_slopes(before.problem, modes_for(before.problem.model))
        earlier = earlier[:, : slopes.shape[1]]
        rows, known = np.vstack([earlier, slopes]), before.raw
    covariance = np.eye(len(rows)) + tolerance**2 * (rows @ rows.T)
    return condition_noise(covariance, known, weight, beam=True)


def pose_problem(
    model: Model, measurement: Measurement, hypotheses: Iterable[Hypothesis], tolerance: float
) -> tuple[Problem, FloatArray]:
    """Return data, noise and modal coordinates, and the sensitivities behind the noise."""
    if len(measurement) == 0:
        raise NotApplicable("there is no used mode")
    modes = modes_for(model)
    bias = mesh_bias(model, 2 * len(measurement) + settings.spare_modes)
    still = modes.rigid | (modes.eigenvalues <= zero_tolerance(modes))
    data = Data(measurement, np.zeros(0) if bias is None else bias, int(still.sum()))
    plain = place_data(model, data, Noise(np.eye(len(data))), tuple(hypotheses))
    slopes = scatter_slopes(plain, modes) if tolerance else np.zeros((len(data), 0))
    return replace(plain, noise=Noise.of(slopes, tolerance)), slopes
