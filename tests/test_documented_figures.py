"""The figures of README and docs that one run, one reproduction and a committed file give.

Figures of single pages stand in tests of their own: tables of docs/effects.md in test_effects_docs,
the tutorial's in test_tutorial, those of the papers in test_papers_*; docs/scoring.md and
docs/scenarios.md in test_suite, docs/diagnosis-accuracy.md in test_sweep_diagnosis.
"""

from __future__ import annotations

import re
from typing import Any

import pytest
from printed_boards import (
    ROOT,
    as_printed,
    assert_board_is_that_of,
    assert_same_errors,
    stored,
    text_of,
)

import femubench
from femubench import Run
from femubench.core.library.cases import read_cases
from femubench.core.plugin.loader import load_plugins
from femubench.core.schema.results import Nominal
from femubench.core.score.leaderboard import leaderboard
from femubench.results import JobResult, PredictiveBoard

pytestmark = pytest.mark.nightly
PAGES = ("README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))))
NUMBERS = {
    **{"four": 4, "ten": 10, "fourteen": 14, "twenty-two": 22},
    **{"twenty-eight": 28, "thirty-two": 32},
}


@pytest.fixture(scope="module")
def run() -> Run:
    """Return the run of the default set that benchmarks/boards.py keeps."""
    return stored("default")


@pytest.fixture(scope="module")
def rows(run: Run) -> dict[str, dict[str, Any]]:
    return {row["strategy"]: row for row in leaderboard(run).to_dict("records")}


def result(run: Run, case: str, strategy: str, nominal: Nominal = "textbook") -> JobResult:
    chosen = run.started_from(nominal)
    (found,) = (r for r in chosen if (r.case, r.strategy) == (case, strategy))
    return found


def only(pattern: str, *pages: str) -> tuple[str, ...]:
    """Return the groups of what stands somewhere, and is the same wherever it stands."""
    found = {match.groups() for match in re.finditer(pattern, text_of(*(pages or PAGES)))}
    assert len(found) == 1, (pattern, found)
    return found.pop()


def test_the_leaderboard(run: Run) -> None:
    plugins = load_plugins()
    unasked = [
        name
        for name, s in plugins.strategies.items()
        if not (s.on_request or "responses" in s.needs)
    ]
    assert run.meta["strategies"] == unasked
    assert list(run.meta["cases"]) == [case.name for case in read_cases((), plugins)]
    assert_board_is_that_of(run, "docs/scenarios.md", "leaderboard-default")
    assert_board_is_that_of(run, "README.md")


def test_all_of_the_run_kept_is_what_runs_today(run: Run) -> None:
    assert_same_errors(run, femubench.rank(jobs=2))


@pytest.mark.parametrize(("case", "strategy"), [("hframe", "diagnosed"), ("frame", "baruch")])
def test_frequencies_of_the_higher_modes(run: Run, case: str, strategy: str) -> None:
    nominal: Nominal = "textbook" if strategy == "diagnosed" else "drawn"
    pattern = {
        "diagnosed": r"at (\d+) and (\d+) Hz \(measured (\d+) and (\d+)\)",
        "baruch": r"at (\d+) and (\d+) Hz, where (\d+) and (\d+) Hz were measured",
    }
    modes = result(run, case, strategy, nominal).blocks["higher"].modes[:2]
    found = [mode.predicted_hz for mode in modes] + [mode.measured_hz for mode in modes]
    assert [as_printed(text) for text in only(pattern[strategy], "README.md")] == found


def test_the_textbook_model_of_the_ladder(run: Run) -> None:
    modes = result(run, "frame", "textbook", "drawn").blocks["higher"].modes[:2]
    said = only(r"the textbook model has them at (\d+) and (\d+) Hz", "README.md")
    assert [as_printed(text) for text in said] == [mode.predicted_hz for mode in modes]


def test_how_many_meet_what_they_were_given(run: Run) -> None:
    met = [
        r
        for r in run.ranked
        if r.case == "frame" and r.status == "ok" and r.blocks["used"].rms_percent < 0.1
    ]
    often, of = only(r"(\S+) of the (\S+) strategies meet them within 0\.1 %", "README.md")
    assert (NUMBERS[often], NUMBERS[of]) == (len(met), len(run.meta["strategies"]))
    (worse,) = only(r"(\S+) of these predict the next two worse than the handbook", "README.md")
    assert NUMBERS[worse] == sum((item.gain or 0.0) < -0.005 for item in met)


def test_what_the_readme_says_of_the_board(rows: dict[str, dict[str, Any]]) -> None:
    best, line = next(iter(rows)), rows["shifted"]
    assert best == "diagnosed"
    data = {name: row for name, row in rows.items() if not row["yardstick"]}
    tests = {name: row["gain_tests"] for name, row in data.items()}
    first = max(tests, key=lambda name: tests[name])
    leads, other = only(r"`spring` leads with a gain of (\S+), where `diagnosed` has (\S+)\.")
    assert first == "spring"
    assert (tests["spring"], tests[best]) == (as_printed(leads), as_printed(other))
    of, above, below = only(
        r"Of the (\S+) strategies that use data, (\S+) gain more than the ratios carried on, and "
        r"(\S+) leave the textbook model worse"
    )
    assert NUMBERS[of] == len(data)
    assert NUMBERS[above] == sum(row["gain"] > line["gain"] for row in data.values())
    assert NUMBERS[below] == sum(row["gain"] < 0.0 for row in data.values())
    past = {name: row["gain_drawn"] for name, row in data.items() if row["gain_drawn"] > 0.0}
    (count,) = only(r"drawn (\S+) get past the textbook model", "README.md")
    assert NUMBERS[count] == len(past)
    for name, gain in past.items():
        (said,) = only(rf"`{name}` \((0\.\d+)\)", "README.md")
        assert gain == as_printed(said), name


def test_the_stated_uncertainties(run: Run) -> None:
    pattern = (
        r"above the given band (\d+) % lie in the 90 % intervals of `diagnosed` and (\d+) % in "
        r"those of `bayesian-sampling`,.{0,60} in those of `bayesian`, which does not, (\d+) %"
    )
    rows = {row["strategy"]: row for row in PredictiveBoard.of(run).rows}
    said = only(pattern, "README.md")
    names = ("diagnosed", "bayesian-sampling", "bayesian")
    found = [100.0 * rows[name]["above_coverage90"] for name in names]
    assert [as_printed(text) for text in said] == found


@pytest.mark.parametrize(("part", "count"), [("Matrix strategies", 6), ("Element strategies", 5)])
def test_numbers_of_unknowns(run: Run, part: str, count: int) -> None:
    """The last column of the first table of a family: on the ladder of the first paper."""
    text = (ROOT / "docs" / "strategies.md").read_text(encoding="utf-8")
    table = text.partition(f"\n## {part}\n")[2].partition("\n### ")[0]
    listed = re.findall(r"^\| `([a-z-]+)` \|.*\| (\d+) \|$", table, re.M)
    assert len(listed) == count
    for strategy, unknowns in listed:
        assert result(run, "frame", strategy).parameter_count == int(unknowns)
