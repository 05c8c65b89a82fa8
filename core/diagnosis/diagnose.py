"""Diagnose a case: name what the model gets wrong, extend it, measure the gain on unseen data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import chdtrc

from femubench.core.advise.advice import advise
from femubench.core.case.case import Case
from femubench.core.diagnosis.budget import Budget, budget_of_modes
from femubench.core.diagnosis.budget_advice import advise_modes
from femubench.core.diagnosis.faults import correct_case, fault_causes, with_faults
from femubench.core.diagnosis.proof import (
    Unseen,
    change_left,
    extend_by,
    find_held,
    gain_of,
    predict_left_out,
    rms_gain_of,
    unseen_of,
)
from femubench.core.diagnosis.region import Regions
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.diagnosis.scatter import scatter_rows
from femubench.core.diagnosis.tables import (
    error_scales,
    evidence_rows,
    find_tied_places,
    has_causes,
    list_causes,
    notes_left_out,
    odds_rows,
    only_shared,
    residual_rows,
    rivals_of,
    smallest_visible,
)
from femubench.core.diagnosis.verdict import Decision, Sufficiency, decide, elsewhere
from femubench.core.diagnosis.words import percent, sentence_of, words_of_provisional
from femubench.core.fem.coarse_mesh import coarsen_mesh
from femubench.core.fem.model import Model
from femubench.core.inference.effort import Effort, Kind, Number
from femubench.core.inference.examine import Examination, Terms, list_left_out
from femubench.core.inference.fault_search import Inquiry, inquire
from femubench.core.inference.model_error import class_widths
from femubench.core.inference.posterior import Explanation
from femubench.core.inference.response_evidence import weigh_by_antiresonances
from femubench.core.inference.search import adequacy
from femubench.core.inference.settings import format_value, list_changed, settings
from femubench.core.look.localisation import locate
from femubench.core.look.look import look
from femubench.core.look.modes import Seen
from femubench.core.look.readings import look_at_band
from femubench.core.look.states import compare_states
from femubench.core.modal.eigen import DENSE_LIMIT
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.core.pace import LATE
from femubench.core.plugin.loader import list_effects, list_faults
from femubench.core.roles import Effect, Fault
from femubench.core.schema.diagnosis import Advice, Cause, Gain, LookWarning, States
from femubench.core.score.responses import score_responses
from femubench.core.score.scoring import score_model
from femubench.core.ties import in_order

# What a budget of time leaves out.
_LEFT_OUT: dict[Kind, str] = {
    "unseen": "causes, alone or together, may have been overlooked",
    "drawing": "what the drawing lacks was not judged",
    "advice": "not all that could be measured next was weighed",
}


@dataclass(frozen=True)
class _Proof:
    """What data that did not name the cause say of it.

    Arguments:
        leader: the best guess, or what unseen data bear out where they refute that.
        model: the extended model.
        unseen: errors of the unseen data.
        gain, gain_rms: before and after, as medians and as root mean squares.
        crossed: whether used modes were left out in turn, for want of unseen ones.
        test: whether the leader is enough.
    """

    leader: Explanation
    model: Model
    unseen: tuple[Unseen, ...]
    gain: Gain
    gain_rms: Gain
    crossed: bool
    test: Sufficiency


def diagnose(
    case: Case,
    effects: Iterable[Effect] | None = None,
    *,
    faults: Iterable[Fault] | None = None,
    pairs: bool = True,
    effort: Effort | None = None,
) -> Diagnosis:
    """Return what is missing in a case's model, where, how sure, and what it gains.

    Modified structures never enter the naming, nor held-out modes without a reference; they confirm
    it or not. With a reference all measured modes serve the name, and each is left out in turn.

    Arguments:
        case: with at least one used mode.
        effects: what may be missing; all registered effects by default.
        faults: what may be wrong with data or input; all registered faults by default.
        pairs: whether more than one cause is sought.
        effort: counts the fits; what can be left out ends with its time. None: never.

    Raises:
        NotApplicable: when a used frequency has no standard deviation.
        ModelError: when the model has no modes.
    """
    effort = effort or Effort()
    case = _with_few_elements(case)
    if case.reference is not None:
        case = _use_all_modes(case)
    used = case.measurement.select(case.used)
    registered = list_effects()
    known = registered if effects is None else tuple(effects)
    wrong = list_faults() if faults is None else tuple(faults)
    reference, width, beam = case.used_reference, case.error_width, case.beam_share
    terms = Terms(known, case.tolerance, pairs, reference, width, beam, effort)
    with effort.scope(_expected(case)):
        # Faults of data and input first, then the causes that are left without them.
        inquiry = inquire(case.model, used, wrong, terms)
        given = case.used_measurement().responses
        if any(fault.charge.fault.side == "data" for fault in inquiry.repaired):
            given = None  # what is wrong with shapes or frequencies is wrong with them too
        inquiry = replace(inquiry, examination=weigh_by_antiresonances(inquiry.examination, given))
        repaired = correct_case(case, inquiry.repaired)
        states = None
        if repaired.reference is not None:  # what is wrong with the data is no difference
            whole = replace(repaired.measurement, responses=given)
            states = compare_states(whole, repaired.reference)
        proof = _proof(repaired, inquiry.examination, effort, case, states)
        budget = None
        # With a reference both states have what the drawing lacks.
        if states is None and not effort.stops("drawing"):
            with effort.piece("drawing"):
                own = repaired.model, repaired.measurement, repaired.used
                budget = budget_of_modes(*own, registered)
        effort.expect("drawing", 0)
        with effort.piece("advice"):
            looks = _looks(case.model, repaired, (*registered, *known))
            posterior, leader = inquiry.examination.posterior, proof.leader
            differs = None if states is None else states.differs
            decision = decide(posterior, leader, proof.test, differs)
            found = _written(repaired, inquiry, decision, proof, looks, effort)
            if budget is not None:
                found = _with_budget(repaired, found, budget)
    left_out = list_left_out(repaired.model, known, reference)
    notes = (*case.notes, *found.notes, *notes_left_out(left_out), *_conditions(effort))
    return replace(found, states=states, left_out=left_out, notes=notes)


def _with_budget(case: Case, found: Diagnosis, budget: Budget) -> Diagnosis:
    """Return a diagnosis with a budget, and with its model where no name stands alone.

    That model is provisional: unseen data of every kind must be nearer to it than to the drawing
    and to the best guess.
    """
    found = replace(found, budget=budget.lines, budget_modes=budget.modes, drawing=budget)
    found = replace(found, hidden_percent=budget.hidden_percent)
    if found.verdict == "named":
        return found
    modes, names = advise_modes(budget, case), found.advice
    # Where unseen data do not bear the budget out, what parts the names comes first.
    first = replace(found, advice=(*modes, *names)[: settings.advised])
    last = replace(found, advice=(*names, *modes)[: settings.advised])
    found = last if found.verdict == "ambiguous" else first
    before, after = (score_model(case, model) for model in (case.model, budget.extended))
    gain = rms_gain_of(before, after, None)
    kinds = "held_out_percent", "modified_percent"
    pairs = [(getattr(gain, kind), getattr(found.gain_rms, kind)) for kind in kinds]
    unseen = [(*own, *other) for own, other in pairs if own is not None and other is not None]
    # Nearer than the drawing, and than the best guess, which may be all that a beam model lacks.
    if not unseen or any(new >= min(old, *guess) for old, new, *guess in unseen):
        return found
    said = f"{words_of_provisional(gain)} {found.sentence}"
    return replace(first, provisional=gain, sentence=said, extended=budget.extended)


def _expected(case: Case) -> dict[Kind, Number]:
    """Return what mostly follows the search."""
    # The best guess is solved and judged, and where it fails its rivals are.
    judged = 2.0, 2.0 + bool(case.held_out or case.modifications) * settings.largest_group / 2.0
    return {"unseen": judged, "drawing": float(case.reference is None), "advice": 1.0}


def _with_few_elements(case: Case) -> Case:
    """Return a case whose frame is small enough to be solved for all of its modes many times."""
    drawn = case.model
    if drawn.structure is None or drawn.size <= DENSE_LIMIT:
        return case
    model = coarsen_mesh(drawn, DENSE_LIMIT, settings.fewest_elements)
    if model.size > settings.most_dofs:
        model = coarsen_mesh(drawn, settings.most_dofs, 1)
    if model.size == drawn.size:
        return case
    count = len(case.measurement)
    pair = (elastic_modes(m, count).natural_frequencies[:count] for m in (model, drawn))
    most = max(m.elements for m in model.frame_structure.frame.members)
    off = np.abs(np.divide(*pair) - 1.0).max()
    note = (
        f"The frame is diagnosed with {most} elements a member at most, in {model.size} degrees "
        f"of freedom instead of {drawn.size}: `member/k` counts these. Its first {count} "
        f"frequencies are {100.0 * off:.2g} % off those with all elements."
    )
    return replace(case, model=model, notes=(*case.notes, note))


def _use_all_modes(case: Case) -> Case:
    """Return a case that holds nothing back: where a change is sought, every mode shows it."""
    used, reference = case.measurement.numbers, case.reference
    known = () if reference is None else tuple(reference.numbers)
    split = case.split and case.split.whole
    return replace(case, used=tuple(used), held_out=(), reference_used=known, split=split)


def _looks(drawn: Model, case: Case, effects: Iterable[Effect]) -> tuple[LookWarning, ...]:
    """Return what a plain look finds, with every effect, whatever is sought."""
    used = case.measurement.select(case.used)
    found = look(drawn, used, effects={e.name: e for e in effects}.values())
    if case.band is None:
        return found
    # All modes that were found, used or not: what is not among them is not in the structure.
    return (*found, *look_at_band(Seen(case.model, case.measurement), case.band))


def _proof(
    case: Case, examination: Examination, effort: Effort, given: Case, states: States | None
) -> _Proof:
    best, posterior = examination.best, examination.posterior
    with effort.piece("unseen"):
        model = extend_by(case.model, best)
        # This asks for the most modes: all that follows is given those.
        after = score_model(case, model)
        unseen = unseen_of(case, examination, best, model)
    crossed = None
    if any(len(part.before) for part in unseen):
        found = find_held(case, examination, effort, unseen)
        holds = found is not None
        if found is not None and found is not best:
            best, model = found, extend_by(case.model, found)
            after = score_model(case, model)
            unseen = unseen_of(case, examination, best, model)
        tells = any(part.visible for part in unseen)
    else:
        crossed = predict_left_out(posterior, best)
        unseen, holds = (crossed,), crossed.holds
        tells = crossed.visible and len(crossed.before) >= settings.telling_modes
    before = score_model(given, given.model)
    median, rms = (of(before, after, crossed) for of in (gain_of, rms_gain_of))
    if states is not None:
        rms = replace(rms, change_percent=change_left(states, before, after))
    effort.expect("unseen", 0)
    state = best.fit.state
    log_bayes = sum(part.log_bayes for part in unseen)
    left, own = adequacy(state, best.unknowns), examination.unexplained_share(state)
    test = Sufficiency(left, own, log_bayes, holds or not tells, tells)
    return _Proof(best, model, unseen, median, rms, crossed is not None, test)


def _written(
    case: Case,
    inquiry: Inquiry,
    decision: Decision,
    proof: _Proof,
    looks: tuple[LookWarning, ...],
    effort: Effort,
) -> Diagnosis:
    examination = inquiry.examination
    repaired, loose = fault_causes(inquiry.repaired), fault_causes(inquiry.loose)
    best, posterior = proof.leader, examination.posterior
    if decision.shared and not has_causes(examination, best, decision.shared):
        decision = replace(decision, verdict="ambiguous", shared=())
    group = [best, *(posterior.best(key) for key in decision.group[1:])] if decision.group else []
    shown = group if decision.verdict == "ambiguous" else group[:1]
    regions = Regions(examination, shown)
    options = [list_causes(examination, e, regions, decision.held) for e in shown]
    causes = _group_causes(options)
    top = posterior.names[decision.group[0]] if decision.group else decision.nothing
    if decision.shared:
        causes = only_shared(causes, best, decision.shared)
        top = sum(p for key, p in posterior.names.items() if set(decision.shared) <= set(key))
    top *= posterior.known if decision.group else 1.0
    stated = decision, causes, options, top, proof.gain_rms
    # The scatter of elements is no noise of the measurement: by that the model is off.
    hertz = examination.nominal.raw[: len(case.used)]
    agrees = float(chdtrc(len(hertz), hertz @ hertz)) >= settings.noise_p
    agrees &= posterior.best(()).fit.state.problem.noise.beam
    said = sentence_of(*stated, reference=case.reference is not None, agrees=agrees)
    faults = (repaired, loose) if decision.verdict != "unknown" else ([], [])
    named = bool(decision.group)
    nothing = examination.nominal
    # Both in units of one noise: that of an explanation holds what it takes for model error.
    leader = best if named else posterior.best(())
    noise = leader.fit.state.problem.noise
    before = replace(nothing, problem=replace(nothing.problem, noise=noise))
    after = best.fit.state if named else before
    used = case.measurement.select(case.used)
    return Diagnosis(
        case=case.name,
        verdict="named" if (repaired or loose) and decision.verdict == "none" else decision.verdict,
        sentence=with_faults(said, *faults),
        causes=(*repaired, *causes, *loose),
        rivals=rivals_of(examination, best if named else None, group),
        reason=_reason(decision),
        advice=_advice(examination, group, effort),
        smallest_visible=smallest_visible(examination.found[0]),
        residuals=residual_rows(before, after),
        gain=proof.gain,
        gain_rms=proof.gain_rms,
        chi2=(before.chi2, after.chi2),
        scatter=scatter_rows(after),
        data_count=len(examination.problem.data),
        adequacy_p=proof.test.left,
        nothing=decision.nothing,
        looks=looks,
        locations=(*evidence_rows(examination), *locate(case.model, used)),
        base=best.base.names if named else (),
        extended=proof.model if named else case.model,
        notes=(
            *_notes(case, examination, proof, shown),
            *_error_notes(examination, leader),
        ),
        seconds=effort.spent,
        evidence=odds_rows(posterior, best) if named else (),
        model_error=error_scales(examination, leader),
        like_a_beam=examination.like_a_beam,
        subject=case,
        examination=examination,
    )


def _conditions(effort: Effort) -> tuple[str, ...]:
    """Return under what conditions it was found that are not the usual ones."""
    notes = []
    if effort.cut:
        left = ", ".join(what for kind, what in _LEFT_OUT.items() if kind in effort.cut)
        took, asked = effort.spent, effort.budget or 0.0
        # With all left out that may be, no shorter budget is kept either.
        what = "What is always done takes" if "drawing" in effort.cut else "It took"
        least = f" {what} {took:.2g} s here." if took > LATE * asked else ""
        notes.append(
            f"The diagnosis was ended after its budget of {asked:g} s: {left}; a longer --budget "
            f"has it.{least}"
        )
    if changed := list_changed():
        words = ", ".join(f"{name} = {format_value(value)}" for name, value in changed.items())
        notes.append(f"Settings other than the standard ones: {words}.")
    return tuple(notes)


def _group_causes(options: Iterable[Iterable[Cause]]) -> list[Cause]:
    """Return every cause of a group once, as in the most probable explanation that has it.

    Arguments:
        options: causes of every explanation, most probable explanation first.
    """
    found: dict[tuple[str, str], Cause] = {}
    for cause in (cause for option in options for cause in option):
        found.setdefault((cause.effect, cause.place), cause)
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


def _advice(
    examination: Examination, group: Sequence[Explanation], effort: Effort
) -> tuple[Advice, ...]:
    """Return what parts the names of a group, and each name's places, from each other."""
    others = (e for found in group for e in elsewhere(examination.posterior, found))
    stated = [*group, *others][: settings.advised]
    if len(stated) < 2:
        return ()
    given = [examination.problem_of(e) for e in stated], [e.fit for e in stated]
    known, scatter = examination.antiresonances > 0, examination.tolerance
    stops = partial(effort.stops, "advice")
    return advise(examination.model, *given, tolerance=scatter, responses=known, stops=stops)


def _notes(
    case: Case, examination: Examination, proof: _Proof, shown: Sequence[Explanation]
) -> tuple[str, ...]:
    best = proof.leader
    notes: list[str] = []
    if case.band is not None and best.parts:
        warnings = look_at_band(Seen(proof.model, case.measurement), case.band)
        notes += [f"With the causes in it: {warning.what}" for warning in warnings]
    if (count := examination.antiresonances) > 0:
        what = "antiresonance was" if count == 1 else "antiresonances were"
        notes.append(f"{count} {what} weighed next to the modes, by the responses that are given.")
    drawn = score_responses(case, case.model) if best.parts else None
    found = None if drawn is None else score_responses(case, proof.model)
    if drawn is not None and found is not None:
        notes.append(
            f"At held-out lines and sensors responses are off by {drawn.rms_db:.3g} dB as drawn, "
            f"by {found.rms_db:.3g} dB with the causes; noise is {found.floor_db:.2g} dB."
        )
    if proof.crossed:
        notes.append(
            "The case holds nothing back: the gain is that on used modes left out in turn."
        )
    elif best.parts and not proof.test.tells:
        notes.append("The unseen data hardly change with the cause, so they cannot confirm it.")
    if best is not examination.best:
        first = examination.best
        names = " + ".join(examination.posterior.key(first))
        notes.append(
            f"{names} at {first.place} is likelier by the used data, but unseen data refute it."
        )
    known = examination.posterior.known
    if shown and known < settings.nearly_all:
        notes.append(
            "Several effects together may imitate a cause that no effect describes: "
            f"probability {percent(1.0 - known)}."
        )
    unearned = [name for name in best.base.names if name not in examination.posterior.earned]
    if unearned:
        notes.append(
            f"The extended model takes {' and '.join(unearned)} at the textbook value too: "
            "these data neither ask for it nor speak against it."
        )
    for e in shown:
        if tied := find_tied_places(examination.posterior, e):
            name = " + ".join(e.searched)
            notes.append(f"{name} at {e.place} fits exactly as well at {' or at '.join(tied)}.")
    cautions = (getattr(part.hypothesis.effect, "caution", "") for part in best.parts)
    notes += dict.fromkeys(caution for caution in cautions if caution)
    return tuple(notes)


def _error_notes(examination: Examination, leader: Explanation) -> tuple[str, ...]:
    """Return what the drawing itself gets wrong, the largest classes by name."""
    ratios = [row for row in error_scales(examination, leader) if not row.unit]
    if not ratios:
        return ()
    widths = class_widths()
    wide = {row.name: row.scale / widths.get(row.name, np.inf) for row in ratios}
    largest = sorted(ratios, key=lambda row: -wide[row.name])[: settings.of_a_kind]
    stated = ", ".join(f"{row.name} {100.0 * row.scale:.2g} %" for row in largest)
    return (
        f"What the drawing itself gets wrong, above all: {stated} (standard deviations). That the "
        "model is right but for ordinary scatter has probability "
        f"{examination.like_a_beam:.2g}.",
    )
