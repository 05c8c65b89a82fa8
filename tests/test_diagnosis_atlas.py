"""The atlas: how near its interpolation comes to the exact fits that it spares."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from diagnosis_problems import catalogue, coordinates, effects_named, measured, part_at, problem_of

from femubench import Model
from femubench.core.challenge.structures import structure_named
from femubench.core.fit.modal_fit import Fit, Problem, fit, state_at
from femubench.core.inference.grid_search import Screened, _in_cells, screen

NOTHING = np.zeros(0)
# Of chi-square, next to a share of what is explained.
SINGLE, DOUBLE, SHARE = 1.0, 16.0, 0.05


def screened(problem: Problem) -> list[Screened]:
    return screen(problem, state_at(problem, (), NOTHING), problem.space.projections)


def refitted(problem: Problem, item: Screened) -> Fit:
    found = fit(problem, (item.projection,), item.x)
    assert found is not None
    return found


def hidden(
    structure: str, name: str, place: str, values: tuple[float, ...], seed: int = 2
) -> Problem:
    """Return noisy data of a structure with one effect, and all single hypotheses."""
    frame = structure_named(structure).frame
    model, (effect,) = Model.of(frame), effects_named(name)
    true = effect.extend(model, place, values)
    test = measured(true, frame, rng=np.random.default_rng(seed))
    return problem_of(model, test, catalogue().values(), 0.005)


@pytest.fixture(scope="module")
def clean() -> Problem:
    frame = structure_named("ladder").frame
    model = Model.of(frame)
    test = measured(model, frame, rng=np.random.default_rng(4))
    return problem_of(model, test, catalogue().values(), 0.005)


def test_on_clean_data_every_hypothesis_is_within_a_unit_of_its_fit(clean: Problem) -> None:
    """One parameter: cost within 1, evidence within 1 nat; two: cost at most 16 too high."""
    items = screened(clean)
    assert len(items) == len(clean.space.projections) > 150
    lowest = min(s.cost for s in items)
    near = [s for s in items if s.cost < lowest + 30.0]
    chosen = near[::5] + [s for s in near if len(s.x) == 2]
    assert {len(s.x) for s in chosen} == {1, 2}
    for item in chosen:
        found = refitted(clean, item)
        label = item.projection.hypothesis.name, item.projection.hypothesis.place
        if len(item.x) == 1:
            assert item.cost == pytest.approx(found.state.cost, abs=SINGLE), label
            assert item.log_evidence == pytest.approx(found.log_evidence, abs=1.0), label
        else:
            excess = item.cost - found.state.cost
            assert -1.0 < excess < DOUBLE, label


@pytest.mark.parametrize(
    ("structure", "name", "place", "values"),
    [
        ("ladder", "local-stiffness-loss", "front-left/1", (0.5,)),
        ("hframe", "added-mass", "upper-end-1", (0.2,)),
        ("hframe", "brace-spring", "T1-upper-end-2", (4e5,)),
    ],
)
def test_a_size_is_near_its_exact_fit_and_its_rivals_are_behind(
    structure: str, name: str, place: str, values: tuple[float, ...]
) -> None:
    """Cost within 5 % of what is explained, x within 0.25, no rival below it by more."""
    problem = hidden(structure, name, place, values)
    nothing = state_at(problem, (), NOTHING)
    items = screened(problem)
    part = part_at(problem, name, place)
    item = next(s for s in items if s.projection is part)
    found = refitted(problem, item)
    explained = nothing.cost - found.state.cost
    assert explained > 100.0
    assert abs(item.cost - found.state.cost) < SINGLE + SHARE * explained
    assert abs(item.x - found.state.x)[0] < 0.25
    assert item.cost < min(s.cost for s in items) + SINGLE + SHARE * explained


@pytest.mark.parametrize(
    ("structure", "name", "place", "values"),
    [
        ("ladder", "joint-rotation", "T:branch", (5e5, 3e3)),
        ("ladder", "attached-oscillator", "rung-right@0.5", (0.012, 1250.0)),
        ("hframe", "attached-oscillator", "upper-2@0.5:z", (0.1763, 910.0)),
    ],
)
def test_two_parameters_are_found_from_the_grid(
    structure: str, name: str, place: str, values: tuple[float, ...]
) -> None:
    """The best point leads to the exact fit, and is not so dear that it would not be tried."""
    problem = hidden(structure, name, place, values)
    nothing = state_at(problem, (), NOTHING)
    items = screened(problem)
    part = part_at(problem, name, place)
    item = next(s for s in items if s.projection is part)
    found = refitted(problem, item)
    true = fit(problem, (part,), coordinates(part, values))
    assert true is not None
    assert found.state.cost < true.state.cost + 1.0
    explained = nothing.cost - true.state.cost
    assert explained > 100.0
    cost, lowest = item.cost, min(s.cost for s in items)
    limit = lowest + DOUBLE + SHARE * (nothing.cost - lowest)
    assert cost < limit


def test_causes_that_are_there_make_room(clean: Problem) -> None:
    """What lies along a cause that may still move costs next to nothing."""
    part = part_at(clean, "youngs-modulus", "all")
    twin = part_at(clean, "temperature", "all")
    start = state_at(clean, (), NOTHING)
    slope = state_at(clean, (part,), np.zeros(1)).jacobian
    (plain,) = screen(clean, start, (twin,))
    (eased,) = screen(clean, start, (twin,), slope)
    # Next to E the temperature explains nothing more, and costs as much less as E may give way.
    before, after = (
        np.square(s.residuals).sum(axis=1) - np.square(s.residuals).sum(axis=1).min()
        for s in (plain, eased)
    )
    assert before.max() > 20.0
    assert after.max() < 0.1 * before.max()


def test_two_parameters_that_act_alike_far_beyond_their_prior_are_screened() -> None:
    """Their normal equations have one direction to sixteen digits."""
    grid = np.array(list(product((0.5, 1.5, 2.5), (0.5, 1.5, 2.5))))
    shape = np.array([1.0, -2.0, 0.5])
    residuals = 1e9 * (grid.sum(axis=1, keepdims=True) - 2.2) * shape
    x, cost = _in_cells(grid, residuals)
    assert x.sum() == pytest.approx(2.2, rel=1e-5)
    assert cost < 1e9


def test_three_parameters_are_screened_where_they_were_tried() -> None:
    grid = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    x, cost = _in_cells(grid, np.array([[3.0], [1.0], [2.0]]))
    np.testing.assert_array_equal(x, grid[1])
    assert cost == 2.0
