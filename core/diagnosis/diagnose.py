"""Diagnose a case: name what the model gets wrong, extend it, measure the gain on unseen data."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.advise.advice import advise
from femubench.core.case.case import Case
from femubench.core.diagnosis.faults import fault_causes, mended_case, with_faults
from femubench.core.diagnosis.proof import (
    Unseen,
    another_stands,
    extended_by,
    gain_of,
    left_out,
    stands,
    unseen_of,
)
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.diagnosis.tables import (
    causes_in,
    evidence_rows,
    residual_rows,
    rivals_of,
    smallest_visible,
)
from femubench.core.diagnosis.verdict import Decision, causes_of, decide
from femubench.core.diagnosis.words import sentence_of
from femubench.core.fem.model import Model
from femubench.core.inference.examine import Examination, examine
from femubench.core.inference.extended_model import departure
from femubench.core.inference.fault_search import Depth, inquire
from femubench.core.inference.posterior import Explanation, Posterior
from femubench.core.inference.static_response import LargeProblem
from femubench.core.look.localisation import locate
from femubench.core.look.look import look
from femubench.core.modal.measurement import Measurement
from femubench.core.plugin.loader import registered_effects, registered_faults
from femubench.core.roles import Effect, Fault
from femubench.core.schema.diagnosis import Advice, Cause, Gain, LookWarning
from femubench.core.score.scoring import score_model
from femubench.core.ties import alike, in_order


@dataclass(frozen=True)
class _Proof:
    """Data that did not name the cause."""

    unseen: tuple[Unseen, ...]
    gain: Gain
    crossed: bool


def diagnose(
    case: Case,
    effects: Iterable[Effect] | None = None,
    *,
    faults: Iterable[Fault] | None = None,
    pairs: bool = True,
    tolerance: float | None = None,
) -> Diagnosis:
    """Return what is missing in a case's model, where, how sure, and what it gains.

    Held-out modes and modified structures never enter the naming; they confirm it or not.

    Arguments:
        case: with at least one used mode.
        effects: what may be missing; all registered effects by default.
        faults: what may be wrong with data or input; all registered faults by default.
        pairs: whether more than one cause is sought.
        tolerance: standard deviation of every element's relative scatter; the case's by default.

    Raises:
        NotApplicable: when a used frequency has no standard deviation.
        ModelError: when the model has no modes.
    """
    begin = time.perf_counter()
    used = case.measurement.select(case.used)
    scatter = case.tolerance if tolerance is None else tolerance
    registered = registered_effects()
    known = registered if effects is None else tuple(effects)
    wrong = registered_faults() if faults is None else tuple(faults)

    def search(model: Model, measurement: Measurement, depth: Depth) -> Examination:
        tried, several = () if depth == "nothing" else known, pairs and depth == "several"
        return examine(model, measurement, tried, tolerance=scatter, pairs=several)

    inquiry = inquire(case.model, used, wrong, search)
    examination, given = inquiry.examination, case
    case = mended_case(case, inquiry.mended)
    best = examination.best
    model = extended_by(case.model, best)
    proof = _proof(case, examination, best, model, given)
    if proof.crossed:
        confirmed = all(part.confirms(len(best.parts)) for part in proof.unseen)
    else:
        confirmed = stands(case, examination, best, model, proof.unseen)
        confirmed = confirmed or another_stands(case, examination)
    decision = decide(examination.posterior, examination.adequacy, confirmed=confirmed)
    # The look is no part of the search: whatever is sought, every effect may have its say.
    all_known = {effect.name: effect for effect in (*registered, *known)}
    looks = look(given.model, used, effects=all_known.values())
    told = fault_causes(inquiry.mended)
    return _written(case, examination, decision, model, proof, looks, told, begin)


def _proof(
    case: Case, examination: Examination, best: Explanation, model: Model, given: Case
) -> _Proof:
    unseen = unseen_of(case, examination, best, model)
    crossed = None
    if not any(len(part.before) for part in unseen):
        nominal, slopes = examination.problem, examination.slopes
        problem = examination.problem_of(best)
        crossed = left_out(
            nominal, problem, best.fit, slopes, examination.tolerance, examination.scatter
        )
    gain = gain_of(score_model(given, given.model), score_model(case, model), crossed)
    return _Proof(unseen if crossed is None else (crossed,), gain, crossed is not None)


def _written(
    case: Case,
    examination: Examination,
    decision: Decision,
    model: Model,
    proof: _Proof,
    looks: tuple[LookWarning, ...],
    faults: Sequence[Cause],
    begin: float,
) -> Diagnosis:
    best, posterior = examination.best, examination.posterior
    group = causes_of(posterior, decision.group)
    shown = group if decision.verdict == "ambiguous" else group[:1]
    options = [causes_in(explanation, share, posterior.earned) for explanation, share in shown]
    causes = _group_causes(posterior, options)
    top = posterior.names[decision.group[0]] if decision.group else decision.nothing
    named = bool(decision.group)
    after = best.fit.state if named else examination.nominal
    used = case.measurement.select(case.used)
    return Diagnosis(
        case=case.name,
        verdict="named" if faults and decision.verdict == "none" else decision.verdict,
        sentence=with_faults(sentence_of(decision, causes, options, top, proof.gain), faults),
        causes=(*faults, *causes),
        rivals=rivals_of(examination, best if named else None),
        reason=_reason(decision),
        advice=_advice(examination, [e for e, _ in group]),
        smallest_visible=smallest_visible(examination.found[0]),
        residuals=residual_rows(examination.nominal, after),
        gain=proof.gain,
        chi2=(examination.nominal.chi2, after.chi2),
        data_count=len(examination.problem.data),
        adequacy_p=examination.adequacy,
        nothing=decision.nothing,
        looks=looks,
        locations=(*evidence_rows(examination), *locate(case.model, used)),
        base=best.base.names if named else (),
        extended=model if named else case.model,
        notes=_notes(examination, proof, best, [e for e, _ in shown]),
        seconds=time.perf_counter() - begin,
        subject=case,
    )


def _group_causes(posterior: Posterior, options: Iterable[Iterable[Cause]]) -> list[Cause]:
    """Return every effect of a group once, with the probability that it is part of the name.

    Arguments:
        posterior: what the group was weighed in.
        options: causes of every explanation with the probability of their places, most probable
            explanation first.
    """
    found: dict[str, Cause] = {}
    for cause in (cause for option in options for cause in option):
        likely = cause.probability * posterior.inclusion(cause.effect)
        found.setdefault(cause.effect, replace(cause, probability=likely))
    return in_order(found.values(), lambda cause: 1.0 - cause.probability, 1e-9)


def _reason(decision: Decision) -> str:
    if len(decision.group) < 2:
        return ""
    parts = [
        f"{' + '.join(key)} ({angle:.1f} degrees)"
        for key, angle in zip(decision.group[1:], decision.angles[1:], strict=True)
        if np.isfinite(angle)
    ]
    if not parts:
        return "the data are explained about as well by either"
    first = " + ".join(decision.group[0])
    return f"angle of the sensitivities to those of {first}: {', '.join(parts)}"


def _advice(examination: Examination, group: Sequence[Explanation]) -> tuple[Advice, ...]:
    if len(group) < 2:
        return ()
    problems = [examination.problem_of(e) for e in group]
    fits = [e.fit for e in group]
    return advise(examination.model, problems, fits, tolerance=examination.tolerance)


def _notes(
    examination: Examination, proof: _Proof, best: Explanation, shown: Sequence[Explanation]
) -> tuple[str, ...]:
    notes = []
    if proof.crossed:
        notes.append(
            "The case holds nothing back: the gain is that on used modes left out in turn."
        )
    elif best.parts and not any(part.visible for part in proof.unseen):
        notes.append("The unseen data hardly change with the cause, so they cannot confirm it.")
    unearned = [name for name in best.base.names if name not in examination.posterior.earned]
    if unearned:
        notes.append(
            f"The extended model takes {' and '.join(unearned)} at the textbook value too: "
            "these data neither ask for it nor speak against it."
        )
    for e in shown:
        if tied := tied_places(examination.posterior, e):
            name = " + ".join(e.searched)
            notes.append(f"{name} at {e.place} fits exactly as well at {' or at '.join(tied)}.")
    cautions = (getattr(part.hypothesis.effect, "caution", "") for part in best.parts)
    notes += dict.fromkeys(caution for caution in cautions if caution)
    if isinstance(examination.problem, LargeProblem) and best.parts:
        notes.append(
            "The causes were sought in modal coordinates: the extended model, solved anew, is "
            f"{departure(best.fit):.1g} standard deviations of all data together from the fit."
        )
    return tuple(notes)


def tied_places(posterior: Posterior, best: Explanation) -> tuple[str, ...]:
    """Return the other places at which the causes of an explanation are exactly as probable."""
    tied = (
        e.place
        for e in posterior.explanations
        if (e.base.names, e.searched) == (best.base.names, best.searched)
        and alike(e.log_weight, best.log_weight)
    )
    return tuple(dict.fromkeys(place for place in tied if place != best.place))


__all__ = ["diagnose", "extended_by"]
