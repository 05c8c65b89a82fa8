"""How the sweep over all truths scores what is said of them, on records made by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import truth_sweep as sweep

from femubench import read_case
from femubench.core.challenge.truth_file import KnownCase, TrueCause, is_held

ROOT = Path(__file__).parents[1]
LOOSE = TrueCause("a loose joint", "joint-rotation", "J1", ("joint-rotation@J9", "joint-offset@J1"))
CLAMP = TrueCause("a clamp", "added-mass", "rung-middle@0.5")
SWAP = TrueCause("swapped cables", "sensors-swapped", "sensor:5Z+7Z")
TAPER = TrueCause("a tapered member", "", "front-left")


def truth(kind: str, *causes: TrueCause, chi2: float | None = 50.0, name: str = "x") -> KnownCase:
    return KnownCase(name, "frame-solid", kind, 1, causes, chi2, chi2)


def said(verdict: str, *causes: str, p: float = 0.9) -> dict[str, Any]:
    """Return a record: every cause as ``effect@place``, with `` + `` for a pair in a group."""
    listed = []
    for cause in causes:
        parts = [part.partition("@")[::2] for part in cause.split(" + ")]
        effect, place = (" + ".join(words) for words in zip(*parts, strict=True))
        listed.append({"effect": effect, "place": place, "probability": p})
    answer = {"verdict": verdict, "causes": listed}
    return {"verdict": verdict, "answer": answer, "probability": p if listed else None}


@pytest.fixture(scope="module")
def same() -> sweep.Same:
    frame = read_case(ROOT / "scenarios" / "frame-solid").model.frame_structure.frame
    return sweep.same_place(frame)


@pytest.mark.parametrize(
    ("expected", "record"),
    [
        ("right", said("named", "joint-rotation@J1")),
        ("right", said("named", "joint-rotation@rung-right@J1")),  # an end at a joint of two
        ("right", said("named", "joint-offset@J1")),
        ("other place", said("named", "joint-rotation@J5")),
        ("wrong", said("named", "added-mass@J1")),
        ("with others", said("named", "joint-rotation@J1", "added-mass@J5")),
        ("in the group", said("ambiguous", "added-mass@J1", "joint-rotation@J1")),
        ("other place", said("ambiguous", "added-mass@J1", "joint-rotation@J5")),
        ("with others", said("ambiguous", "joint-rotation@J1 + density@all")),
        ("none", said("none")),
        ("unknown", said("unknown", "joint-rotation@J1")),
        ("not confirmed", said("not-confirmed", "joint-rotation@J1")),
        ("error", {"verdict": "error", "error": "ModelError: no modes"}),
        ("too long", {"verdict": "too-long"}),
    ],
)
def test_outcome_of_a_single_defect(
    same: sweep.Same, expected: str, record: dict[str, Any]
) -> None:
    assert sweep.outcome(truth("defect", LOOSE), record, same) == expected


def test_outcome_of_a_pair(same: sweep.Same) -> None:
    pair = truth("pair", LOOSE, CLAMP)
    both = ("added-mass@rung-middle@0.5", "joint-rotation@J9")
    assert sweep.outcome(pair, said("named", *both), same) == "right"
    assert sweep.outcome(pair, said("ambiguous", " + ".join(both)), same) == "in the group"
    assert sweep.outcome(pair, said("named", both[0], "joint-rotation@T"), same) == "other place"
    assert sweep.outcome(pair, said("named", both[0]), same) == "one of two"
    assert sweep.outcome(pair, said("ambiguous", *both), same) == "one of two"
    assert sweep.outcome(pair, said("named", "added-mass@J1"), same) == "wrong"
    assert sweep.outcome(pair, said("named", *both, "density@all"), same) == "with others"
    assert sweep.outcome(pair, said("named", both[0], "density@all"), same) == "wrong"
    twice = truth("pair", LOOSE, LOOSE)
    assert sweep.outcome(twice, said("named", "joint-rotation@J1"), same) == "one of two"


def test_textbook_values_are_no_finding(same: sweep.Same) -> None:
    defect, clean = truth("defect", LOOSE), truth("clean")
    record = said("named", "joint-rotation@J1", "shear-deformation@all")
    assert sweep.outcome(defect, record, same) == "with others"
    assert sweep.outcome(defect, {**record, "textbook": ["shear-deformation"]}, same) == "right"
    # What is sought is a finding, wherever it was taken from.
    assert sweep.outcome(defect, {**record, "textbook": ["joint-rotation"]}, same) == "with others"
    plain = {**said("named", "shear-deformation@all"), "textbook": ["shear-deformation"]}
    assert sweep.outcome(clean, plain, same) == sweep.outcome(defect, plain, same) == "none"
    assert sweep.outcome(clean, {**record, "textbook": ["shear-deformation"]}, same) == "wrong"


def test_outcome_without_a_name_to_give(same: sweep.Same) -> None:
    clean, outside = truth("clean"), truth("outside", TAPER)
    assert sweep.outcome(clean, said("named", "density@all"), same) == "wrong"
    assert sweep.outcome(outside, said("named", "density@all"), same) == "wrong"
    good = {"none", "unknown", "not confirmed", "right", "in the group"}
    for kind, right in (
        (clean, {"none"}),
        (outside, good - {"none"}),
        (truth("defect", LOOSE), {"right", "in the group"}),
    ):
        assert {word for word in sweep.OUTCOMES if sweep.counts_as_right(kind, word)} == right


def test_tables_count_both_halves_apart() -> None:
    names = [str(i) for i in range(20)]
    kept, shown = ([n for n in names if is_held(n) is half] for half in (True, False))
    truths = [truth("defect", LOOSE, name=name) for name in names]
    records = {name: said("named", "joint-rotation@J1") for name in shown}
    records[shown[0]] = said("named", "density@all", p=0.995)
    records[shown[1]] = said("named", "density@all", p=0.5)
    cases = sweep.scored(records, truths, ROOT / "scenarios")
    assert {case.truth.name for case in cases} == set(shown)
    row = sweep.outcome_row({"kind": "defect"}, cases)
    assert (row["cases"], row["right"]) == (str(len(shown)), str(len(shown) - 2))
    assert (row["wrong"], row["wrong, P >= 0.99"]) == ("2", "1")
    found = sweep.tables(cases, truths)
    assert [row["cases"] for row in found["visibility"]] == [str(len(truths))]
    development = found["outcomes"]
    groups = {(row["half"], row["by"], row["group"]): row["cases"] for row in development}
    assert groups["development", "kind", "defect"] == str(len(shown))
    assert groups["development", "effect", "joint-rotation"] == str(len(shown))
    assert {half for half, _, _ in groups} == {"development"}
    everything = sweep.scored({**records, kept[0]: said("none")}, truths, ROOT / "scenarios")
    outcomes = sweep.tables(everything, truths)["outcomes"]
    assert [row for row in outcomes if row["half"] == "development"] == development
    (last,) = [row for row in outcomes if row["half"] == "held" and row["by"] == "kind"]
    assert (last["group"], last["cases"], last["right"], last["none"]) == ("defect", "1", "0", "1")
    text = " ".join(sweep.strict_table(everything).split())
    assert f"| one defect: named with its place, alone | {len(shown)} " in text
    assert "| 1 | 0.0 % | 0.0 to 79.3 % |" in text


def test_stated_probabilities_and_sizes(same: sweep.Same) -> None:
    heavy = replace(CLAMP, size=0.3, unit="kg")
    record = said("ambiguous", "added-mass@rung-middle@0.5", "density@all", p=0.6)
    sizes = [{"name": "mass", "value": 0.36, "std": 0.02, "unit": "kg"}]
    record["answer"]["causes"][0]["parameters"] = sizes
    defect = truth("defect", heavy)
    found = [(one.matter, one.right) for one in sweep.stated(defect, record, same)]
    assert found == [("name", True), ("place", True), ("name", False), ("place", False)]
    (size,) = sweep.size_errors(defect, record, same)
    assert size.deviations == pytest.approx(3.0)
    # At another place, or as another finding that counts, a size is not the true one.
    assert sweep.size_errors(truth("defect", replace(heavy, place="J1")), record, same) == ()
    also = replace(LOOSE, also=("added-mass@rung-middle@0.5",), size=0.3, unit="kg")
    assert sweep.size_errors(truth("defect", also), record, same) == ()
    assert sweep.size_errors(defect, {**record, "verdict": "unknown"}, same) == ()
    plain = {**said("named", "shear-deformation@all"), "textbook": ["shear-deformation"]}
    assert sweep.stated(truth("clean"), plain, same) == []
    assert not any(one.right for one in sweep.stated(truth("clean"), record, same))
    assert sweep.stated(truth("data-fault", SWAP), record, same) == []
    assert sweep.stated(defect, {"verdict": "too-long"}, same) == []


def test_a_fault_is_judged_by_the_faults_that_are_named(same: sweep.Same) -> None:
    """Whatever is said of the structure next to it, which is distinguished."""
    swapped = truth("data-fault", SWAP)

    def record(verdict: str, *sides: tuple[str, str]) -> dict[str, Any]:
        found = said(verdict, *(word for word, _ in sides))
        for cause, (_, side) in zip(found["answer"]["causes"], sides, strict=True):
            cause["side"] = side
        return found

    fault, other = ("sensors-swapped@sensor:7Z+5Z", "data"), ("sensor-sign@sensor:5Z", "data")
    cause = ("added-mass@J1", "model")
    cases = [
        ("right", "none", record("named", fault)),
        ("right", "a cause", record("ambiguous", fault, cause)),
        ("with others", "none", record("named", fault, other)),
        ("wrong", "none", record("named", other)),
        ("other place", "none", record("named", ("sensors-swapped@sensor:1Z+5Z", "data"))),
    ]
    for outcome, companions, found in cases:
        assert (sweep.outcome(swapped, found, same), sweep.describe_structure(found)) == (
            outcome,
            companions,
        )


@pytest.mark.slow(8)
def test_a_truth_of_beams_counts_in_the_groups_of_a_solid_drawing() -> None:
    """A soft foot is the zone of the clamp, water the member's mass, a node the nearest station."""
    suite = ROOT / "scenarios" / "suite"
    foot = TrueCause("a soft foot", "support-flexibility", "support:root")
    water = TrueCause("water", "member-mass", "thick")
    steel = TrueCause("another metal", "member-stiffness", "thick")
    clamp = TrueCause("a clamp", "added-mass", "thin@0.43", ("added-mass@thin@0.5",))
    for cause, right, wrong in (
        (foot, "member-stiffness@group:joint-root", "member-stiffness@group:thin"),
        (water, "group-mass@group:thick", "member-stiffness@group:thick"),
        (steel, "group-material@group:thick", "group-material@group:thin"),
        (clamp, "added-mass@thin@0.5", "added-mass@tip"),
    ):
        own = replace(truth("defect", cause), structure="stepped-strip")
        places, own = sweep.words_of(suite, own, "solid")
        assert sweep.outcome(own, said("named", right), places) == "right"
        assert sweep.outcome(own, said("named", wrong), places) != "right"
