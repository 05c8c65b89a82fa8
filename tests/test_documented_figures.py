"""The figures of README and docs that one run, one reproduction and a committed file give.

Figures of single pages stand in tests of their own: tables of docs/effects.md in test_effects_docs,
the tutorial's in test_tutorial, those of the papers in test_papers_*; docs/noise.md in
test_sweep_noise, docs/diagnosis-sweep.md in test_sweep_diagnosis.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import femubench
from femubench import Run
from femubench.core.cli.main import bench
from femubench.core.library.cases import read_cases
from femubench.core.plugin.loader import load_plugins
from femubench.reproduction import VERDICTS
from femubench.results import JobResult, leaderboard

sys.path.insert(0, str(Path(__file__).parent))
from printed_boards import (
    ROOT,
    assert_board_is_that_of,
    assert_same_errors,
    stored,
    text_of,
)

PAGES = ("README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))))
NUMBERS = {"eleven": 11, "twelve": 12, "twenty-five": 25}
QUICK = (
    *("unchanged", "textbook", "baruch", "berman", "global", "local", "bayesian", "physical"),
    *("eigensensitivity", "sparse", "diagnosed"),
)


@pytest.fixture(scope="module")
def run() -> Run:
    """Return the run of the default set that benchmarks/boards.py keeps."""
    return stored("default")


@pytest.fixture(scope="module")
def rows(run: Run) -> dict[str, dict[str, Any]]:
    return {row["strategy"]: row for row in leaderboard(run).to_dict("records")}


def result(run: Run, case: str, strategy: str) -> JobResult:
    (found,) = (r for r in run.ranked if (r.case, r.strategy) == (case, strategy))
    return found


def only(pattern: str, *pages: str) -> tuple[str, ...]:
    """Return the groups of what stands somewhere, and is the same wherever it stands."""
    found = {match.groups() for match in re.finditer(pattern, text_of(*(pages or PAGES)))}
    assert len(found) == 1, (pattern, found)
    return found.pop()


def test_the_leaderboard(run: Run) -> None:
    plugins = load_plugins()
    assert run.meta["strategies"] == list(plugins.strategies)
    assert list(run.meta["cases"]) == [case.name for case in read_cases((), plugins)]
    assert_board_is_that_of(run, "README.md")


def test_the_run_kept_is_what_runs_today(run: Run) -> None:
    """On the structures of the papers; all cases under the marker `sweep`."""
    found = femubench.rank(["frame", "hframe"], list(QUICK), jobs=2)
    assert_same_errors(run, found)


@pytest.mark.sweep
def test_all_of_the_run_kept_is_what_runs_today(run: Run) -> None:
    assert_same_errors(run, femubench.rank(jobs=2))


# PROSE


@pytest.mark.parametrize("page", ["docs/strategies-matrix.md", "docs/strategies-element.md"])
def test_numbers_of_unknowns(run: Run, page: str) -> None:
    """The last column of the first table: on the ladder of the first paper."""
    text = (ROOT / page).read_text(encoding="utf-8")
    table = text.partition("\n\n## ")[0]
    listed = re.findall(r"^\| `([a-z-]+)` \|.*\| (\d+) \|$", table, re.M)
    assert len(listed) == 5
    for strategy, count in listed:
        assert result(run, "frame", strategy).parameter_count == int(count)


def test_the_cells_of_the_papers(tmp_path: Path) -> None:
    """One sentence on the screen, in README and in docs; JSON counts the same."""
    file = tmp_path / "cells.json"
    answer = CliRunner().invoke(bench, ["reproduce", "--json", str(file)])
    assert answer.exit_code == 0
    headline = answer.output.partition("\n\n")[0]
    verdicts = [cell["verdict"] for cell in json.loads(file.read_text(encoding="utf-8"))]
    assert headline.startswith(f"{verdicts.count('independent')} of {len(verdicts)} printed cells")
    told = {int(number) for number in re.findall(r"\d+", headline)}
    assert told == {len(verdicts), *map(verdicts.count, VERDICTS)}
    for page in ("README.md", "docs/reproduce.md"):
        assert headline in text_of(page)
