"""Explanations of frequencies alone, fitted to what another model gives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from femubench import Measurement, Model, Sensors, solve_modes
from femubench.core.advise.advice import Group, advise, options_for
from femubench.core.advise.point_attachments import points_of
from femubench.core.advise.prediction import Outlook, Points, outlook_of
from femubench.core.change.hypothesis import hypotheses_of
from femubench.core.fit.modal_basis import nominal_space
from femubench.core.fit.modal_fit import Fit, Problem, fit
from femubench.core.fit.noise import Noise
from femubench.core.fit.projection import Projection
from femubench.core.fit.residuals import Data
from femubench.core.roles import Effect
from femubench.core.schema.diagnosis import Advice

STD = 0.002


def posed(model: Model, truth: Model, effects: Sequence[Effect], count: int = 6) -> Problem:
    """Return a problem with exact frequencies of another model and nothing else."""
    frequencies = solve_modes(truth).elastic.natural_frequencies[:count]
    empty = np.zeros((0, count))
    measurement = Measurement(
        Sensors((), np.zeros((0, 3)), ()),
        tuple(range(1, count + 1)),
        frequencies,
        STD * frequencies,
        np.full(count, np.nan),
        empty,
        empty,
    )
    data = Data(measurement, np.zeros(0))
    hypotheses = hypotheses_of(model, effects)
    space = nominal_space(model, solve_modes(model), measurement.sensors, hypotheses)
    return Problem(model, space, data, Noise.of(np.zeros((count, 0)), 0.0))


def part_of(problem: Problem, effect: Effect, place: str) -> Projection:
    parts = problem.space.projections
    pairs = ((p.hypothesis.name, p.hypothesis.place) for p in parts)
    return parts[list(pairs).index((effect.name, place))]


def fitted(problem: Problem, effect: Effect, place: str, start: float = 0.1) -> Fit:
    part = part_of(problem, effect, place)
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
