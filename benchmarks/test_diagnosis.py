"""Naming what a model lacks, next to a dense solution anew for every hypothesis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from femubench.core.case.case import Case
from femubench.core.challenge.draw import draw_case
from femubench.core.challenge.truth import Hidden
from femubench.core.change.hypothesis import Hypothesis, hypotheses_of
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.errors import FemubenchError
from femubench.core.fem.model import Model
from femubench.core.fit.extended_model import raw_residual
from femubench.core.inference.examine import pose_problem
from femubench.core.plugin.loader import list_effects

_MAGNITUDES = (0.3, 1.0, 2.5)  # deviations of the prior
_SEED = 19


def _case(hidden: Hidden) -> Case:
    """Return a blind case whose model nobody has solved yet: results are kept with a model."""
    case = draw_case(_SEED, "A", hidden=hidden).case
    return replace(case, model=Model.of(case.model.frame_structure.frame))


@pytest.mark.benchmark(group="name what a frame of 81 dofs lacks")
@pytest.mark.parametrize("hidden", ["one", "pair"])
def test_diagnosis(benchmark: BenchmarkFixture, hidden: Hidden) -> None:
    diagnose(_case(hidden))  # plugins are loaded once

    def fresh() -> tuple[tuple[Case], dict[str, object]]:
        return (_case(hidden),), {}

    found: Diagnosis = benchmark.pedantic(diagnose, setup=fresh, rounds=5)
    assert found.causes


@pytest.mark.benchmark(group="name what a frame of 81 dofs lacks")
def test_every_hypothesis_solved_anew(benchmark: BenchmarkFixture) -> None:
    """The rival: three models a hypothesis, nothing refined, no second cause, no proof."""
    case = _case("one")
    known = hypotheses_of(case.model, list_effects())
    problem, _ = pose_problem(case.model, case.measurement.select(case.used), known, case.tolerance)

    def solve_all() -> float:
        best = np.inf
        for hypothesis in known:
            for values in _tried(hypothesis):
                try:
                    model = hypothesis.effect.extend(case.model, hypothesis.place, values)
                    residual = problem.noise.whiten(raw_residual(problem, model))
                except FemubenchError:
                    continue
                best = min(best, float(residual @ residual))
        return best

    best = benchmark.pedantic(solve_all, rounds=1)
    nothing = problem.noise.whiten(raw_residual(problem, case.model))
    assert best < float(nothing @ nothing)


def _tried(hypothesis: Hypothesis) -> list[list[float]]:
    low, high = hypothesis.bounds
    points = [np.clip(np.full(len(low), x), low, high) for x in _MAGNITUDES]
    return [[float(v) for v in hypothesis.values(x[None])[0]] for x in points]
