"""No strategy without knowledge of the structure gains much more than the ratios carried on."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pandas as pd
import pytest
from printed_boards import ROOT, as_printed, text_of

from benchmarks.knowledge_free import (
    CENTRES,
    MAKERS,
    MEMORY,
    Problem,
    mean_gain,
    problems_of,
    remember,
    search,
    searched,
)

SOME = ("bracket", "portal", "arch", "tapered-cantilever", "a-frame", "grid-tabs")
OTHERS = ("stepped-strip", "two-material-tee", "table-feet")


@cache
def problems(*names: str) -> list[Problem]:
    return problems_of([f"suite/{name}" for name in names])


@pytest.mark.slow(20)
def test_pickets_lose_against_their_centre_and_nothing_beats_shifted_by_much() -> None:
    gains = {name: mean_gain(problems(*SOME), make)["gain"] for name, make in MAKERS.items()}
    assert gains["textbook"] == 0.0
    assert gains["shifted"] > 0.05
    assert max(gains.values()) <= gains["shifted"] + 0.02
    for name, centre in CENTRES.items():
        assert gains[name] < gains[centre] - 0.05, name
    # A share of the ratios is no knowledge, and the best one is not far from a half.
    shares = [
        mean_gain(problems(*SOME), searched(np.array([share, 0.0, 0.0])))["gain"]
        for share in (0.0, 0.5, 1.0)
    ]
    assert shares[1] == pytest.approx(gains["shifted"], abs=1e-9)
    assert max(shares) == shares[1]


def test_the_table_of_whole_sets_says_the_same_as_the_page() -> None:
    table = pd.read_csv(ROOT / "docs" / "data" / "knowledge-free.csv")
    page = text_of("docs/scoring.md").partition("On the suite `shifted` gains")[2]
    numbers = iter(re.findall(r"-?\d\.\d{3}", page))
    for name in ("suite", "default set"):
        gains = table[table["set"] == name].set_index("strategy")["gain"]
        pickets = gains[list(CENTRES)]
        assert gains.max() <= gains["shifted"] + 0.02
        assert all(gains[name] < gains[centre] for name, centre in CENTRES.items())
        stated = [gains[k] for k in ("shifted", "drift", "meet", "search, on the other half")]
        for figure in (*stated, pickets.max(), pickets.min()):
            assert as_printed(next(numbers)) == figure


@pytest.mark.nightly
def test_what_an_optimiser_finds_on_some_structures_is_no_better_on_others() -> None:
    found = mean_gain(problems(*SOME), search(problems(*OTHERS)))["gain"]
    assert found <= mean_gain(problems(*SOME), MAKERS["shifted"])["gain"] + 0.02


def test_who_knows_the_truth_in_part_is_below_shifted_on_twins_and_marked() -> None:
    kept = pd.read_csv(MEMORY).query("strategy != 'meet'").set_index("strategy")
    stretched, every = (kept[kept["structures"] == count] for count in (52, 60))
    text = (ROOT / "docs/scoring.md").read_text(encoding="utf-8").split("**Memory on purpose.**")[1]
    rows = re.findall(r"^\| [^|]*(?:truths|ratios|shifted)[^|]* \| (.*) \|$", text, re.MULTILINE)
    for name, row in zip(stretched.index, rows, strict=True):
        *figures, marked = row.split(" | ")
        own = [board.loc[name, key] for board in (stretched, every) for key in ("cases", "twins")]
        assert [as_printed(figure) for figure in figures] == own
        for board in (stretched, every):
            assert marked.startswith("yes") == board.loc[name, "marked"] == (name != "shifted")
            assert name == "shifted" or board.loc[name, "twins"] < board.loc["shifted", "twins"]


@pytest.mark.nightly  # quicker of one strategy: tests/test_stretched_twins.py
def test_ratios_that_are_known_by_heart_are_no_gain_on_a_stretched_twin() -> None:
    found = remember(["suite/gable"]).set_index("strategy")
    for share in ("25", "50", "100"):
        assert found.loc[f"ratios-{share}", "cases"] > 0.05
        assert found.loc[f"ratios-{share}", "twins"] <= 0.0
    assert found.loc["shifted", "twins"] > 0.05
