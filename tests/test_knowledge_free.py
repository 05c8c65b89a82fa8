"""No strategy without knowledge of the structure gains much more than the ratios carried on."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from printed_boards import as_printed, text_of

from benchmarks.knowledge_free import (
    CENTRES,
    MAKERS,
    Problem,
    mean_gain,
    problems_of,
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
    said = re.findall(
        r"`shifted` gains (\S+), moved by the whole ratio (\S+), `meet` (\S+), and models with "
        r"pickets (\S+) to (\S+), each less",
        text_of("docs/scoring.md"),
    )
    pickets = [gains[name] for name in CENTRES]
    figures = [gains["shifted"], gains["drift"], gains["meet"], max(pickets), min(pickets)]
    assert [as_printed(text) for text in said[0]] == figures
    # A share of the ratios is no knowledge, and the best one is not far from a half.
    shares = [
        mean_gain(problems(*SOME), searched(np.array([share, 0.0, 0.0])))["gain"]
        for share in (0.0, 0.5, 1.0)
    ]
    assert shares[1] == pytest.approx(gains["shifted"], abs=1e-9)
    assert max(shares) == shares[1]


@pytest.mark.nightly
def test_what_an_optimiser_finds_on_some_structures_is_no_better_on_others() -> None:
    found = mean_gain(problems(*SOME), search(problems(*OTHERS)))["gain"]
    assert found <= mean_gain(problems(*SOME), MAKERS["shifted"])["gain"] + 0.02
