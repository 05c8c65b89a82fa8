"""Unseen data: they confirm or refuse what used data name, and never change it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femubench import Case, Diagnosis, Measurement, Model, diagnose
from femubench.core.case.case import Modification
from femubench.core.challenge.structures import structure_named
from femubench.core.diagnosis.proof import Unseen, gain_of, modified
from femubench.core.score.scoring import score_model
from femubench.fem import GroundSpring, Place, PointMass

sys.path.insert(0, str(Path(__file__).parent))
from diagnosis_problems import case_of, effects_named, measured

FRAME = structure_named("ladder").frame
MODEL = Model.of(FRAME)
NAMES = ("youngs-modulus", "density", "member-stiffness", "member-mass", "added-mass")
CHANGE = (
    (PointMass(Place(member="front-left", s=0.5), 0.5),),
    (GroundSpring(Place(member="front-left", s=0.5), "z", 1.0e6),),
)


def unseen(before: list[float], after: list[float], std: float = 0.01) -> Unseen:
    return Unseen(np.array(before), np.array(after), np.full(len(before), std))


def test_causes_that_go_all_the_way_have_a_share_of_one() -> None:
    assert unseen([0.1, -0.2], [0.0, 0.0]).share == pytest.approx(1.0)
    assert unseen([0.1, -0.2], [0.05, -0.1]).share == pytest.approx(2.0)
    assert unseen([0.1, -0.2], [-0.1, 0.2]).share == pytest.approx(0.5)
    assert unseen([0.1, -0.2], [0.2, -0.4]).share == pytest.approx(-1.0)


def test_unseen_data_confirm_what_leaves_noise_and_refuse_what_goes_astray() -> None:
    for fitted in (0, 1, 2, 3):
        assert unseen([0.1, -0.2, 0.1], [0.005, 0.01, -0.005]).confirms(fitted)
        assert not unseen([0.01, 0.0, 0.01], [0.2, -0.2, 0.1]).confirms(fitted)
        assert not unseen([0.1, -0.2, 0.1], [0.2, -0.4, 0.2]).confirms(fitted)


def test_unseen_data_that_cannot_see_the_causes_do_not_refuse_them() -> None:
    blind = unseen([0.01, -0.01], [0.009, -0.011])
    assert not blind.visible
    assert blind.confirms(1)
    assert unseen([], []).confirms(1)


def test_where_no_model_leaves_noise_errors_must_fall_by_a_factor() -> None:
    """The errors of real structures stay above the noise; fitted causes must carry further."""
    whole = [1.0, -1.0, 1.0, -1.0]
    assert unseen(whole, [0.1 * e for e in whole]).confirms(1)
    assert unseen(whole, [0.4 * e for e in whole]).confirms(0)
    assert not unseen(whole, [0.4 * e for e in whole]).confirms(1)
    assert not unseen(whole, [0.1 * e for e in whole]).confirms(3)


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


def test_unseen_data_do_not_move_the_naming_bit_for_bit() -> None:
    """Causes, probabilities, sizes stay; gain and verdict tell that the data are off."""
    case = made(("member-stiffness", "rung-middle", -0.25))
    right, wrong = found_in(case), found_in(spoiled(case))
    assert right.verdict == "named"
    assert wrong.verdict == "not-confirmed"
    assert right.causes == wrong.causes
    assert naming(right) == naming(wrong)
    assert (right.extended.stiffness != wrong.extended.stiffness).nnz == 0
    assert right.gain.held_out_percent != wrong.gain.held_out_percent
    assert right.gain.modified_percent != wrong.gain.modified_percent


def test_nor_do_they_where_nothing_is_missing_or_several_causes_are_possible() -> None:
    for case in (made(), made(("youngs-modulus", "all", 0.1))):
        blind = replace(case, measurement=replace(case.measurement, total_mass=None))
        right, wrong = found_in(blind), found_in(spoiled(blind))
        assert naming(right) == naming(wrong)
        assert right.verdict in ("none", "ambiguous")


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
    assert gain.held_out_percent is not None
    assert gain.modified_percent is not None
    for first, second in (gain.used_percent, gain.held_out_percent, gain.modified_percent):
        assert second < 0.5 * first
    errors = modified(case, found.extended, np.zeros(0), 0.0)
    assert 100.0 * np.median(np.abs(errors.after)) == pytest.approx(
        gain.modified_percent[1], rel=0.02
    )


def test_without_held_out_data_modes_are_left_out_in_turn() -> None:
    case = replace(made(("member-mass", "front-left", 0.2)), held_out=(), modifications=())
    found = found_in(case)
    assert found.verdict == "named"
    assert found.gain.held_out_percent is None
    assert found.gain.cross_validated_percent is not None
    before, after = found.gain.cross_validated_percent
    assert after < 0.5 * before
    assert any("holds nothing back" in note for note in found.notes)
    assert "left out in turn" in found.sentence


@pytest.mark.parametrize("seed", range(2))
def test_a_right_name_survives_modes_left_out_in_turn(seed: int) -> None:
    """With half a percent of ordinary scatter, which is part of the noise there too."""
    case = made(("member-mass", "front-left", 0.2), seed=seed)
    alone = replace(case, held_out=(), modifications=())
    found = found_in(alone)
    assert found.causes[0].effect == "member-mass"
    assert found.verdict == "named"
