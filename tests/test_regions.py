"""Regions and kinds: what is known before the names of effects are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_problems import (
    case_of,
    catalogue,
    coordinates,
    effects_named,
    measured,
    part_at,
    problem_of,
)

from femubench import Diagnosis, Model, diagnose
from femubench.core.challenge.structures import structure_named
from femubench.core.diagnosis.region import list_atoms, list_kinds, list_regions
from femubench.core.diagnosis.verdict import Decision
from femubench.core.diagnosis.words import sentence_of
from femubench.core.fit.modal_fit import state_at
from femubench.core.schema.diagnosis import Cause, CauseParameter, Gain, Region, RegionKind

FRAME = structure_named("ladder-asymmetric").frame
MODEL = Model.of(FRAME)


# --- places -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "atoms"),
    [
        ("rung-middle/1", {"rung-middle@J5"}),
        ("rung-middle/2", {"rung-middle/2"}),
        ("rung-middle@J5", {"rung-middle@J5"}),
        ("rung-middle@0.25", {"rung-middle@J5", "rung-middle/2"}),
        ("J5", {"J5"}),
        ("J1-J7", {"J1-J7"}),
    ],
)
def test_an_element_at_a_joint_is_the_end_of_its_member(place: str, atoms: set[str]) -> None:
    assert list_atoms(FRAME, place) == atoms


def words_about(place: str) -> list[str]:
    return [word for word, _ in list_regions(FRAME, place)]


def test_end_joint_member_and_whole_lie_in_each_other() -> None:
    about = words_about("rung-middle@J5")
    assert about[0] == "rung-middle@J5"
    assert about[-1] == "all"
    assert {"J5", "rung-middle", "T"} <= set(about)
    assert about.index("J5") < about.index("rung-middle") < about.index("all")
    assert not {"J11", "front-left", "rung-middle@J11", "L"} & set(about)
    # What turns at a joint as a whole is at none of its ends alone.
    assert not [word for word in words_about("J5") if "@" in word]
    assert words_about("all") == ["all"]
    assert words_about("rung-middle")[0] == "rung-middle"
    assert "J5" not in words_about("rung-middle")


def test_matrices_have_places_and_the_whole() -> None:
    assert [word for word, _ in list_regions(None, "group:storey-2")] == ["group:storey-2", "all"]


# --- kinds ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("effect", "place", "value", "kind"),
    [
        ("local-stiffness-loss", "rung-middle/1", 0.3, "stiffness lost"),
        ("joint-rotation", "rung-middle@J5", 5e3, "stiffness lost"),
        ("member-stiffness", "front-left", 0.2, "stiffness added"),
        ("member-stiffness", "front-left", -0.2, "stiffness lost"),
        ("member-mass", "front-left", -0.2, "mass lost"),
        ("added-mass", "J5", 0.07, "mass added"),
    ],
)
def test_the_kind_is_what_is_done_to_the_energies(
    effect: str, place: str, value: float, kind: RegionKind
) -> None:
    problem = problem_of(MODEL, measured(MODEL, FRAME), effects_named(effect))
    part = part_at(problem, effect, place)
    assert list_kinds(state_at(problem, [part], coordinates(part, [value]))) == [kind]


# --- words ------------------------------------------------------------------------------------


END = Region("beam@C", "stiffness lost", 0.99)


def sentence(*regions: Region | None) -> str:
    """Return the sentence about a group of causes in some regions."""
    options = [[Cause(f"e{i}", "p", (), 0.5, region=r)] for i, r in enumerate(regions)]
    decision = Decision("ambiguous", (), 0.0)
    causes = [cause for option in options for cause in option]
    return sentence_of(decision, causes, options, 0.5, Gain((1.0, 1.0)), reference=True)


def test_a_group_in_one_region_is_announced_by_it() -> None:
    assert sentence(END, END) == (
        "What differs from the reference is stiffness lost at the end of beam at C (probability "
        "99 %); these data cannot tell whether it is e0 at p or e1 at p."
    )


@pytest.mark.parametrize("other", [None, replace(END, kind="mass added"), replace(END, place="C")])
def test_a_group_in_several_regions_is_not(other: Region | None) -> None:
    assert "which: e0 at p or e1 at p" in sentence(END, other)


@pytest.mark.parametrize("region", [replace(END, probability=0.9), replace(END, place="all")])
def test_an_unsure_region_or_the_whole_says_nothing(region: Region) -> None:
    assert "which: e0 at p or e1 at p" in sentence(region, region)


def test_a_name_comes_with_sizes_and_their_deviations() -> None:
    sizes = (
        CauseParameter("mass", 0.3123, 0.0121, "kg"),
        CauseParameter("change of E", 0.42, 0.03, "", wording="change"),
    )
    places = zip("ab", ("p", "all"), sizes, strict=True)
    causes = [Cause(name, at, (size,), 0.9, place_probability=0.8) for name, at, size in places]
    decision = Decision("named", (0,), 0.0)
    assert sentence_of(decision, causes, [causes], 0.9, Gain((1.0, 1.0))) == (
        "The model lacks a at p and b (a: mass 0.312 ± 0.012 kg; b: E +42.0 ± 3.0 %; probability "
        "90 %; the place of a 80 %)."
    )


# --- whole diagnoses --------------------------------------------------------------------------


def changed(structure: str, effect: str, place: str, value: float, *, shapes: int = 3) -> Diagnosis:
    """Return the diagnosis of a change by one effect, next to the structure as it was."""
    frame = structure_named(structure).frame
    model, rng = Model.of(frame), np.random.default_rng(6)
    truth = catalogue()[effect].extend(model, place, (value,))
    now = measured(truth, frame, count=6, shapes=shapes, rng=rng)
    before = measured(model, frame, count=6, shapes=shapes, rng=rng)
    case = replace(case_of(model, now, 6), reference=before, reference_used=before.numbers)
    sought = effects_named("local-stiffness-loss", "joint-rotation", "added-mass", "joint-mass")
    return diagnose(case, sought, faults=False, pairs=False)


@pytest.mark.slow(5)
def test_the_end_is_sure_where_loss_and_loose_joint_compete() -> None:
    found = changed("portal", "local-stiffness-loss", "floor/1", 0.3)
    assert found.verdict == "ambiguous"
    assert {c.effect for c in found.causes} == {"local-stiffness-loss", "joint-rotation"}
    for cause in found.causes:
        assert cause.region is not None
        assert (cause.region.place, cause.region.kind) == ("floor@C", "stiffness lost")
        assert cause.region.probability >= 0.95
        assert cause.probability < 0.95
        assert cause.region.size is None  # a spring states no share of the stiffness
    assert "is stiffness lost at the end of floor at C" in found.sentence


@pytest.mark.nightly
def test_a_mass_is_stated_though_its_mirror_place_fits_as_well() -> None:
    region = changed("portal", "added-mass", "E", 0.3).causes[0].region
    assert region is not None
    assert (region.place, region.kind, region.unit) == ("L", "mass added", "kg")
    check_size(region, 0.3)


@pytest.mark.slow(5)
def test_a_loss_is_a_share_of_the_end_where_all_causes_are() -> None:
    found = changed("ladder-asymmetric", "local-stiffness-loss", "rung-middle/1", 0.6, shapes=6)
    region = found.causes[0].region
    assert region is not None
    assert (region.place, region.kind, region.unit) == ("rung-middle@J5", "stiffness lost", "")
    check_size(region, 0.6)


def check_size(region: Region, value: float) -> None:
    assert region.probability >= 0.95
    assert region.size is not None
    assert region.std is not None
    assert 0.0 < region.std < 0.5 * value
    assert abs(region.size - value) < 3.0 * region.std
