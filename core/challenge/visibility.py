"""How visible a hidden cause is: by how much its best fit lowers chi-square on the used data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from femubench.core.case.case import Case
from femubench.core.challenge.truth import HiddenCause, Truth
from femubench.core.change.hypothesis import hypotheses_of
from femubench.core.effect.frame_effect import FrameEffect
from femubench.core.errors import ModelError
from femubench.core.fem.model import Model
from femubench.core.fit.extended_model import check_joint_fit
from femubench.core.fit.modal_fit import Problem, fit
from femubench.core.fit.projection import Projection
from femubench.core.inference.examine import pose_problem
from femubench.core.inference.search import Search
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Effect


def delta_chi2(case: Case, truth: Truth, effects: Mapping[str, FrameEffect]) -> tuple[float, ...]:
    """Return by how much each true cause lowers chi-square when the others are known.

    The causes are fitted to the used data where they truly sit, in the metric of the diagnosis:
    the scatter of the elements is part of the noise. For a cause outside the catalogue, return
    what the best single effect leaves unexplained of ideal data.

    Arguments:
        case: nominal model and measurement.
        truth: what is hidden in it.
        effects: the catalogue by name.
    """
    if truth.outside:
        return (truth.excess,)
    present = [effects[cause.effect] for cause in truth.causes]
    known = hypotheses_of(case.model, dict.fromkeys(present))
    wanted = {(cause.effect, cause.place) for cause in truth.causes}
    true = [h for h in known if (h.effect.name, h.place) in wanted]
    problem, _ = pose_problem(case.model, case.used_measurement(), true, case.tolerance)
    whole = _chi2(problem, truth.causes)
    return tuple(
        _chi2(problem, [other for other in truth.causes if other is not cause]) - whole
        for cause in truth.causes
    )


def find_unexplained(
    model: Model, ideal: Measurement, effects: Iterable[Effect], tolerance: float
) -> float:
    """Return the chi-square that the best single effect of a catalogue leaves of ideal data.

    A cause outside the catalogue that one inside imitates as well as the data can tell is no
    cause of its own to them.
    """
    known = tuple(effects)
    problem, _ = pose_problem(model, ideal, hypotheses_of(model, known), tolerance)
    explanations, _ = Search(problem, known, pairs=False).run()
    return min(explanation.chi2 for explanation in explanations)


def _chi2(problem: Problem, causes: Sequence[HiddenCause]) -> float:
    """Return chi-square with some causes fitted, from their true sizes on."""
    parts: list[Projection] = []
    start: list[float] = []
    for cause in causes:
        label = (cause.effect, cause.place)
        part = next(
            p
            for p in problem.space.projections
            if (p.hypothesis.effect.name, p.hypothesis.place) == label
        )
        parts.append(part)
        known = zip(part.hypothesis.parameters, cause.values, strict=True)
        start += [parameter.coordinate(value) for parameter, value in known]
    found = fit(problem, parts, np.array(start))
    if found is None:
        raise ModelError("the hidden causes make the mass indefinite")
    borne = check_joint_fit(found) if len(parts) > 1 else found
    return (found if borne is None else borne).state.chi2
