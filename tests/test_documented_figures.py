"""The figures of README and docs that one run, one reproduction and a committed file give.

Figures of single pages stand in tests of their own: tables of docs/effects.md in test_effects_docs,
the tutorial's in test_tutorial, those of the papers in test_papers_*; docs/noise.md in
test_sweep_noise, docs/diagnosis-sweep.md in test_sweep_diagnosis.
"""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from femubench import Run
from femubench.core.cli.main import bench
from femubench.core.library.cases import read_cases
from femubench.core.plugin.loader import load_plugins
from femubench.reproduction import VERDICTS
from femubench.results import JobResult, leaderboard, run_jobs

sys.path.insert(0, str(Path(__file__).parent))
from printed_boards import (
    ROOT,
    TWO_STRUCTURES,
    as_printed,
    assert_board_is_that_of,
    text_of,
)

PAGES = ("README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))))
NUMBERS = {"eleven": 11, "twelve": 12, "seventeen": 17}


@pytest.fixture(scope="module")
def run() -> Run:
    plugins = load_plugins()
    return run_jobs(read_cases((), plugins), list(plugins.strategies.values()), jobs=2)


@pytest.fixture(scope="module")
def rows(run: Run) -> dict[str, dict[str, Any]]:
    return {row["strategy"]: row for row in leaderboard(run).to_dict("records")}


def result(run: Run, case: str, strategy: str) -> JobResult:
    (found,) = (r for r in run.results if (r.case, r.strategy) == (case, strategy))
    return found


def only(pattern: str, *pages: str) -> tuple[str, ...]:
    """Return the groups of what stands somewhere, and is the same wherever it stands."""
    found = {match.groups() for match in re.finditer(pattern, text_of(*(pages or PAGES)))}
    assert len(found) == 1, (pattern, found)
    return found.pop()


def test_the_leaderboard(run: Run) -> None:
    assert_board_is_that_of(run, "README.md")


@pytest.mark.parametrize(("case", "strategy"), [("hframe", "diagnosed"), ("frame", "baruch")])
def test_frequencies_of_the_higher_modes(run: Run, case: str, strategy: str) -> None:
    pattern = {
        "diagnosed": r"at (\d+) and (\d+) Hz \(measured (\d+) and (\d+)\)",
        "baruch": r"at (\d+) and (\d+) Hz, (?:where )?(?:measured )?(\d+) and (\d+)",
    }
    modes = result(run, case, strategy).blocks["higher"].modes[:2]
    found = [mode.predicted_hz for mode in modes] + [mode.measured_hz for mode in modes]
    assert [as_printed(text) for text in only(pattern[strategy], "README.md")] == found


def test_how_many_meet_what_they_were_given(run: Run) -> None:
    """On the ladder; one more on the two cases with the solid ladder's own shapes."""
    met = {
        case: sum(
            r.status == "ok" and r.blocks["used"].rms_percent < 0.1
            for r in run.results
            if r.case == case
        )
        for case in run.meta["cases"]
    }
    words = r"(\w+) of (?:the )?(seventeen).{0,80}?0\.1 %.{0,10}?`frame-solid` (\w+)\)"
    usual, of, solid = (NUMBERS[word] for word in only(words, "README.md"))
    assert of == len(run.meta["strategies"])
    ladders = [case for case in met if case.startswith("frame")]
    assert {met[case] for case in ladders if "solid" not in case} == {usual}
    assert {met[case] for case in ladders if "solid" in case} == {solid}


def test_what_few_parameters_leave(rows: dict[str, dict[str, Any]]) -> None:
    unseen = {name: row["skill_unseen"] for name, row in rows.items() if not row["unphysical"]}
    own, handbooks = unseen.pop("diagnosed"), unseen.pop("textbook")
    named = ("local", "global", "offset", "bayesian", "spring")
    few = [unseen[name] for name in named]
    least, most = only(r"leave (0\.\d\d) to (0\.\d\d) of the nominal model's error", "README.md")
    assert (min(few), max(few)) == (as_printed(least), as_printed(most))
    assert min(unseen["physical"], unseen["generic-ls"]) > 1.0
    first = sorted(unseen, key=lambda name: unseen[name])[: len(few) + 1]
    assert set(first) == {*named, "kabe-rigid"}
    assert "two fifths of the nominal model's error are left" in text_of("README.md")
    assert own == pytest.approx(0.4, abs=0.05)
    assert [name for name, value in unseen.items() if value < handbooks] == ["global"]


@pytest.mark.sweep
def test_the_variants_of_diagnosed() -> None:
    page = "docs/strategies-diagnosed.md"
    plugins = load_plugins()
    cases = read_cases(TWO_STRUCTURES, plugins)
    board = leaderboard(run_jobs(cases, list(plugins.strategies.values()), jobs=2))
    rows = {row["strategy"]: row for row in board.to_dict("records")}
    best, second = only(r"have (\d\.\d+) \(`berman`\) and (\d\.\d+) \(`local`\)", page)
    assert rows["berman"]["skill"] == as_printed(best)
    assert rows["local"]["skill_unseen"] == as_printed(second)
    skill, unseen = only(r"\(\*\*this\*\*\) \| (\d\.\d+) \| (\d\.\d+) \|", page)
    assert rows["diagnosed"]["skill"] == as_printed(skill)
    assert rows["diagnosed"]["skill_unseen"] == as_printed(unseen)


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


class TestTextbookStart:
    """What handbook values alone are worth: docs/figures/textbook-start.json, which
    `python benchmarks/textbook_start.py` writes."""

    PATTERNS = (
        r"textbook values alone, with nothing updated, score (\d\.\d+) on unseen data",
        r"`diagnosed` without (?:these|those) three effects scores (\d\.\d+)",
        r"`diagnosed` leads by (\d\.\d+) times",
    )

    def figures(self, boards: Any) -> tuple[float, float, float]:
        unseen = {
            start: {name: row["skill_unseen"] for name, row in rows.items()}
            for start, rows in boards.items()
        }
        own = unseen["textbook"].pop("diagnosed")
        return (
            unseen["textbook"]["unchanged"],
            unseen["without textbook effects"]["diagnosed"],
            min(unseen["textbook"].values()) / own,
        )

    def test_the_documents_say_what_the_file_says(self) -> None:
        stored = json.loads((ROOT / "docs" / "figures" / "textbook-start.json").read_text())
        for pattern, value in zip(self.PATTERNS, self.figures(stored), strict=True):
            assert value == as_printed(*only(pattern))

    @pytest.mark.sweep
    def test_the_file_is_what_the_script_gives(self) -> None:
        stored = json.loads((ROOT / "docs" / "figures" / "textbook-start.json").read_text())
        file = ROOT / "benchmarks" / "textbook_start.py"
        spec = importlib.util.spec_from_file_location("textbook_start", file)
        assert spec is not None
        assert spec.loader is not None
        script = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(script)
        found = script.figures()
        assert {start: set(rows) for start, rows in found.items()} == {
            start: set(rows) for start, rows in stored.items()
        }
        for start, rows in stored.items():
            for name, row in rows.items():
                assert found[start][name] == pytest.approx(row, rel=1e-3), (start, name)
