"""The committed suite: what every structure must hold, anyone who wrote it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pandas as pd
import pytest
from printed_boards import as_printed, assert_board_is_that_of, assert_same_errors, stored, text_of

import femubench
from femubench import Run, read_case
from femubench.core.score.leaderboard import leaderboard, list_rows
from femubench.core.score.scoring import reference_of
from femubench.reports.summary import finding, lead
from femubench.results import PredictiveBoard
from truths.published import write_garteur

ROOT = Path(__file__).parents[1]
SUITE = ROOT / "scenarios" / "suite"
LISTED = tomllib.loads((SUITE / "suite.toml").read_text(encoding="utf-8"))
NAMES = sorted(LISTED)
BOARD = {f"suite/{name}" for name in NAMES if "before the rule" in LISTED[name]["classes"]}
ROW = re.compile(
    r"^\| \d+ \| (used|held out) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", re.MULTILINE
)


def test_the_index_lists_the_folders() -> None:
    assert sorted(path.parent.name for path in SUITE.glob("*/case.toml")) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_structure_is_complete(name: str) -> None:
    """Modes, changes, picture, seed; both meshes agree to 0.7 % in every listed mode.

    The nominal model misses the used modes by 0.5 to 60 %; each of them has a partner.
    """
    case = read_case(SUITE / name)
    used, held = case.used, case.held_out
    assert 3 <= len(used) <= 12
    assert len(held) >= 3
    assert len(case.modifications) == 2
    text = (SUITE / name / "README.md").read_text(encoding="utf-8")
    modes = ROW.findall(text)
    assert [kind for kind, *_ in modes] == ["used"] * len(used) + ["held out"] * len(held)
    assert max(float(difference) for *_, difference, _ in modes) < 0.7
    assert re.search(r"\(seed \d+\)", text)
    assert "<svg" in (SUITE / name / "picture.svg").read_text(encoding="utf-8")
    block = reference_of(case).blocks["used"]
    assert 0.5 < block.rms_percent < 60.0
    assert all(pair.predicted_hz is not None for pair in block.modes)


def test_garteur_has_the_published_frequencies(tmp_path: Path) -> None:
    write_garteur(tmp_path / "garteur")
    stored = (ROOT / "scenarios" / "garteur" / "modes.csv").read_text(encoding="utf-8")
    assert (tmp_path / "garteur" / "modes.csv").read_text(encoding="utf-8") == stored


def test_the_board_of_all_structures_is_that_of_the_run_kept() -> None:
    run = stored("suite")
    assert set(run.meta["cases"]) == BOARD
    assert_board_is_that_of(run, "docs/scenarios.md")


def test_the_predictive_board_and_what_the_documents_say_of_it() -> None:
    run = stored("suite")
    text = (ROOT / "docs" / "scoring.md").read_text(encoding="utf-8")
    rows = re.findall(
        r"^(?:= )?(?:± )?([a-z…-]+) +(\S+) +(\S+) +(\S+) +(\S+) to (\S+) +(\S+) +(\S+) +(\S+)$",
        text.partition("predictive -->")[2].partition("<!--")[0],
        re.M,
    )
    board = {row["strategy"]: row for row in PredictiveBoard.of(run).rows}
    names = ("crps_percent", "coverage90", "skill")
    keys = [f"above_{key}" for key in (*names, "low", "high")] + [f"band_{key}" for key in names]
    for (name, *cells), own in zip(rows, board.values(), strict=True):
        assert own["strategy"].startswith(name.rstrip("…"))
        for key, cell in zip(keys, cells, strict=True):
            assert own[key] == as_printed(cell), (name, key)
    said = re.findall(r"`([a-z-]+)`,? (?:has )?(\d+) %", text.partition("- Above the band")[2])
    percent = {"diagnosed": 25, "bayesian": 37, "bayesian-sampling": 76}
    assert {name: int(number) for name, number in said} == percent
    for name, number in percent.items():
        assert 100.0 * board[name]["above_coverage90"] == as_printed(str(number))
    pattern = r"(\d+) % of the modes above the given band and (\d+) % .{30,80}, (\d+) % and (\d+) %"
    (shares,) = re.findall(pattern, text_of("docs/strategies.md"))
    owners = [board[name] for name in ("bayesian-sampling", "bayesian")]
    found = [100.0 * own[f"{band}_coverage90"] for own in owners for band in ("above", "band")]
    assert found == [as_printed(share) for share in shares]


def test_what_the_documents_say_of_the_board() -> None:
    """The headline of README and docs is that of the run, sentence by sentence."""
    for name in ("suite", "after"):
        run = stored(name)
        for page in ("README.md", "docs/scenarios.md"):
            words = text_of(page).replace("\u2212", "-")
            for sentence in finding(run, list_rows(run)):
                assert sentence.replace("\u2212", "-") in words, (page, sentence)
    rows = {row["strategy"]: row for row in list_rows(stored("after"))}
    said = re.search(
        r"`diagnosed` is second with a gain of (\S+) \((\S+) to (\S+)\), "
        r"`shifted`.{0,60} has (\S+):",
        text_of("README.md"),
    )
    own = rows["diagnosed"]
    figures = [own["gain"], own["gain_low"], own["gain_high"], rows["shifted"]["gain"]]
    assert said is not None
    assert [as_printed(text) for text in said.groups()] == figures
    assert own["rank"] == 2


def test_a_board_says_what_its_strategies_could_read_and_that_yardsticks_lead_nothing() -> None:
    run = stored("suite")
    assert "sandbox" not in lead(run)
    assert "without a sandbox" in lead(Run({**run.meta, "sandbox": "none"}, run.results))
    rows = list_rows(run)
    assert finding(run, [row for row in rows if row["yardstick"]]) == ["Only yardsticks ran."]
    lost = [{**row, "rank": 1, "answered": 0} for row in rows]
    assert finding(run, lost) == ["No strategy gave a possible model."]


def test_leave_one_out_and_varied_rules_are_those_of_the_run_kept() -> None:
    table = pd.read_csv(ROOT / "docs" / "data" / "board-rules.csv", index_col=0)
    board = leaderboard(stored("suite")).set_index("strategy")
    board = board[board["rank"].notna()]
    assert list(table.index) == list(board.index)
    assert table["place"].tolist() == board["rank"].tolist()
    assert table["gain"].to_numpy() == pytest.approx(board["gain"].to_numpy(), abs=1e-4)
    moves = (table["place"] - table["one_left_out_best"]).abs()
    moves = moves.combine((table["one_left_out_worst"] - table["place"]).abs(), max)
    means = pd.read_csv(ROOT / "docs" / "data" / "board-means.csv", index_col=0)
    rules = text_of("docs/scoring.md").split("rules -->")[1]
    said = re.findall(r"by (?:no )?more than (\d+)", rules)
    mean, median, *others = means["largest_move"]
    assert list(map(int, said)) == [moves.max(), 4, median, max(others)]
    assert (mean, set(means["first"])) == (moves.max(), {"diagnosed"})


def test_the_error_rates_of_the_family_are_those_that_are_kept() -> None:
    table = pd.read_csv(ROOT / "docs" / "data" / "board-families.csv")
    rates = table["error_rate"]
    assert len(table) == 2
    said = re.findall(r"in (\S+) to (\S+) % of the trials", text_of("docs/reports.md"))
    assert [as_printed(text) for text in said[0]] == [100.0 * rates.min(), 100.0 * rates.max()]


@pytest.mark.nightly
def test_the_run_kept_is_what_runs_today() -> None:
    assert_same_errors(stored("suite"), femubench.rank(sorted(BOARD), nominal="textbook", jobs=2))
