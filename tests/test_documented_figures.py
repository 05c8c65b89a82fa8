"""The figures of README and docs that one run, one reproduction and a committed file give.

Figures of single pages stand in tests of their own: tables of docs/effects.md in test_effects_docs,
the tutorial's in test_tutorial, those of the papers in test_papers_*; docs/scoring.md in
test_sweep_noise, docs/diagnosis-accuracy.md in test_sweep_diagnosis.
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
from femubench.results import JobResult, leaderboard, tell_apart

pytestmark = pytest.mark.nightly
PAGES = ("README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))))
NUMBERS = {"eleven": 11, "twelve": 12, "seventeen": 17, "twenty-three": 23, "twenty-five": 25}


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
    assert run.meta["strategies"] == list(plugins.strategies)
    assert list(run.meta["cases"]) == [case.name for case in read_cases((), plugins)]
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
    assert NUMBERS[worse] == sum((item.score or 0.0) > 1.005 for item in met)


def test_what_the_readme_says_of_the_board(run: Run, rows: dict[str, dict[str, Any]]) -> None:
    text = text_of("README.md")
    best, second = list(rows)[:2]
    assert best == "diagnosed"
    for name, key, pattern in (
        (best, "gain", r"leads with (0\.\d+)"),
        (best, "gain_tests", r"two published tests \((0\.\d+)\)"),
        (best, "gain_low", r"interval reaches from (-0\.\d+) to"),
        (best, "gain_high", r"interval reaches from -0\.\d+ to (0\.\d+)"),
        ("berman", "gain", r"take away (0\.\d+) and 0\.\d+ of"),
        ("baruch", "gain", r"take away 0\.\d+ and (0\.\d+) of"),
        (best, "gain_drawn", r"`diagnosed` \((0\.\d+)\), which knows"),
        ("global", "gain_drawn", r"`global` \((0\.\d+)\), one factor"),
    ):
        (said,) = only(pattern, "README.md")
        assert rows[name][key] == as_printed(said), (name, key)
    own, rival = only(r"there its gain is (0\.\d+), the next one's (0\.\d+)")
    assert (rows[best]["gain"], rows[second]["gain"]) == (as_printed(own), as_printed(rival))
    assert "no strategy is shown to differ from it" in text
    assert set(tell_apart(run, list(rows)).tiers[0]) == set(rows)
    above = {name for name, row in rows.items() if row["gain_low"] > 1e-9}
    assert above == {"berman", "baruch"}
    data = {name: row for name, row in rows.items() if name not in ("unchanged", "textbook")}
    past = {name for name, row in data.items() if row["gain_drawn"] > 0.0}
    assert past == {"diagnosed", "global"}
    worse = [name for name, row in data.items() if row["gain"] < 0.0]
    said, of = only(r"(\S+) of the (\S+) leave it worse", "README.md")
    assert (NUMBERS[said], NUMBERS[of]) == (len(worse), len(data))


def test_the_stated_uncertainties(rows: dict[str, dict[str, Any]]) -> None:
    pattern = (
        r"unseen modes (\d+) % lie in the 90 % intervals of `bayesian-sampling`.{0,80}those of "
        r"`bayesian` and `diagnosed`, which do not, (\d+) % and (\d+) %"
    )
    said = only(pattern, "README.md")
    names = ("bayesian-sampling", "bayesian", "diagnosed")
    assert [as_printed(text) for text in said] == [100.0 * rows[n]["coverage90"] for n in names]


@pytest.mark.parametrize(("part", "count"), [("Matrix strategies", 6), ("Element strategies", 5)])
def test_numbers_of_unknowns(run: Run, part: str, count: int) -> None:
    """The last column of the first table of a family: on the ladder of the first paper."""
    text = (ROOT / "docs" / "strategies.md").read_text(encoding="utf-8")
    table = text.partition(f"\n## {part}\n")[2].partition("\n### ")[0]
    listed = re.findall(r"^\| `([a-z-]+)` \|.*\| (\d+) \|$", table, re.M)
    assert len(listed) == count
    for strategy, unknowns in listed:
        assert result(run, "frame", strategy).parameter_count == int(unknowns)
