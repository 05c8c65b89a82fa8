"""Explanations and their weights: priors, evidence, names, the textbook; what a search finds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import comb, exp, factorial, log
from typing import ClassVar

import numpy as np
import pytest
from diagnosis_problems import coordinates, effects_named, measured, part_at, problem_of

from femubench import Model
from femubench.core.challenge.structures import structure_named
from femubench.core.fem.frame import Place
from femubench.core.fit.extended_model import check_joint_fit, extend_model, raw_residual
from femubench.core.fit.modal_fit import fit
from femubench.core.inference.examine import examine
from femubench.core.inference.posterior import Explanation, Posterior
from femubench.core.inference.prior import log_prior, textbook_bases
from femubench.core.inference.search import Search
from femubench.core.inference.settings import settings
from femubench.effect import FrameEffect, Parameter
from femubench.fem import Frame, PointMass

FRAME = structure_named("ladder").frame
MODEL = Model.of(FRAME)
NOTHING = np.zeros(0)


def test_the_prior_of_all_explanations_with_so_many_causes_sums_to_that_of_their_count() -> None:
    """Over names and places; two causes in either order are one explanation."""
    problem = problem_of(MODEL, measured(MODEL, FRAME), effects_named("density", "joint-mass"))
    parts, names = problem.space.projections, 2
    single = sum(exp(log_prior((part,), names, settings.prior_of_causes)) for part in parts)
    assert single == pytest.approx(settings.prior_of_causes[1])
    double = sum(
        exp(log_prior(pair, names, settings.prior_of_causes)) for pair in combinations(parts, 2)
    )
    # All but the pairs of a hypothesis with itself.
    assert 0.4 * settings.prior_of_causes[2] < double < settings.prior_of_causes[2]
    assert log_prior((), names, settings.prior_of_causes) == log(settings.prior_of_causes[0])
    assert factorial(2) * comb(2, 2) == 2


def test_textbook_sets_are_all_subsets_with_probabilities_that_sum_to_one() -> None:
    known = effects_named("shear-deformation", "rotary-inertia", "density")
    problem = problem_of(MODEL, measured(MODEL, FRAME), known)
    bases = textbook_bases(problem.space.projections)
    assert [base.names for base in bases] == [
        (),
        ("shear-deformation",),
        ("rotary-inertia",),
        ("shear-deformation", "rotary-inertia"),
    ]
    assert sum(exp(base.log_prior) for base in bases) == pytest.approx(1.0)
    assert bases[-1].x.tolist() == [1.0, 1.0]
    (alone,) = textbook_bases([part_at(problem, "density", "all")])
    assert (alone.names, alone.log_prior) == ((), 0.0)


def test_a_noise_that_is_trusted_by_half_halves_what_the_data_say_and_leaves_the_prior() -> None:
    (effect,) = effects_named("member-mass")
    test = measured(effect.extend(MODEL, "rung-left", (0.05,)), FRAME)
    problem = problem_of(MODEL, test, (effect,))
    part = part_at(problem, "member-mass", "rung-left")
    (base,), odds = textbook_bases([]), []
    for trust in (0.0, 0.5, 1.0):
        noisy = replace(problem, noise=replace(problem.noise, trust=trust))
        fits = fit(noisy, (), NOTHING), fit(noisy, (part,), np.array([0.5]))
        nothing, cause = (Explanation(base, found, 1) for found in fits if found is not None)
        found = Posterior.of((nothing, cause)).names
        odds.append(log(found[("member-mass",)] / found[()]))
    priors = [log_prior(parts, 1, settings.prior_of_causes) for parts in ((part,), ())]
    assert odds[0] == pytest.approx(priors[0] - priors[1])
    assert odds[1] == pytest.approx(0.5 * (odds[0] + odds[2]))
    assert odds[2] > odds[0] + 4.0
    # What an assert prints where it fails.
    assert "member-mass at rung-left" in repr(cause)
    assert len(repr(cause)) < 500


@pytest.mark.parametrize(("overlooked", "count"), [(3, 1), (6, 0)])
def test_a_mode_that_a_cause_adds_and_the_test_missed_makes_the_cause_improbable(
    overlooked: int | None, count: int
) -> None:
    """Fewer than one test in ten overlooks a mode among those that it finds, more than in 100."""
    (effect,) = effects_named("attached-oscillator")
    values = (0.02, 500.0)  # kg, Hz: the third mode of seven
    test = measured(effect.extend(MODEL, "J1", values), FRAME)
    test = test.select([n for n in test.numbers if n != overlooked])
    problem = problem_of(MODEL, test, (effect,))
    part = part_at(problem, "attached-oscillator", "J1")
    found = fit(problem, (part,), coordinates(part, values))
    assert found is not None
    assert found.state.chi2 < 1e-6  # the oscillator explains all that was measured
    cost = (
        log_prior((part,), 1, settings.prior_of_causes)
        - Explanation(textbook_bases([])[0], found, 1).log_prior
    )
    assert count * log(10.0) <= cost <= count * log(100.0)


@pytest.fixture(scope="module")
def stiffer() -> Posterior:
    (effect,) = effects_named("member-stiffness")
    truth = effect.extend(MODEL, "rung-middle", (0.2,))
    test = measured(truth, FRAME, rng=np.random.default_rng(3))
    effects = effects_named("member-stiffness", "member-mass", "density", "added-mass")
    return examine(MODEL, test, effects, tolerance=0.005).posterior


def test_probabilities_sum_to_one_by_explanation_and_by_name(stiffer: Posterior) -> None:
    assert sum(stiffer.probabilities) == pytest.approx(1.0)
    assert sum(stiffer.names.values()) == pytest.approx(1.0)
    assert list(stiffer.names.values()) == sorted(stiffer.names.values(), reverse=True)
    weights = [e.log_weight for e in stiffer.explanations]
    assert weights == sorted(weights, reverse=True)
    ratio = stiffer.probabilities[0] / stiffer.probabilities[1]
    assert log(ratio) == pytest.approx(weights[0] - weights[1])


def test_the_hidden_cause_is_the_best_and_its_members_hold_all_of_its_places(
    stiffer: Posterior,
) -> None:
    key = next(iter(stiffer.names))
    assert key == ("member-stiffness",)
    assert stiffer.best(key).place == "rung-middle"
    assert sum(p for _, p in stiffer.members(key)) == pytest.approx(stiffer.names[key])


def test_data_decide_what_a_prior_leaves_open() -> None:
    """The better the data, the more certain the name; the nothing of no data keeps its prior."""
    (effect,) = effects_named("member-mass")
    truth = effect.extend(MODEL, "rung-left", (0.04,))
    test = measured(truth, FRAME, weighed=False)
    found = []
    for share in (30.0, 1.0, 0.25):
        blurred = replace(
            test, frequency_std=share * test.frequency_std, shape_std=share * test.shape_std
        )
        posterior = examine(MODEL, blurred, (effect,), tolerance=0.0).posterior
        found.append(posterior.names.get((), 0.0))
    assert found[0] > 0.5 > found[2]
    assert found == sorted(found, reverse=True)


def test_two_causes_are_found_together_and_one_is_not_split_in_two() -> None:
    stiff, mass = effects_named("member-stiffness", "added-mass")
    effects = effects_named("member-stiffness", "added-mass", "member-mass", "density")
    one = stiff.extend(MODEL, "rung-middle", (-0.2,))
    two = mass.extend(one, "J1", (0.05,))
    for truth, expected in (
        (one, ("member-stiffness",)),
        (two, ("added-mass", "member-stiffness")),
    ):
        test = measured(truth, FRAME, rng=np.random.default_rng(8))
        posterior = examine(MODEL, test, effects, tolerance=0.005).posterior
        assert next(iter(posterior.names)) == expected
        assert posterior.names[expected] > 0.9
    assert posterior.best(expected).place == "J1 + rung-middle"
    alone = examine(MODEL, test, effects, tolerance=0.005, pairs=False).posterior
    assert max(len(e.parts) for e in alone.explanations) == 1


def test_a_size_far_beyond_what_is_usual_is_found() -> None:
    """A weld that hardly holds: modes change places, and no interpolation leads there."""
    x = 4.7
    (effect,) = effects_named("joint-rotation")
    place = "rung-middle@J5"
    assert place in effect.places(MODEL)
    (stiffness,) = effect.parameters(MODEL, place)
    truth = effect.extend(MODEL, place, (float(stiffness.value(np.array(x))),))
    test = measured(truth, FRAME, rng=np.random.default_rng(5))
    others = effects_named("joint-rotation", "member-stiffness", "added-mass", "member-mass")
    posterior = examine(MODEL, test, others, tolerance=0.005).posterior
    best = posterior.explanations[0]
    assert (best.searched, best.place) == (("joint-rotation",), place)
    assert abs(best.fit.state.x[0] - x) < 0.5


def test_several_causes_agree_with_the_model_that_they_make() -> None:
    """A spring at the end of a stiffer member: the two changes do not add up."""
    rotation, stiffness = effects_named("joint-rotation", "member-stiffness")
    truth = stiffness.extend(rotation.extend(MODEL, "J5", (2e4,)), "rung-middle", (0.4,))
    problem = problem_of(MODEL, measured(truth, FRAME), (rotation, stiffness))
    parts = (
        part_at(problem, "joint-rotation", "J5"),
        part_at(problem, "member-stiffness", "rung-middle"),
    )
    plain = fit(problem, parts, np.array([0.5, 0.5]))
    assert plain is not None
    better = check_joint_fit(plain)
    assert better is not None
    gaps = []
    for found in (plain, better):
        exact = raw_residual(problem, extend_model(MODEL, parts, found.state.x))
        gaps.append(float(np.linalg.norm(exact - found.state.raw)))
    assert gaps[1] < 0.3
    assert gaps[1] <= gaps[0]
    exact = raw_residual(problem, extend_model(MODEL, parts, better.state.x))
    assert float(exact @ exact) < 1.0


class Ballast(FrameEffect):
    """A third party's effect: the same mass at both ends of a rung; states no change."""

    name: ClassVar[str] = "ballast"
    summary: ClassVar[str] = "a rung carries ballast at its ends"

    def places(self, model: Model) -> Sequence[str]:
        return tuple(m.name for m in model.frame_structure.frame.members if "rung" in m.name)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("mass", "kg", 0.02, lower=0.0, one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        ends = frame.members[frame.member_index[place]].ends
        more = tuple(PointMass(Place(joint=end), values[0]) for end in ends)
        return replace(frame, masses=(*frame.masses, *more))


class Softening(Ballast):
    """Another one, whose value acts through its square."""

    name: ClassVar[str] = "softening"

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("depth", "", 0.2, lower=0.0, upper=0.8, one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        softer = 1.0 - values[0] ** 2
        members = tuple(
            replace(m, material=replace(m.material, E=softer * m.material.E))
            if m.name == place
            else m
            for m in frame.members
        )
        return replace(frame, members=members)


def test_an_effect_that_states_no_change_is_tabulated_and_found() -> None:
    toy, value = Softening(), 0.45
    assert not hasattr(toy, "change")
    truth = toy.extend(MODEL, "rung-middle", (value,))
    test = measured(truth, FRAME, rng=np.random.default_rng(1))
    rivals = effects_named("density", "torsion-constant", "joint-mass", "joint-rotation")
    examination = examine(MODEL, test, (toy, *rivals), tolerance=0.005)
    best = examination.best
    assert best.searched == (toy.name,)
    assert best.place == "rung-middle"
    (part,) = best.parts
    found = float(part.hypothesis.values(best.fit.state.x[None])[0, 0])
    assert found == pytest.approx(value, rel=0.15)
    extended_model = extend_model(MODEL, best.parts, best.fit.state.x)
    exact = raw_residual(best.fit.state.problem, extended_model)
    assert np.abs(exact - best.fit.state.raw).max() < 0.02


def test_causes_that_do_not_go_together_are_no_explanation() -> None:
    """Two rigid lengths at one end, each as long as may be, are longer than the element."""
    problem = problem_of(MODEL, measured(MODEL, FRAME), effects_named("joint-offset"))
    places = [p.hypothesis.place for p in problem.space.projections]
    end = next(place for place in places if place.rpartition("@")[2] in places and "@" in place)
    parts = tuple(part_at(problem, "joint-offset", at) for at in (end, end.rpartition("@")[2]))
    high = np.concatenate([part.hypothesis.bounds[1] for part in parts])
    found = fit(problem, parts, high, steps=0)
    assert found is not None
    assert check_joint_fit(found) is None
    search, (drawn, *_) = Search(problem, ()), textbook_bases(problem.space.projections)
    assert search.bear_out(drawn, found) == []
    search.highest = np.inf  # far behind they count for nothing either way, and are not solved
    assert [e.fit for e in search.bear_out(drawn, found)] == [found]


def test_causes_found_on_one_textbook_set_are_tried_on_the_others() -> None:
    """Without what the explanation fits of its own set, which is no cause on another."""
    known = effects_named("shear-deformation", "added-mass")
    problem = problem_of(MODEL, measured(MODEL, FRAME), known)
    search = Search(problem, known)
    drawn, sheared = textbook_bases(problem.space.projections)
    found = [search.on(base) for base in (drawn, sheared)]
    own = found[1].problem
    parts = [part_at(own, "added-mass", "J5"), part_at(own, "shear-deformation", "all")]
    led = fit(own, parts, np.array([0.3, -1.0]))
    assert led is not None
    (carried,) = search.carry(Explanation(sheared, led, 2), found)
    assert (carried.base, carried.searched, carried.place) == (drawn, ("added-mass",), "J5")
    part = part_at(problem, "added-mass", "J5")
    alone = fit(problem, (part,), np.array([0.3]))
    assert alone is not None
    assert carried.chi2 == pytest.approx(alone.state.chi2, rel=1e-6)
