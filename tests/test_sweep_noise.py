"""All strategies on all scenarios under measurement noise; the figures stand in docs/noise.md."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from femubench.core.library.cases import read_cases
from femubench.core.plugin.loader import load_plugins
from femubench.results import Run, leaderboard, run_jobs

sys.path.insert(0, str(Path(__file__).parent))
from printed_boards import TWO_STRUCTURES, assert_board_is_that_of

pytestmark = pytest.mark.sweep
SEEDS = tuple(range(1, 11))


@pytest.fixture(scope="module")
def noisy() -> Run:
    plugins = load_plugins()
    cases = read_cases(TWO_STRUCTURES, plugins)
    return run_jobs(cases, list(plugins.strategies.values()), seeds=SEEDS)


def test_the_board_in_the_docs(noisy: Run) -> None:
    assert_board_is_that_of(noisy, "docs/noise.md")


def test_only_kabe_fails_and_only_on_the_h_frame(noisy: Run) -> None:
    failed = [result for result in noisy.results if result.status != "ok"]
    assert {result.status for result in failed} == {"failed"}
    assert {result.strategy for result in failed} == {"kabe", "kabe-rigid"}
    assert all("hframe" in result.case for result in failed)
    assert all("measured" in result.reason for result in failed)


def test_with_noise_few_parameters_beat_many(noisy: Run) -> None:
    board = leaderboard(noisy).set_index("strategy")
    for few in ("bayesian", "local"):
        for many in ("baruch", "berman", "generic-ls", "physical"):
            assert board["skill_high"][few] < board["skill_low"][many]
    for kept in ("baruch", "berman", "physical", "generic-ls", "generic-adjusted", "diagnosed"):
        assert not board["unphysical"][kept]


def test_with_noise_who_finds_the_cause_stays_first(noisy: Run) -> None:
    board = leaderboard(noisy).set_index("strategy")
    others = board.drop("diagnosed")
    assert board["skill_high"]["diagnosed"] < others["skill_low"].min()
    assert board["skill_unseen"]["diagnosed"] < 0.5 * others["skill_unseen"].min()
