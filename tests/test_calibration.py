"""Whether stated probabilities and deviations hold, and what is a fault of the search."""

from __future__ import annotations

import math
from typing import Any

import pytest
from blind_sweep import Record
from stated_probabilities import (
    Statement,
    binned,
    calibration_rows,
    coverage_rows,
    fault_rows,
    statements,
    wilson,
)
from true_fit import fits_worse, is_search_fault

from femubench.core.challenge.answer import Answer


def test_interval_of_a_proportion() -> None:
    assert wilson(0, 50) == pytest.approx((0.0, 0.0713), abs=1e-4)
    assert wilson(98, 100) == pytest.approx((0.9300, 0.9945), abs=1e-4)


def test_every_probability_is_in_one_bin() -> None:
    said = [Statement("name", i / 1000, i % 2 == 0) for i in range(1001)]
    said.append(Statement("place", 0.3, right=True))
    bins = binned(said, "name")
    assert [one.count for one in bins] == [500, 300, 150, 40, 11]
    assert sum(one.hits for one in bins) == 501
    assert bins[0].mean == pytest.approx(0.2495)
    assert [one.count for one in binned(said, "place")] == [1, 0, 0, 0, 0]
    assert math.isnan(binned(said, "place")[1].mean)
    rows = calibration_rows(said)
    assert rows[-1]["stated"] == "0.99 to 1"
    assert (rows[0]["places"], rows[0]["place right"]) == ("1", "100.0 %")
    assert (rows[1]["places"], rows[1]["place right"]) == ("0", "-")


def answer(verdict: str, *causes: dict[str, Any]) -> Answer:
    return Answer.model_validate({"verdict": verdict, "causes": causes})


def test_names_and_places_are_stated_apart() -> None:
    mass = {"effect": "added-mass", "place": "A", "probability": 0.9, "place_probability": 0.5}
    pair = {"effect": "added-mass + density", "place": "B + all", "probability": 0.1}
    fault = {"effect": "sensor-sign", "place": "sensor:1", "probability": 0.7, "side": "data"}

    def of(found: Answer) -> list[tuple[str, float, bool]]:
        known = {"added-mass", "density"}
        said = statements(found, known.__contains__, lambda effect, place: place in ("B", "all"))
        return [(one.matter, one.probability, one.right) for one in said]

    assert of(answer("ambiguous", mass, pair)) == [
        ("name", 0.9, True),
        ("place", 0.45, False),
        ("name", 0.1, True),
        ("place", 0.1, True),
    ]
    # A best guess is no statement; a fault that is named next to it is.
    assert of(answer("unknown", mass, fault)) == [("name", 0.7, False), ("place", 0.7, False)]
    assert of(answer("not-confirmed", mass)) == of(answer("none")) == []


def test_coverage_of_deviations() -> None:
    first, last = coverage_rows({"one": [0.0, 1.9, -2.1, 3.0], "two": []})
    assert (first["kind"], last["kind"]) == ("one", "all")
    assert (first["sizes"], first["within 2 deviations"]) == ("4", "50.0 %")
    assert first["root mean square"] == f"{math.sqrt((1.9**2 + 2.1**2 + 9.0) / 4):.2f}"
    assert coverage_rows({"one": []}) == []


def fits(leader: tuple[float, int, float], truth: tuple[float, int, float]) -> Record:
    names = ("chi2", "unknowns", "log_weight")
    return {
        "leader_fit": dict(zip(names, leader, strict=True)),
        "true_fit": dict(zip(names, truth, strict=True)),
    }


@pytest.mark.parametrize(
    ("record", "worse", "fault"),
    [
        (fits((50.0, 2, -40.0), (40.0, 2, -35.0)), True, True),
        (fits((50.0, 2, -40.0), (40.0, 2, -45.0)), True, False),  # prior and evidence chose
        (fits((50.0, 1, -40.0), (40.0, 2, -35.0)), False, False),  # fewer unknowns
        (fits((40.9, 2, -40.0), (40.0, 2, -35.0)), False, False),
        ({}, None, None),
    ],
)
def test_faults_of_search(record: Record, worse: bool | None, fault: bool | None) -> None:
    assert (fits_worse(record), is_search_fault(record)) == (worse, fault)


def test_faults_of_search_are_counted_by_kind() -> None:
    rows = fault_rows({"one": [(True, True), (True, False)], "two": [], "pair": [(False, False)]})
    assert [(row["kind"], row["answer fits worse"], row["faults of search"]) for row in rows] == [
        ("one", "2", "1"),
        ("pair", "0", "0"),
        ("all", "2", "1"),
    ]
