"""Fits in modal coordinates: exact predictions, exact slopes, the most probable size, evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from diagnosis_problems import catalogue, coordinates, effects_named, measured, part_at, problem_of
from effect_checks import changed_matrices
from scipy import integrate, optimize

from femubench import Model
from femubench.core.challenge.structures import structure_named
from femubench.core.diagnosis.tables import find_passengers
from femubench.core.errors import ModelError
from femubench.core.fit import modal_fit
from femubench.core.fit.modal_basis import solve_pencil
from femubench.core.fit.modal_fit import Fit, Problem, State, bounds_of, fit, state_at
from femubench.core.fit.noise import Noise
from femubench.core.fit.projection import Projection
from femubench.core.modal.eigen import natural_shift, solve_dense
from femubench.fem import FloatArray, Frame

STRUCTURES = ("ladder", "hframe")
# Springs at member ends are condensed statically: of an eigenvalue, below the noise of 4e-3.
CONDENSED = {"joint-rotation": 2e-3, "joint-flexibility": 4e-3}


def truth_of(frame: Frame) -> Model:
    """Return the structure that is tested: a little softer and heavier in one member."""
    first = frame.members[0]
    own = replace(first.material, E=0.93 * first.material.E, rho=1.04 * first.material.rho)
    return Model.of(replace(frame, members=(replace(first, material=own), *frame.members[1:])))


@pytest.fixture(scope="module")
def problems() -> dict[str, Problem]:
    """Return every effect at every place on a frame out of plane and one in plane."""
    found = {}
    for name in STRUCTURES:
        frame = structure_named(name).frame
        test = measured(truth_of(frame), frame, rng=np.random.default_rng(7))
        found[name] = problem_of(Model.of(frame), test, catalogue().values(), 0.005)
    return found


def of_each_kind(problem: Problem) -> list[Projection]:
    """Return every effect at its first and its last place, and with each number of parameters."""
    chosen: dict[tuple[str, int, bool], Projection] = {}
    for part in problem.space.projections:
        h = part.hypothesis
        chosen.setdefault((h.name, len(h.parameters), True), part)
        chosen[h.name, len(h.parameters), False] = part
    return list({id(part): part for part in chosen.values()}.values())


def inside(part: Projection) -> FloatArray:
    """Return a typical magnitude, all of it within the bounds."""
    low, high = bounds_of((part,))
    return np.clip(np.linspace(0.7, 0.5, len(low)), low + 0.05, high - 0.05)


def slopes_by_differences(state: State, step: float = 0.012) -> FloatArray:
    """Return central differences of fourth order, whose step keeps rounding (1e-6) below 5e-5."""
    columns = []
    for i in range(len(state.x)):
        shift = step * (np.arange(len(state.x)) == i)
        ends = [state_at(state.problem, state.parts, state.x + k * shift) for k in (-2, -1, 1, 2)]
        assert all((end.partner == state.partner).all() for end in ends)
        weights = np.array([-1.0, 8.0, -8.0, 1.0]) / (12.0 * step)  # a residual falls
        columns.append(weights @ [end.residual for end in ends])
    return np.column_stack(columns)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_slopes_of_frequencies_shapes_and_mass(
    problems: dict[str, Problem], structure: str
) -> None:
    """Against central differences of the prediction, for every kind of effect."""
    problem, names = problems[structure], set()
    for part in of_each_kind(problem):
        h = part.hypothesis
        state = state_at(problem, (part,), inside(part))
        found, expected = state.jacobian, slopes_by_differences(state)
        scale = np.abs(expected).max(axis=0)
        assert (np.abs(found - expected) < 3e-4 * scale + 5e-5).all(), (h.name, h.place)
        names.add(h.name)
    # The ladder lacks braces, the H-frame torsion; the amplitude needs a second level.
    assert len(names) >= 14


def test_only_what_has_weight_moves_the_mass(problems: dict[str, Problem]) -> None:
    problem = problems["hframe"]
    # The arms of flexible joints are massless.
    heavy = {"density", "member-mass", "joint-mass", "added-mass", "attached-oscillator"}
    heavy |= {"joint-rotation", "joint-flexibility", "wall-thickness"}
    nominal = problem.model.total_mass
    for part in of_each_kind(problem):
        h = part.hypothesis
        state = state_at(problem, (part,), inside(part))
        values = [float(v) for v in h.values(state.x[None])[0]]
        extended = h.effect.extend(problem.model, h.place, values)
        assert state.mass == pytest.approx(extended.total_mass, rel=1e-9), (h.name, h.place)
        assert (abs(state.mass / nominal - 1.0) > 1e-6) == (h.name in heavy)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_modal_coordinates_give_the_modes_of_the_extended_model(
    problems: dict[str, Problem], structure: str
) -> None:
    problem = problems[structure]
    for part in of_each_kind(problem):
        h = part.hypothesis
        x = inside(part)
        values = [float(v) for v in h.values(x[None])[0]]
        extended = h.effect.extend(problem.model, h.place, values)
        stiffness, mass, _ = problem.space.assemble((part,), x)
        found = solve_pencil(stiffness, mass)[0]
        expected = solve_dense(extended.mass.toarray(), extended.stiffness.toarray())[0]
        floor = 1e-4 * problem.space.eigenvalues[problem.space.rigid]
        found, expected = (v[v > floor][:8] for v in (found, expected))
        error = np.abs(found / expected - 1.0).max()
        assert error < CONDENSED.get(h.name, 1e-7), (h.name, h.place)


def test_all_modes_make_the_modal_coordinates_exact(problems: dict[str, Problem]) -> None:
    """K and M of several causes, term by term, through the modal matrix and back."""
    problem = problems["ladder"]
    parts = [
        part_at(problem, *label)
        for label in (("youngs-modulus", "all"), ("joint-rotation", "J9"), ("joint-mass", "T"))
    ]
    x = np.array([0.8, 0.6, 1.1])
    stiffness, mass, _ = problem.space.assemble(parts, x)
    model = problem.model
    dense = {"stiffness": model.stiffness.toarray(), "mass": model.mass.toarray()}
    total = {name: matrix.copy() for name, matrix in dense.items()}
    for part, own in zip(parts, x, strict=True):
        h = part.hypothesis
        changed = changed_matrices(model, h.change, [float(h.values(own[None, None])[0, 0])])
        for name, matrix in zip(("mass", "stiffness"), changed, strict=True):
            total[name] += matrix - dense[name]
    found = solve_pencil(stiffness, mass)[0]
    expected = la.eigh(total["stiffness"], total["mass"], eigvals_only=True)
    elastic = expected > 1e-6 * expected[-1]
    # The modes come from 1 / (lambda + s), whose rounding is that of the lowest: eps lambda / s.
    high = np.finfo(float).eps * expected / natural_shift(dense["mass"], dense["stiffness"])
    error = np.abs(found / expected - 1.0)
    assert (error < 1e-10 + high)[elastic].all()


def test_a_point_is_solved_once_whatever_the_noise(
    problems: dict[str, Problem], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = problems["ladder"]
    part = of_each_kind(problem)[0]
    x, solved = inside(part), []
    first = state_at(problem, (part,), x)
    slopes, vectors = first.slopes, first.vectors
    monkeypatch.setattr(
        modal_fit, "solve_pencil", lambda *pair: solved.append(pair) or solve_pencil(*pair)
    )
    louder = replace(problem, noise=Noise(2.0 * np.eye(len(problem.data))))
    again = state_at(louder, (part,), x)
    assert again.chi2 == pytest.approx(first.raw @ first.raw / 4.0)
    assert again.slopes is slopes
    assert solved == []
    np.testing.assert_array_equal(again.vectors, vectors)
    assert len(solved) == 1
    other = replace(problem, data=replace(problem.data, bias=np.full(3, 0.01)))
    assert (state_at(other, (part,), x).raw != first.raw).any()
    assert len(solved) == 2


def test_few_coordinates_give_what_all_do(problems: dict[str, Problem]) -> None:
    problem = problems["hframe"]
    fewer = 0
    for part in of_each_kind(problem):
        x = inside(part)
        own = problem.space.condense((part,), problem.compared).space
        fewer += len(own) < 0.7 * len(problem.space)
        few, every = (state_at(problem, (part,), x, every=not k) for k in (1, 0))
        low = slice(0, problem.compared)
        assert few.eigenvalues[low] == pytest.approx(every.eigenvalues[low], rel=1e-7, abs=1.0)
        assert few.raw == pytest.approx(every.raw, abs=1e-4), part.hypothesis.name
        size = np.abs(every.slopes).max(axis=0)
        assert (np.abs(few.slopes - every.slopes) <= 1e-3 * size).all(), part.hypothesis.name
    assert fewer > 10


def test_rebased_coordinates_are_those_of_the_model_with_the_cause_in_it(
    problems: dict[str, Problem],
) -> None:
    problem = problems["ladder"]
    spring = part_at(problem, "grounding-spring", "J5")
    other = part_at(problem, "attached-oscillator", "J1")
    third = part_at(problem, "member-mass", "rung-middle")
    whole = part_at(problem, "youngs-modulus", "all")
    assert whole.whole
    index = [
        next(i for i, p in enumerate(problem.space.projections) if p is part)
        for part in (other, third, whole)
    ]
    x, rest = np.array([0.9]), np.array([0.7, 0.4, 1.2, 0.5])
    space = problem.space.rebase((spring,), x)
    # The spring holds one of the rigid modes.
    assert (problem.space.rigid, space.rigid) == (3, 2)
    np.testing.assert_allclose(
        space.eigenvalues, solve_pencil(*problem.space.assemble((spring,), x)[:2])[0]
    )
    above = tuple(space.projections[i] for i in index)
    together = problem.space.assemble((spring, other, third, whole), np.concatenate([x, rest]))
    on_top = space.assemble(above, rest)
    elastic = slice(2, None)
    expected, seen = (solve_pencil(*found[:2])[0][elastic] for found in (together, on_top))
    np.testing.assert_allclose(seen, expected, rtol=1e-8)
    assert on_top[2] == pytest.approx(together[2], rel=1e-12)
    one = state_at(problem, (spring, other, third, whole), np.concatenate([x, rest])).raw
    two = state_at(replace(problem, space=space), above, rest).raw
    np.testing.assert_allclose(two, one, atol=1e-5)


# --- the most probable size -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("structure", "name", "place", "values"),
    [
        ("ladder", "joint-rotation", "L", (6e3, 4e3)),
        ("ladder", "attached-oscillator", "J1", (0.02, 500.0)),
        ("hframe", "joint-offset", "T1", (0.02,)),
    ],
)
def test_exact_data_give_the_size_back(
    structure: str, name: str, place: str, values: Sequence[float]
) -> None:
    """To 15 % of its own standard deviation next to the pull of the prior, where a fit settles."""
    frame = structure_named(structure).frame
    model, (effect,) = Model.of(frame), effects_named(name)
    test = measured(effect.extend(model, place, values), frame)
    problem = problem_of(model, test, (effect,))
    part = part_at(problem, name, place)
    true = coordinates(part, values)
    found = fit(problem, (part,), 0.6 * true)
    assert found is not None
    pull = found.covariance @ true
    deviation = np.sqrt(np.diag(found.covariance))
    assert (np.abs(found.state.x - (true - pull)) < 0.15 * deviation).all()
    assert found.state.chi2 < 0.3 + 2.0 * float(pull @ true)


def test_the_fit_is_the_lowest_cost_between_the_bounds(problems: dict[str, Problem]) -> None:
    """Against a bounded search along the one coordinate, within a tenth of a unit of chi-square."""
    problem = problems["ladder"]
    chosen = [p for p in of_each_kind(problem) if len(p.hypothesis.parameters) == 1]
    assert len(chosen) > 20
    for part in chosen[::3]:
        (low,), (high,) = bounds_of((part,))
        found = fit(problem, (part,), np.array([0.3]))
        assert found is not None
        x = found.state.x[0]
        assert low <= x <= high

        def cost(value: float, part: Projection = part) -> float:
            return state_at(problem, (part,), np.array([value])).cost

        span = max(low, x - 1.0), min(high, x + 1.0)
        best = optimize.minimize_scalar(cost, bounds=span, method="bounded").fun
        assert found.state.cost < best + 0.1, part.hypothesis


def test_hopeless_fits_stop_and_bounds_hold(problems: dict[str, Problem]) -> None:
    problem = problems["ladder"]
    part = part_at(problem, "local-stiffness-loss", "rung-left/1")
    early = fit(problem, (part,), np.array([2.0]), give_up=-1e9)
    whole = fit(problem, (part,), np.array([2.0]))
    assert early is not None
    assert whole is not None
    assert early.state.x == pytest.approx([2.0])
    assert whole.state.cost < early.state.cost
    outside = fit(problem, (part,), np.array([-50.0]), steps=0)
    assert outside is not None
    assert outside.state.x[0] == 0.0


def test_the_covariance_is_what_repeated_tests_show() -> None:
    """Forty seeded tests of one structure: the fits scatter as the covariance says."""
    frame = structure_named("ladder").frame
    model, (effect,) = Model.of(frame), effects_named("member-mass")
    truth = effect.extend(model, "front-left", (0.15,))
    rng, deviations = np.random.default_rng(11), []
    exact = problem_of(model, measured(truth, frame), (effect,))
    part = part_at(exact, "member-mass", "front-left")
    true = coordinates(part, (0.15,))
    for _ in range(40):
        data = replace(exact.data, measurement=exact.data.measurement.with_noise(rng))
        found = fit(replace(exact, data=data), (part,), true)
        assert found is not None
        deviations.append(float((found.state.x - true)[0] / np.sqrt(found.covariance[0, 0])))
    assert abs(np.mean(deviations)) < 4.0 / np.sqrt(40.0)
    assert np.var(deviations) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 40.0))


@pytest.mark.parametrize("blur", [1.0, 1e4])
def test_the_covariance_is_the_curvature_of_the_cost_with_its_prior(blur: float) -> None:
    """Against second differences; of what the data do not show, the prior's deviation is left."""
    frame = structure_named("ladder").frame
    model, (effect,) = Model.of(frame), effects_named("member-mass")
    test = measured(model, frame, weighed=False)
    test = replace(test, frequency_std=blur * test.frequency_std, shape_std=blur * test.shape_std)
    problem = problem_of(model, test, (effect,))
    part = part_at(problem, "member-mass", "front-left")
    found = fit(problem, (part,), np.zeros(1))
    assert found is not None
    step = 0.02
    low, mid, high = (state_at(problem, (part,), np.array([x])).cost for x in (-step, 0.0, step))
    curvature = (low - 2.0 * mid + high) / (2.0 * step**2)
    assert curvature >= 1.0
    assert found.covariance[0, 0] == pytest.approx(1.0 / curvature, rel=1e-2)
    assert (found.covariance[0, 0] > 0.99) == (blur > 1e3)


# --- evidence ---------------------------------------------------------------------------------


def quadrature(problem: Problem, parts: Sequence[Projection], found: Fit) -> float:
    """Return ln of the integral of likelihood times prior, by Simpson's rule on a fine grid."""
    spread = np.sqrt(np.diag(found.covariance))
    low, high = bounds_of(parts)
    one_sided = np.concatenate([part.hypothesis.one_sided for part in parts]) > 0.0
    points = 121 if len(spread) == 1 else 25
    axes = [
        np.linspace(max(a, c - 6.0 * s), min(b, c + 6.0 * s), points)
        for a, b, c, s in zip(low, high, found.state.x, spread, strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    cost = np.array([state_at(problem, parts, x).cost for x in grid])
    least = cost.min()
    density = np.exp(-0.5 * (cost - least)).reshape([points] * len(axes))
    for axis in reversed(axes):
        density = integrate.simpson(density, x=axis)
    prior = np.where(one_sided, np.sqrt(2.0 / np.pi), 1.0 / np.sqrt(2.0 * np.pi)).prod()
    return float(np.log(density) - 0.5 * least + np.log(prior))


@pytest.fixture(scope="module")
def small() -> Problem:
    """Return a coarse ladder with a slightly lighter member, and data that show it barely."""
    nominal = structure_named("ladder").frame
    frame = replace(nominal, members=tuple(replace(m, elements=2) for m in nominal.members))
    model, (effect,) = Model.of(frame), effects_named("member-mass")
    truth = effect.extend(model, "rung-middle", (-0.03,))
    test = measured(truth, frame, shapes=2, rng=np.random.default_rng(5))
    return problem_of(model, test, catalogue().values())


@pytest.mark.parametrize(
    "labels",
    [
        [("member-mass", "rung-middle")],
        [("added-mass", "J1")],
        [("rotary-inertia", "all")],
        [("youngs-modulus", "all"), ("density", "all")],
        [("added-mass", "J1"), ("member-mass", "rung-middle")],
        [("rotary-inertia", "all"), ("torsion-constant", "all")],
    ],
    ids=lambda labels: "+".join(f"{name}@{place}" for name, place in labels),
)
def test_evidence_is_the_integral_of_likelihood_times_prior(
    small: Problem, labels: list[tuple[str, str]]
) -> None:
    """Two-sided, one-sided inside and at its bound, one and two coordinates: within 0.15 nats."""
    parts = [part_at(small, *label) for label in labels]
    found = fit(small, parts, np.full(len(parts), 0.2), steps=40)
    assert found is not None
    assert found.log_evidence == pytest.approx(quadrature(small, parts, found), abs=0.15)


def test_what_alone_keeps_the_mass_positive_is_no_passenger(problems: dict[str, Problem]) -> None:
    """Without it the other cause takes away more mass than there is."""
    problem = problems["hframe"]
    part = part_at(problem, "density", "all")
    away = np.array([-30.0])
    with pytest.raises(ModelError, match="indefinite"):
        state_at(problem, (part,), away)
    both = state_at(problem, (part, part), np.concatenate([away, -away]))
    assert find_passengers(both, np.ones(2)) == [False, False]
