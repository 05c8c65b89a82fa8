"""What data could name at best: the class of a truth, were the physics of the model perfect.

The model is the healthy structure and the model with the true cause the present one; a test without
noise reads both where the sensors sit, in the modes that were measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from true_fit import CataloguedCause, true_fit

from femubench.core.case.case import Case
from femubench.core.challenge.outcome import Same, outcome, same_place
from femubench.core.challenge.score import LARGEST_GROUP, Parts
from femubench.core.challenge.truth_file import KnownCase
from femubench.core.diagnosis.proof import extend_by
from femubench.core.diagnosis.verdict import Sufficiency, decide, elsewhere
from femubench.core.errors import FemubenchError
from femubench.core.fem.model import Model
from femubench.core.fit.extended_model import raw_residual
from femubench.core.fit.mesh_error import mesh_bias
from femubench.core.fit.modal_fit import Problem, signed_hz
from femubench.core.inference.examine import Terms, pose_problem
from femubench.core.inference.posterior import Explanation
from femubench.core.inference.settings import settings
from femubench.core.look.states import compare_states
from femubench.core.modal.eigen import enough_modes, modes_of
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Effect

Cells = dict[str, Any]
CLASSES = ("nameable", "in a group", "not nameable", "invisible", "outside", "sound")
NAMEABLE, GROUPED, MANY, INVISIBLE, OUTSIDE, SOUND = CLASSES
LEAST = 25.0  # chi-square of a change that counts as visible
TIMES = {"class": 1, "twice": 2}  # column -> how many times the measured modes


def ceiling(case: Case, truth: KnownCase, effects: Mapping[str, Effect]) -> Iterator[Cells]:
    """Yield the class of a truth with chi-square and best rival, then that with twice the modes.

    Arguments:
        case: as posed, with the reference.
        truth: of the case.
        effects: the catalogue by name.
    """
    used, structure = case.measurement, case.model.structure
    same = same_place(None if structure is None else structure.frame)
    known = tuple(effects.values())
    on = case.tolerance, True, case.reference, case.error_width, case.beam_share
    changed = None
    if truth.causes and all(cause.findings for cause in truth.causes):
        changed = true_model(case.model, used, truth, effects, Terms(known, *on), same)
    if changed is None:
        yield dict.fromkeys(TIMES, OUTSIDE if truth.causes else SOUND)
        return
    problem, _ = pose_problem(case.model, used, (), 0.0)
    # What the true states do not show, no model can make visible.
    agrees = case.reference is not None and not compare_states(used, case.reference).differs
    for column, times in TIMES.items():
        present = ideal_test(problem, changed, used, times)
        if times == 1 or len(present) > len(used):
            before = ideal_test(problem, case.model, present)
            terms = Terms(known, case.tolerance, reference=before, beam=case.beam_share)
            cells = _classified(problem, present, truth, terms, same)
            if times == 1 and agrees:
                cells["class"] = INVISIBLE
            yield cells if times == 1 else {column: cells["class"]}


def true_model(
    model: Model,
    used: Measurement,
    truth: KnownCase,
    effects: Mapping[str, Effect],
    terms: Terms,
    same: Same,
) -> Model | None:
    """Return the model with the true causes in it; None where no effect describes them.

    Where the truth does not state all sizes, they are fitted to the measurement.

    Arguments:
        model, used, truth, effects, same: of the case; whether two places are one.
        terms: on which its sizes are fitted.
    """
    changed, named = model, {effect for cause in truth.causes for effect, _ in cause.findings}
    try:
        for cause in truth.causes:
            effect, size = effects.get(cause.effect), cause.size
            words = [word for name, word in cause.findings if name == cause.effect]
            places = effect.places(model) if effect is not None and size is not None else ()
            place = next((p for word in words for p in places if same(p, word)), None)
            if effect is None or place is None or len(effect.parameters(model, place)) > 1:
                break
            changed = effect.extend(changed, place, [size])
        else:
            return changed
        chosen = tuple(effect for name, effect in effects.items() if name in named)
        seen = replace(terms, effects=chosen, pairs=False).examine(model, used)
        ways = [[CataloguedCause(*finding) for finding in c.findings] for c in truth.causes]
        found = true_fit(seen, ways, effects, same)
    except (FemubenchError, np.linalg.LinAlgError):  # of a model that the truth cannot stand in
        return None
    return None if found is None else extend_by(model, found)


def ideal_test(problem: Problem, model: Model, like: Measurement, times: int = 1) -> Measurement:
    """Return what a test without noise reads of a model, its modes paired with measured ones.

    Arguments:
        problem: of the nominal model.
        model: which is tested.
        like: the modes, sensors and deviations of the test.
        times: so many times as many, with the next modes of the model, read as the last measured.
    """
    m, first, rigid = len(like), max(like.numbers) + 1, problem.space.zero
    bias = mesh_bias(problem.model, 2 * times * m + settings.spare_modes)
    data = replace(problem.data, measurement=like, bias=np.zeros(0) if bias is None else bias)
    modes = modes_of(model, enough_modes(model, 2 * times * m))
    order = np.argsort(modes.eigenvalues)
    hertz = signed_hz(modes.eigenvalues[order])[None]
    read = np.asarray(model.observe(like.sensors) @ modes.shapes[:, order])[None]
    hertz, read = data.predict(hertz, data.align(hertz, read, rigid), rigid)
    index = data.pair(hertz, read)[0]
    above = np.flatnonzero(hertz[0] > hertz[0, index].max())[: (times - 1) * m]
    index, kept = np.append(index, above), np.append(np.arange(m), np.full(len(above), m - 1))
    shapes, old = read[0][:, index], like.shapes[:, kept]
    # As large as measured, so that the deviations are as much of them.
    norm = np.sqrt(np.square(np.where(np.isfinite(old), shapes, 0.0)).sum(axis=0))
    shapes = shapes * np.sqrt(np.nansum(np.square(old), axis=0)) / np.where(norm > 0.0, norm, 1.0)
    return replace(
        like,
        numbers=(*like.numbers, *range(first, first + len(above))),
        frequencies=hertz[0, index],
        frequency_std=(like.frequency_std / like.frequencies)[kept] * hertz[0, index],
        damping=like.damping[kept],
        shapes=np.where(np.isfinite(old), shapes, np.nan),
        shape_std=like.shape_std[:, kept],
        total_mass=None if like.total_mass is None else (model.total_mass, like.total_mass[1]),
    )


def _classified(
    problem: Problem, present: Measurement, truth: KnownCase, terms: Terms, same: Same
) -> Cells:
    """Return the class by one test, chi-square of its change, and the best rival."""
    assert terms.reference is not None
    data = replace(problem.data, measurement=present)
    change = raw_residual(replace(problem, data=data), problem.model)
    found: Cells = {"class": INVISIBLE, "chi2": float(change @ change)}
    # Close modes that merely turn into each other do not differ.
    if found["chi2"] < LEAST or not compare_states(present, terms.reference).differs:
        return found
    examination = terms.examine(problem.model, present)
    posterior = examination.posterior
    decision = decide(posterior, examination.best, Sufficiency(examination.adequacy), True)

    def is_one_of(parts: Parts, *outcomes: str) -> bool:
        causes = [{"effect": e, "place": p, "probability": 1.0} for e, p in parts]
        answer = {"verdict": "named", "causes": causes}
        return outcome(truth, {"verdict": "named", "answer": answer}, same) in outcomes

    stated = [posterior.best(k) for k in decision.group[: 1 if decision.shared else None]]
    stated += [other for best in stated for other in elsewhere(posterior, best)]
    of = decision.shared or {name for key in decision.group for name in key}
    right = [is_one_of(tuple(p for p in _parts(e) if p[0] in of), "right") for e in stated]
    found |= {"class": MANY, "candidates": len(right)}
    # More names, or places, than a group may have say nothing.
    if decision.verdict in ("named", "ambiguous") and any(right):
        found["class"] = (
            NAMEABLE if all(right) else GROUPED if len(right) <= LARGEST_GROUP else MANY
        )
    others = (_parts(e) for e in posterior.explanations if e.parts)
    rival = next((parts for parts in others if not is_one_of(parts, "right", "with others")), ())
    return {**found, "rival": " + ".join(f"{effect}@{place}" for effect, place in rival)}


def _parts(explanation: Explanation) -> Parts:
    return tuple((p.hypothesis.name, p.hypothesis.place) for p in explanation.parts)
