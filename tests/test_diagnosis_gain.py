"""Unseen data: they confirm or refuse what used data name, and never change it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_problems import case_of, coordinates, effects_named, measured, part_at

from femubench import Case, Diagnosis, Measurement, Model, diagnose
from femubench.core.case.case import Modification
from femubench.core.challenge.structures import structure_named
from femubench.core.change.hypothesis import hypotheses_of
from femubench.core.diagnosis.proof import (
    Unseen,
    gain_of,
    predict_held_out,
    predict_left_out,
    predict_modified,
    rms_gain_of,
)
from femubench.core.fit.mesh_error import refine_mesh
from femubench.core.fit.modal_fit import Fit, state_at
from femubench.core.inference.examine import examine, pose_problem
from femubench.core.schema.diagnosis import Cause, Gain
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.results import Block
from femubench.core.score.scoring import score_model
from femubench.fem import GroundSpring, Place, PointMass

FRAME = structure_named("ladder").frame
MODEL = Model.of(FRAME)
NAMES = ("youngs-modulus", "density", "member-stiffness", "member-mass", "added-mass")
CHANGE = (
    (PointMass(Place(member="front-left", s=0.5), 0.5),),
    (GroundSpring(Place(member="front-left", s=0.5), "z", 1.0e6),),
)


def unseen(before: list[float], after: list[float], std: float = 0.01) -> Unseen:
    return Unseen(np.array(before), np.array(after), np.full(len(before), std))


def test_unseen_data_confirm_what_leaves_noise_and_refuse_what_goes_astray() -> None:
    assert unseen([0.1, -0.2, 0.1], [0.005, 0.01, -0.005]).holds
    assert not unseen([0.01, 0.0, 0.01], [0.2, -0.2, 0.1]).holds
    assert not unseen([0.1, -0.2, 0.1], [0.2, -0.4, 0.2]).holds


def test_data_that_cannot_see_a_cause_do_not_veto_it() -> None:
    """The beam is 2 % off there, ten deviations; the cause moves it by a third of one."""
    for step in (0.0003, -0.0003):
        found = unseen([0.02, -0.021], [0.02 + step, -0.021], std=0.002)
        assert not found.visible
        assert found.holds
        mixed = unseen([0.02, -0.021, 0.03], [0.02 + step, -0.021, 0.001], std=0.002)
        assert mixed.log_bayes == pytest.approx(unseen([0.03], [0.001], std=0.002).log_bayes)


def test_a_factor_of_150_against_a_cause_is_a_veto() -> None:
    """Also where what it leaves could be noise."""
    before, after = [0.0005] * 12, [0.003] * 12
    found = unseen(before, after, std=0.002)
    assert found.log_bayes < -5.0
    assert found.probability > 2e-3
    assert not found.holds
    assert unseen(before[:2], after[:2], std=0.002).holds


def test_a_gross_miss_answers_for_no_cause() -> None:
    """A mode that was mistaken for another one is 20 % off with the cause and without it."""
    before, after = [0.03, -0.02, 0.025, 0.2], [0.001, 0.0015, -0.002, 0.19]
    assert unseen(before, after, std=0.002).holds
    assert unseen(before, after, std=0.002).log_bayes > 5.0
    spoiled = [0.07 + e for e in before[:3]], [0.07 + e for e in after[:3]]
    assert len(unseen(*spoiled, std=0.002).sound.before) == 3


def test_where_no_model_leaves_noise_errors_must_fall_decisively() -> None:
    """The errors of real structures stay above the noise."""
    whole = [0.1, -0.1, 0.1, -0.1]
    assert unseen(whole, [0.1 * e for e in whole], 0.001).holds
    slight = unseen(whole, [0.5 * e for e in whole], 0.001)
    assert 0.0 < slight.log_bayes < 5.0
    assert not slight.holds


# --- whole diagnoses --------------------------------------------------------------------------


def made(*causes: tuple[str, str, float], seed: int = 6) -> Case:
    """Return a case of a ladder with causes: six used modes, four held out, one modification."""
    truth = MODEL
    for name, place, value in causes:
        (effect,) = effects_named(name)
        truth = effect.extend(truth, place, (value,))
    rng = np.random.default_rng(seed)
    test = measured(truth, FRAME, count=10, rng=rng)
    after = measured(truth.attach(*CHANGE), FRAME, count=6, weighed=False, rng=rng)
    change = Modification("mass and spring", *CHANGE, after)
    return case_of(MODEL, test, 6, modifications=(change,))


def spoiled(case: Case) -> Case:
    """Return the case with its held-out and modified modes 7 % off and their shapes shuffled."""
    rng = np.random.default_rng(0)

    def off(measurement: Measurement, columns: slice) -> Measurement:
        frequencies, shapes = measurement.frequencies.copy(), measurement.shapes.copy()
        frequencies[columns] *= 1.07
        shapes[:, columns] = rng.permuted(shapes[:, columns], axis=0)
        return replace(measurement, frequencies=frequencies, shapes=shapes)

    changes = tuple(
        replace(m, measurement=off(m.measurement, slice(None))) for m in case.modifications
    )
    measurement = off(case.measurement, slice(len(case.used), None))
    return replace(case, measurement=measurement, modifications=changes)


def found_in(case: Case, names: tuple[str, ...] = NAMES) -> Diagnosis:
    return diagnose(case, effects_named(*names))


def naming(found: Diagnosis) -> str:
    """Return all that must not depend on unseen data, every digit of it."""
    return repr(_naming(found))


def _naming(found: Diagnosis) -> tuple[object, ...]:
    return (
        found.rivals,
        found.smallest_visible,
        found.residuals,
        found.chi2,
        found.adequacy_p,
        found.nothing,
        found.looks,
        found.locations,
        found.base,
        found.gain.used_percent,
    )


def sizes(cause: Cause) -> str:
    return repr((cause.effect, cause.place, cause.parameters, cause.places))


def test_unseen_data_do_not_move_the_naming_bit_for_bit() -> None:
    """Causes, probabilities, sizes stay; gain and verdict tell that the data are off."""
    case = made(("member-stiffness", "rung-middle", -0.25))
    right, wrong = found_in(case), found_in(spoiled(case))
    assert right.verdict == "named"
    assert wrong.verdict == "not-confirmed"
    assert [sizes(cause) for cause in right.causes] == [sizes(cause) for cause in wrong.causes]
    # What unseen data refute is believed no more than they allow.
    assert all(cause.probability > 0.9 for cause in right.causes)
    assert all(cause.probability <= 0.5 for cause in wrong.causes)
    assert naming(right) == naming(wrong)
    assert (right.extended.stiffness != wrong.extended.stiffness).nnz == 0
    assert right.gain.held_out_percent != wrong.gain.held_out_percent
    assert right.gain.modified_percent != wrong.gain.modified_percent


@pytest.mark.nightly
def test_nor_do_they_where_several_causes_are_possible() -> None:
    case = made(("youngs-modulus", "all", 0.1))
    blind = replace(case, measurement=replace(case.measurement, total_mass=None))
    right, wrong = found_in(blind), found_in(spoiled(blind))
    assert naming(right) == naming(wrong)
    assert right.verdict == "ambiguous"


@pytest.mark.parametrize("part", ["held out", "modified"])
def test_either_kind_of_unseen_data_can_refuse_a_name(part: str) -> None:
    case = made(("member-stiffness", "rung-middle", -0.25))
    bad = spoiled(case)
    if part == "held out":
        bad = replace(case, measurement=bad.measurement)
    else:
        bad = replace(case, modifications=bad.modifications)
    assert found_in(bad).verdict == "not-confirmed"


def test_the_gain_is_that_of_the_models_themselves() -> None:
    case = made(("member-mass", "front-left", 0.2))
    found = found_in(case)
    before, after = score_model(case, case.model), score_model(case, found.extended)
    gain = gain_of(before, after, None)
    assert found.gain == gain
    assert found.gain_rms == Gain(
        *(
            (before[name].rms_percent, after[name].rms_percent)
            for name in ("used", "higher", "modified")
        )
    )
    assert gain.held_out_percent is not None
    assert gain.modified_percent is not None
    for first, second in (gain.used_percent, gain.held_out_percent, gain.modified_percent):
        assert second < 0.5 * first
    errors = predict_modified(case, found.extended, 0.0)
    assert 100.0 * np.median(np.abs(errors.after)) == pytest.approx(
        gain.modified_percent[1],
        abs=0.02,  # the gain is not corrected for the mesh
    )


def test_root_mean_squares_are_those_of_a_run_and_of_modes_left_out() -> None:
    before, after = Block(8.5, None), Block(0.5, None)
    blocks = {"used": before, "modified": before}, {"used": after, "modified": after}
    gain = rms_gain_of(*blocks, unseen([0.03, -0.04], [0.0, 0.01]))
    assert (gain.used_percent, gain.held_out_percent) == ((8.5, 0.5), None)
    assert gain.modified_percent == (8.5, 0.5)
    assert gain.cross_validated_percent == pytest.approx((12.5**0.5, 0.5**0.5))
    assert rms_gain_of(*blocks, None).cross_validated_percent is None


def test_without_held_out_data_modes_are_left_out_in_turn() -> None:
    case = replace(made(("member-mass", "front-left", 0.2)), held_out=(), modifications=())
    found = found_in(case)
    assert found.verdict == "named"
    assert found.gain.held_out_percent is None
    assert found.gain.cross_validated_percent is not None
    before, after = found.gain.cross_validated_percent
    assert after < 0.5 * before
    assert found.gain_rms.cross_validated_percent is not None
    first, second = found.gain_rms.cross_validated_percent
    assert second < 0.5 * first
    assert any("holds nothing back" in note for note in found.notes)
    assert "left out in turn" in found.sentence


def test_what_unseen_data_refute_does_not_lead() -> None:
    """A known mass tells density from modulus, which the used frequencies cannot do."""
    effect, size = "density", 0.08
    case = made((effect, "all", size))
    blind = replace(case, measurement=replace(case.measurement, total_mass=None))
    found = found_in(blind, ("youngs-modulus", "density"))
    assert found.verdict == "ambiguous"
    assert {cause.effect for cause in found.causes} == {"youngs-modulus", "density"}
    extended = found.extended.total_mass / MODEL.total_mass - 1.0
    assert extended == pytest.approx(size, abs=0.01)


@pytest.mark.slow(10)
def test_a_mode_left_out_has_no_part_in_what_predicts_it() -> None:
    """One frequency 3 % off asks for a cause; without it nothing does."""
    test = measured(MODEL, FRAME, count=6)
    wrong = test.frequencies.copy()
    wrong[3] *= 1.03
    effects = effects_named(*NAMES)
    seen = examine(MODEL, replace(test, frequencies=wrong), effects, tolerance=0.0)
    assert seen.best.parts
    crossed = predict_left_out(seen.posterior, seen.best)
    assert crossed.before[3] == pytest.approx(0.03, rel=0.05)
    assert crossed.after[3] == pytest.approx(0.03, rel=0.35)


def test_modes_without_partner_are_no_errors_of_a_hundred_percent() -> None:
    def block(*hertz: float | None) -> dict[str, Block]:
        modes = (PairedMode(k, 100.0, f, 1.0) for k, f in enumerate(hertz, 1))
        return {"used": Block(0.0, None, tuple(modes))}

    gain = gain_of(block(104.0, None, None), block(101.0, 100.0, None), None)
    assert gain.used_percent == pytest.approx((4.0, 1.0))
    assert np.isnan(gain_of(block(None), block(101.0), None).used_percent).all()


def test_the_mesh_is_corrected_mode_by_mode_whatever_mode_a_cause_adds() -> None:
    """Truth: a fine mesh with an oscillator. By index every mode above it would be off."""
    coarse = Model.of(replace(FRAME, members=tuple(replace(m, elements=2) for m in FRAME.members)))
    (effect,) = effects_named("attached-oscillator")
    values = (0.3, 150.0)
    extended = effect.extend(coarse, "J1", values)
    fine = Model.of(refine_mesh(coarse.structure))  # type: ignore[arg-type]
    truth = effect.extend(fine, "J1", values)
    after = measured(truth.attach(*CHANGE), FRAME, count=8, weighed=False)
    change = Modification("mass and spring", *CHANGE, after)
    test = measured(truth, FRAME, count=8, shapes=8)
    case = case_of(coarse, test, 4, modifications=(change,))
    errors = predict_modified(case, extended, 0.0)
    assert np.abs(errors.after).max() < 1e-3
    place = next(p for p in effect.places(coarse) if p.startswith("J1"))
    problem, _ = pose_problem(coarse, test.select(case.used), hypotheses_of(coarse, [effect]), 0.0)
    part = part_at(problem, effect.name, place)
    state = state_at(problem, (part,), coordinates(part, values))
    hidden = predict_held_out(case, problem, problem, Fit(state, 0.0), extended, 0.0)
    assert len(hidden.after) == 4
    assert np.abs(hidden.after).max() < 1e-3


def test_a_spring_that_holds_a_free_frame_leaves_the_corrections_where_they_were() -> None:
    """A rigid mode gets a frequency; the elastic ones keep their numbers and corrections."""
    coarse = Model.of(replace(FRAME, members=tuple(replace(m, elements=2) for m in FRAME.members)))
    (effect,) = effects_named("grounding-spring")
    place = next(p for p in effect.places(coarse) if p.startswith("J1"))
    truth = effect.extend(Model.of(refine_mesh(coarse.frame_structure)), place, (2e4,))
    test = measured(truth, FRAME, count=8, shapes=8)
    problem, _ = pose_problem(coarse, test, hypotheses_of(coarse, [effect]), 0.0)
    part = part_at(problem, effect.name, place)
    state = state_at(problem, (part,), coordinates(part, (2e4,)))
    assert np.abs(problem.data.bias[:8]).max() > 0.002
    assert np.abs(state.raw[:8]).max() < 0.5
