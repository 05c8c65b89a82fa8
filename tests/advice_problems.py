"""Explanations of frequencies alone, fitted to what another model gives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from diagnosis_problems import FREQUENCY_STD as STD, measured, part_at, problem_of

from femubench import Model
from femubench.core.advise.advice import Group, advise, options_for
from femubench.core.advise.point_attachments import points_of
from femubench.core.advise.prediction import Outlook, Points, outlook_of
from femubench.core.fit.modal_fit import Fit, Problem, fit
from femubench.core.roles import Effect
from femubench.core.schema.diagnosis import Advice


def posed(model: Model, truth: Model, effects: Sequence[Effect], count: int = 6) -> Problem:
    """Return a problem with exact frequencies of another model and nothing else."""
    test = measured(truth, truth.frame_structure.frame, count=count, shapes=0, weighed=False)
    return problem_of(model, test, effects)


def fitted(problem: Problem, effect: Effect, place: str, start: float = 0.1) -> Fit:
    part = part_at(problem, effect.name, place)
    result = fit(problem, (part,), np.full(len(part.hypothesis.parameters), start))
    assert result is not None
    return result


def advised(model: Model, problem: Problem, fits: Sequence[Fit]) -> tuple[Advice, ...]:
    return advise(model, [problem] * len(fits), fits, tolerance=0.0)


def one_outlook(problem: Problem, found: Fit) -> tuple[Outlook, Points]:
    points = points_of(problem.model)
    return outlook_of(problem, found, points), points


def every_option(model: Model, problem: Problem, fits: Sequence[Fit]) -> dict[str, float]:
    points = points_of(model)
    views = tuple(outlook_of(problem, found, points) for found in fits)
    group = Group(views, points, 1.2, STD, 0.0, 28)
    return {option.text: min(option.distances) for option in options_for(group)}
