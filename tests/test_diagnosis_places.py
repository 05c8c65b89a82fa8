"""Name and place apart: probabilities, credible sets, mirror images, advice between places."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_problems import case_of, catalogue, effects_named, measured

from femubench import Diagnosis, Model, diagnose
from femubench.core.challenge.structures import structure_named
from femubench.core.diagnosis.serial import diagnosis_from_json, diagnosis_to_json
from femubench.core.diagnosis.symmetry import mirror_places, symmetries
from femubench.core.diagnosis.verdict import credible, places_of
from femubench.core.inference.posterior import Posterior
from femubench.fem import Place, PointMass

FRAME = structure_named("ladder").frame
MODEL = Model.of(FRAME)
CORNERS = {"J1", "J3", "J7", "J9"}


def mass_at(joint: str, *, shapes: int, kilograms: float = 0.1, names: Any = ()) -> Diagnosis:
    """Return the diagnosis of a ladder with a mass at a joint."""
    truth = catalogue()["added-mass"].extend(MODEL, joint, (kilograms,))
    test = measured(truth, FRAME, count=9, shapes=shapes, rng=np.random.default_rng(3))
    known = effects_named("added-mass", "torsion-constant", "member-stiffness", *names)
    return diagnose(case_of(MODEL, test, 6), known, pairs=False)


@pytest.fixture(scope="module")
def blind() -> Diagnosis:
    """Return a mass at a corner of a symmetric frame, seen by frequencies alone."""
    return mass_at("J3", shapes=0)


@pytest.fixture(scope="module")
def seen() -> Diagnosis:
    return mass_at("J3", shapes=5)


def test_the_name_is_sure_and_the_place_is_one_of_four(blind: Diagnosis) -> None:
    (cause,) = blind.causes
    assert cause.effect == "added-mass"
    assert cause.probability > 0.95
    assert cause.place_probability == pytest.approx(0.25, abs=0.02)
    assert {place for place, _ in cause.places} >= CORNERS
    assert sum(p for _, p in cause.places) >= 0.95
    assert {cause.place, *cause.mirrors} == CORNERS


def test_shapes_settle_the_place(seen: Diagnosis) -> None:
    (cause,) = seen.causes
    assert cause.place == "J3"
    assert cause.place_probability > 0.95
    assert cause.places[0][0] == "J3"
    assert cause.mirrors == ()
    assert "mirror" not in seen.sentence


def test_advice_parts_places_as_it_parts_names(blind: Diagnosis, seen: Diagnosis) -> None:
    assert blind.verdict == "named"
    assert blind.advice
    assert blind.advice[0].separation > 1.0
    assert seen.advice == ()


def test_json_carries_name_and_place_apart(blind: Diagnosis) -> None:
    data = json.loads(json.dumps(diagnosis_to_json(blind)))
    (cause,) = data["causes"]
    assert cause["probability"] > 0.95
    assert cause["place_probability"] == pytest.approx(0.25, abs=0.02)
    assert {place for place, _ in cause["places"]} >= CORNERS
    assert diagnosis_from_json(data)["causes"][0] == cause
    for key in ("place_probability", "places", "mirrors"):
        del cause[key]
    (old,) = diagnosis_from_json(data)["causes"]
    assert (old["place_probability"], old["places"]) == (None, [])


def at(probability: float, *causes: tuple[str, str]) -> Any:
    """Return an explanation as far as places go."""
    parts = tuple(
        SimpleNamespace(hypothesis=SimpleNamespace(name=name, place=place))
        for name, place in causes
    )
    names = tuple(sorted(name for name, _ in causes))
    base = SimpleNamespace(names=(), parts=())
    place = " + ".join(place for _, place in sorted(causes))
    return SimpleNamespace(
        base=base,
        parts=parts,
        searched=names,
        effects=frozenset(names),
        place=place,
        log_weight=np.log(probability),
    )


def test_a_place_counts_whatever_is_next_to_it() -> None:
    best = at(0.4, ("a", "x"), ("b", "u"))
    others = at(0.3, ("a", "x"), ("b", "v")), at(0.2, ("a", "y"), ("b", "u"))
    found = Posterior.of((best, *others, at(0.1, ("a", "z"))))
    first, second = (places_of(found, best, k) for k in (0, 1))
    assert first == pytest.approx({"x": 7 / 9, "y": 2 / 9})
    assert second == pytest.approx({"u": 6 / 9, "v": 3 / 9})


def test_of_the_same_effect_twice_each_leaves_the_other_its_place() -> None:
    best = at(0.6, ("a", "x"), ("a", "y"))
    found = Posterior.of((best, at(0.3, ("a", "x"), ("a", "z")), at(0.1, ("a", "w"), ("a", "y"))))
    assert places_of(found, best, 1) == pytest.approx({"y": 0.65, "z": 0.3, "w": 0.05})
    assert sum(places_of(found, best, 0).values()) == pytest.approx(1.0)


def test_a_place_is_one_however_many_values_the_effect_has_there() -> None:
    best = at(0.4, ("a", "x"), ("b", "u:apart"))
    found = Posterior.of((best, at(0.3, ("a", "x"), ("b", "u")), at(0.3, ("a", "x"), ("b", "v"))))
    assert places_of(found, best, 1) == pytest.approx({"u:apart": 0.7, "v": 0.3})
    twice = at(0.6, ("a", "x:apart"), ("a", "y"))
    found = Posterior.of((twice, at(0.4, ("a", "x"), ("a", "z"))))
    assert places_of(found, twice, 0) == pytest.approx({"x:apart": 0.8, "z": 0.2})
    assert places_of(found, twice, 1) == pytest.approx({"y": 0.6, "z": 0.4})


def test_a_credible_set_ends_at_95_percent_but_not_between_equals() -> None:
    assert credible({"x": 0.9, "y": 0.06, "z": 0.04}) == (("x", 0.9), ("y", 0.06))
    equal = dict.fromkeys("abcd", 0.25)
    assert credible(equal) == tuple(equal.items())
    tail = {"x": 0.94, "y": 0.02, "z": 0.02, "w": 0.02}
    assert credible(tail) == tuple(tail.items())


# --- symmetry ---------------------------------------------------------------------------------


def test_the_ladder_has_its_mirrors() -> None:
    assert len(symmetries(MODEL)) == 7
    ends = ("J1", "J5", "J7", "J9", "front-left", "all")
    assert mirror_places(MODEL, "J3", ends) == ("J1", "J7", "J9")
    assert mirror_places(MODEL, "front-left/1", ("front-right/4", "front-right/1")) == (
        "front-right/4",
    )
    assert mirror_places(MODEL, "front-left@0.25", ("front-right@0.75", "front-right@0.25")) == (
        "front-right@0.75",
    )


@pytest.mark.parametrize("what", ["mass", "support"])
def test_what_stands_on_one_side_ends_the_symmetry(what: str) -> None:
    at = Place(joint="J3")
    model = MODEL.attach((PointMass(at, 0.05),), ())
    if what == "support":
        from femubench.fem import Support

        model = Model.of(replace(FRAME, supports=(*FRAME.supports, Support(at, ("z",)))))
    assert mirror_places(model, "J3", ("J1", "J7", "J9")) == ()
