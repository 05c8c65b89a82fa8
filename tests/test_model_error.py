"""What a beam model gets wrong: sensitivities of its classes, scales, prediction next to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_problems import effects_named, measured, part_at, problem_of
from scipy.stats import multivariate_normal

from femubench import Model
from femubench.core.challenge.structures import structure_named
from femubench.core.diagnosis.tables import find_passengers
from femubench.core.fem.frame import Factor, JointSpring, Place
from femubench.core.fit.modal_fit import Problem, State, fit, state_at
from femubench.core.fit.noise import Noise
from femubench.core.inference.coordinates import modes_for
from femubench.core.inference.examine import slopes_with
from femubench.core.inference.model_error import (
    Inadequacy,
    class_widths,
    condition_noise,
    error_slopes,
)
from femubench.core.inference.posterior import Explanation
from femubench.core.inference.prior import Base
from femubench.fem import FloatArray, Frame, PointMass

FRAME = structure_named("portal").frame
MODEL = Model.of(FRAME)
TEST = measured(MODEL, FRAME)
NOTHING = np.zeros(0)
WIDTHS = class_widths()
MEMBER = FRAME.members[0]
FOOT, JOINT = MEMBER.ends
LENGTH = FRAME.member_length(MEMBER.name)


@pytest.fixture(scope="module")
def problem() -> Problem:
    return problem_of(MODEL, TEST, effects_named("local-stiffness-loss", "added-mass"))


@pytest.fixture(scope="module")
def slopes(problem: Problem) -> dict[str, FloatArray]:
    return error_slopes(problem, modes_for(MODEL))


def raw(frame: Frame) -> FloatArray:
    """Return the residuals of the test next to another frame."""
    model = Model.of(frame)
    return state_at(problem_of(model, TEST, ()), (), NOTHING).raw


def change(frame: Frame) -> FloatArray:
    """Return by how much the prediction moves, in deviations."""
    return raw(FRAME) - raw(frame)


def stiffer(step: float) -> Frame:
    return replace(FRAME, factors=(*FRAME.factors, Factor("E", (f"{MEMBER.name}/1",), 1.0 + step)))


def heavier(step: float) -> Frame:
    lump = PointMass(Place(JOINT), step * MODEL.total_mass)
    return replace(FRAME, masses=(*FRAME.masses, lump))


def softer(step: float) -> Frame:
    """A spring about the bending axis at the foot, of 4 EI/L over the step."""
    stiffness = 4.0 * MEMBER.material.E * MEMBER.section.Iy / LENGTH / step
    spring = JointSpring(FOOT, MEMBER.name, {"ry": stiffness})
    return replace(FRAME, joint_springs=(*FRAME.joint_springs, spring))


def element(slopes: dict[str, FloatArray]) -> FloatArray:
    return slopes["element stiffness"][:, 0]


def joint(slopes: dict[str, FloatArray]) -> FloatArray:
    number = [item.name for item in FRAME.joints].index(JOINT)
    return slopes["mass of joints"][:, number]


def end(slopes: dict[str, FloatArray]) -> FloatArray:
    """In-plane frames have one direction an end, two ends a member."""
    return slopes["flexibility of joints"][:, 0]


@pytest.mark.parametrize(("frame", "column"), [(stiffer, element), (heavier, joint), (softer, end)])
def test_slopes_are_those_of_a_frame_that_is_changed(
    slopes: dict[str, FloatArray],
    frame: Callable[[float], Frame],
    column: Callable[[dict[str, FloatArray]], FloatArray],
) -> None:
    """Richardson's extrapolation of the change: quadratic terms are gone."""
    step = 2e-4
    slope = (4.0 * change(frame(0.5 * step)) - change(frame(step))) / step
    expected = column(slopes)
    assert np.linalg.norm(expected) > 0.5
    np.testing.assert_allclose(slope, expected, atol=2e-3 * np.abs(expected).max())


@pytest.fixture(scope="module")
def given() -> State:
    """The model with a foot that gives, as a cause in its modal coordinates."""
    own = problem_of(MODEL, TEST, effects_named("support-flexibility"))
    part = part_at(own, "support-flexibility", f"support:{FOOT}")
    return state_at(own, (part,), np.array([0.5, 1.5]))


@pytest.mark.parametrize(("frame", "column"), [(stiffer, element), (heavier, joint), (softer, end)])
def test_slopes_with_a_cause_are_those_of_the_frame_with_it(
    given: State,
    frame: Callable[[float], Frame],
    column: Callable[[dict[str, FloatArray]], FloatArray],
) -> None:
    """Where the foot gives, the forces of the drawn element are not those at its end."""
    effect, place = given.parts[0].hypothesis.effect, given.parts[0].hypothesis.place
    values = given.parts[0].hypothesis.values(given.x[None])[0]

    def prediction(drawn: Frame) -> FloatArray:
        model = effect.extend(Model.of(drawn), place, values.tolist())
        return -state_at(problem_of(model, TEST, ()), (), NOTHING).raw

    step = 2e-4
    half, whole = (prediction(frame(s)) - prediction(FRAME) for s in (0.5 * step, step))
    slope = (4.0 * half - whole) / step
    expected = column(slopes_with(given))
    np.testing.assert_allclose(slope, expected, atol=2e-3 * np.abs(expected).max())
    drawn = column(error_slopes(given.problem, modes_for(MODEL)))
    assert np.abs(expected - drawn).max() > 0.02 * np.abs(drawn).max()


def test_what_a_model_error_makes_of_a_change_is_shared(
    given: State, slopes: dict[str, FloatArray]
) -> None:
    moved = slopes_with(given)
    rng = np.random.default_rng(3)
    before, raw = rng.standard_normal((2, len(given.raw)))
    for name in ("element stiffness", "flexibility of joint types", "mass of joints"):
        z = WIDTHS[name] * rng.standard_normal(slopes[name].shape[1])
        before, raw = before + slopes[name] @ z, raw + moved[name] @ z
    state = replace(given, raw=raw)
    still = Inadequacy.of(slopes, slopes, before, WIDTHS, 0.02, 0.0)
    seen = []
    for model in (still, still.moved(moved)):
        found = model.fit(state)
        seen.append((model.unshared_share(found.v), model.log_density(state, found.v)))
    assert seen[1][0] < 0.5 * seen[0][0]
    assert seen[1][1] > seen[0][1] + 3.0


def test_everything_stiffer_raises_all_frequencies_alike(
    problem: Problem, slopes: dict[str, FloatArray]
) -> None:
    count = len(TEST)
    hertz = slopes["stiffness of everything"][:count, 0] * TEST.frequency_std / TEST.frequencies
    np.testing.assert_allclose(hertz, 0.5, rtol=1e-6)
    np.testing.assert_allclose(
        slopes["density of everything"][:count], -slopes["stiffness of everything"][:count]
    )
    assert TEST.total_mass is not None
    weighed = slopes["density of everything"][-1, 0]
    assert weighed == pytest.approx(MODEL.total_mass / TEST.total_mass[1])
    # All elements together are everything; ends together are their types.
    together = slopes["element stiffness"].sum(axis=1)
    np.testing.assert_allclose(together[:count], slopes["stiffness of everything"][:count, 0])
    ends, types = slopes["flexibility of joints"], slopes["flexibility of joint types"]
    np.testing.assert_allclose(ends.sum(axis=1), types.sum(axis=1), atol=1e-9)


def test_a_known_reference_conditions_what_is_to_come() -> None:
    """ln p(reference) + ln p(data | reference) = ln p(both)."""
    rng = np.random.default_rng(4)
    root = rng.standard_normal((7, 7))
    total = np.eye(7) + root @ root.T
    both = rng.standard_normal(7)
    noise = condition_noise(total, both[:3], 0.5, beam=True)
    residual = noise.residual(both[3:])
    found = noise.log_density - 0.5 * residual @ residual
    expected = multivariate_normal(cov=total).logpdf(both) + 3.5 * np.log(2.0 * np.pi)
    assert found == pytest.approx(expected + 0.5)


def drawn(
    problem: Problem, slopes: dict[str, FloatArray], rng: np.random.Generator, size: float
) -> tuple[State, FloatArray]:
    """Return the nominal model next to data with model error in some classes, and that error."""
    error = np.zeros(len(problem.data))
    for name in ("element stiffness", "flexibility of joint types", "mass of joints"):
        columns = slopes[name]
        error += size * WIDTHS[name] * columns @ rng.standard_normal(columns.shape[1])
    raw = error + rng.standard_normal(len(error))
    return replace(state_at(problem, (), NOTHING), raw=raw), error


def test_scales_follow_the_size_of_the_error(
    problem: Problem, slopes: dict[str, FloatArray]
) -> None:
    model = Inadequacy.of(slopes, None, NOTHING, WIDTHS, 0.0, 0.0)
    chosen = model.names.index("element stiffness"), model.names.index("mass of joints")
    seen = []
    for size in (0.0, 1.0, 3.0):
        rng = np.random.default_rng(5)
        state, _ = drawn(problem, slopes, rng, size)
        found = model.fit(state)
        best = model.log_density(state, found.v)
        for step in 0.3 * np.eye(len(found.v)):
            assert best > max(model.log_density(state, found.v + s) for s in (step, -step)) - 1e-3
        whitened = model.noise(found).residual(state.raw)
        assert 0.6 < np.square(whitened).mean() < 1.4
        seen.append(found.v[list(chosen)].sum())
    assert seen[0] < seen[1] < seen[2]


def test_scales_that_are_fitted_make_less_sure_than_a_noise_that_is_known(
    problem: Problem, slopes: dict[str, FloatArray]
) -> None:
    """The odds of a cause, whose prior is that of nothing at all, under one covariance."""
    part = part_at(problem, "local-stiffness-loss", f"{MEMBER.name}/2")
    rng = np.random.default_rng(8)
    _, error = drawn(problem, slopes, rng, 0.5)
    offset = error + rng.standard_normal(len(error))
    offset -= state_at(problem, (part,), np.array([1.5])).raw
    model = Inadequacy.of(slopes, slopes, error, WIDTHS, 0.02, 0.0)
    present = replace(problem, offset=offset)
    guess = model.noise(model.fit(state_at(present, (), NOTHING)))
    known = condition_noise(model.covariance(guess.scales), model.residual, 0.0, beam=True)
    np.testing.assert_allclose(known.factor, guess.factor)
    odds = []
    for noise in (guess, known):
        fits = (fit(replace(present, noise=noise), p, np.ones(len(p))) for p in ((), (part,)))
        nothing, cause = (Explanation(Base((), 0.0), found, 1) for found in fits if found)
        odds.append((cause.log_weight - cause.log_prior) - (nothing.log_weight - nothing.log_prior))
    assert odds[1] > 5.0
    assert 0.5 * odds[1] < odds[0] < 0.9 * odds[1]


def test_a_cause_whose_size_may_be_nothing_is_a_passenger(problem: Problem) -> None:
    places = ("local-stiffness-loss", f"{MEMBER.name}/2"), ("added-mass", JOINT)
    parts = tuple(part_at(problem, *place) for place in places)
    x = np.array([1.5, 1.5])
    present = replace(problem, offset=-state_at(problem, parts, x).raw)
    found = fit(present, parts, x)
    assert found is not None
    size = np.abs(found.state.x)
    for spread, expected in (
        (0.1 * size, [False, False]),
        (size * (0.1, 0.6), [False, True]),
        (size, [False, False]),  # never the only one
    ):
        assert find_passengers(found.state, spread) == expected


def test_unseen_data_lie_within_what_is_foreseen(
    problem: Problem, slopes: dict[str, FloatArray]
) -> None:
    """Over draws of the model error, errors of unseen frequencies are as large as stated."""
    count = len(TEST)
    unseen = np.array([count - 2, count - 1])
    mode, _ = problem.data.shape_rows
    shapes = count + np.flatnonzero(mode >= count - 2)
    used = np.setdiff1d(np.arange(len(problem.data)), [*unseen, *shapes])
    model = Inadequacy.of({k: s[used] for k, s in slopes.items()}, None, NOTHING, WIDTHS, 0.0, 0.0)
    rows = np.concatenate([used, unseen])
    scores, blind = [], []
    for seed in range(40):
        state, error = drawn(problem, slopes, np.random.default_rng(seed), 1.0)
        part = replace(state, problem=replace(problem, noise=Noise(np.eye(len(used)))))
        object.__setattr__(part, "raw", state.raw[used])
        found = model.fit(part)
        mean, std = model.foreseen(
            found.v,
            {k: s[rows] for k, s in slopes.items()},
            state.raw[rows],
            np.arange(len(used), len(rows)),
        )
        scores.append((error[unseen] - mean) / std)
        blind.append(error[unseen] / std)
    z = np.concatenate(scores)
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.5
    assert np.sqrt(np.mean(np.square(np.concatenate(blind)))) > 1.5


def test_a_cause_next_to_a_model_error_keeps_its_size(
    problem: Problem, slopes: dict[str, FloatArray]
) -> None:
    """The same error stands in a reference: what is left of it hides nothing."""
    part = part_at(problem, "local-stiffness-loss", f"{MEMBER.name}/2")
    rng = np.random.default_rng(8)
    _, error = drawn(problem, slopes, rng, 1.0)
    x = np.array([1.0])
    shift = state_at(problem, (part,), x).raw - state_at(problem, (), NOTHING).raw
    before = error + rng.standard_normal(len(error))
    # Data of the damaged structure, as if measured: the residual of the right cause is the error.
    offset = error + rng.standard_normal(len(error)) - state_at(problem, (part,), x).raw
    model = Inadequacy.of(slopes, slopes, before, WIDTHS, 0.02, 0.0)
    present = replace(problem, offset=offset)
    nothing = state_at(present, (), NOTHING)
    noise = model.noise(model.fit(nothing))
    found = fit(replace(present, noise=noise), (part,), np.array([0.3]))
    assert found is not None
    assert np.linalg.norm(shift) > 8.0
    assert abs(found.state.x[0] - 1.0) < 3.0 * np.sqrt(found.covariance[0, 0])
    assert np.sqrt(found.covariance[0, 0]) < 0.3
    alone = Inadequacy.of(slopes, None, NOTHING, WIDTHS, 0.0, 0.0)
    blurred = fit(replace(present, noise=alone.noise(alone.fit(nothing))), (part,), np.array([0.3]))
    assert blurred is not None
    assert blurred.covariance[0, 0] > found.covariance[0, 0]


def test_what_a_cause_changes_may_be_off_by_a_share_of_it(
    problem: Problem, slopes: dict[str, FloatArray]
) -> None:
    """A third of every change is another than the effect says; the reference fits to the digit."""
    part = part_at(problem, "added-mass", JOINT)
    nothing = state_at(problem, (), NOTHING)
    point = state_at(problem, (part,), np.array([4.0]))
    moved = nothing.raw - point.raw
    rng = np.random.default_rng(9)
    reference, noise = rng.standard_normal((2, len(moved)))
    error = 0.3 * np.abs(moved) * rng.standard_normal(len(moved))
    model = Inadequacy.of(slopes, slopes, reference, WIDTHS, 0.02, 0.0)
    near = model.fit(replace(nothing, raw=noise + moved))
    shares = []
    for off in (0.0, 1.0):
        explained = replace(point, raw=noise + off * error)
        seeing = model.add_own_error(replace(nothing, raw=explained.raw + moved), explained)
        blind, own = model.fit(explained, near), seeing.fit(explained, near)
        shares.append(seeing.own_share(own.v))
        assert model.own_share(blind.v) == 0.0
        assert len(own.v) == len(blind.v) + 1
    assert shares[1] > 2.0 * shares[0]
    density = [
        noise.log_density - 0.5 * np.square(noise.residual(explained.raw)).sum()
        for noise in (model.noise(blind), seeing.noise(own))
    ]
    assert density[1] > density[0] + 3.0
    # Nothing changes nothing: it has no error of its own.
    assert model.add_own_error(nothing, nothing).change.max() == 0.0
