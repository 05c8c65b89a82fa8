"""All strategies under measurement noise; the figures stand in docs/scoring.md."""

from __future__ import annotations

import pytest
from printed_boards import assert_board_is_that_of, assert_same_errors, stored

import femubench


def test_the_board_in_the_docs_is_that_of_the_run_kept() -> None:
    run = stored("noise")
    assert run.meta["seeds"] == [1, 2, 3]
    assert_board_is_that_of(run, "docs/scoring.md")


@pytest.mark.nightly
def test_the_run_kept_is_what_runs_today() -> None:
    kept = stored("noise")
    assert_same_errors(kept, femubench.rank(list(kept.meta["cases"]), seeds=3))
