"""The data of a run's page: the run's own figures, statistics, printed columns, safe in HTML."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import wilcoxon

from femubench.papers.printed import printed
from femubench.reports.htmls import HtmlReporter
from femubench.reports.markdown import MarkdownReporter
from femubench.reports.page import data as page
from femubench.reports.page.data import page_data
from femubench.reports.page.document import SCRIPTS, STYLES, asset, embedded_json
from femubench.reports.page.papers import papers_of
from femubench.reports.page.rounding import plain_data, rounded
from femubench.reports.page.statistics import Statistics, scores_of, statistics
from femubench.results import (
    Block,
    JobResult,
    PairedMode,
    Run,
    leaderboard,
    rank_results,
    run_to_json,
)

sys.path.insert(0, str(Path(__file__).parent / "toys"))

from synthetic_run import synthetic_run

ASSETS = Path(__file__).parents[1] / "reports" / "page" / "assets"
SMALL = synthetic_run(6, 8, seeds=2)


def data_in(html: str) -> dict[str, Any]:
    """Return the data that a page holds."""
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    found: dict[str, Any] = json.loads(text)
    return found


def outcome_of(run: Run) -> Statistics:
    return statistics(run, leaderboard(run))


def scored(table: Mapping[str, list[float]]) -> Run:
    """Return a run with the given scores, a case a column."""
    results = [
        JobResult(f"case-{n}", name, 0, "ok", score=score)
        for name, scores in table.items()
        for n, score in enumerate(scores)
    ]
    return Run({"strategies": list(table), "seeds": [0]}, rank_results(results))


class TestNumbers:
    def test_are_those_of_the_json(self) -> None:
        """Read from the page itself, to the last digit."""
        found, stored = data_in(HtmlReporter().render(SMALL)), run_to_json(SMALL)["results"]
        assert len(found["results"]) == len(stored)
        for ours, theirs in zip(found["results"], stored, strict=True):
            assert found["cases"][ours["c"]]["name"] == theirs["case"]
            assert found["strategies"][ours["s"]]["name"] == theirs["strategy"]
            assert ours["seed"] == theirs["seed"]
            blocks = [theirs[name] for name in found["blocks"]]
            assert ours["rms"] == [block and block["rms_percent"] for block in blocks]
            assert ours["score"] == theirs["score"]
            assert ours["status"] == theirs["status"]
            assert ours["unphysical"] == theirs["unphysical"]
            assert ours["seconds"] == pytest.approx(theirs["seconds"], rel=1e-3)
        references = {case["name"]: case["reference"] for case in found["cases"]}
        assert references == SMALL.meta["reference"]

    def test_board_is_the_leaderboard(self) -> None:
        board = page_data(SMALL)["board"]
        for row, ours in zip(leaderboard(SMALL).to_dict("records"), board, strict=True):
            assert {k: None if v is None else pytest.approx(v, abs=0) for k, v in ours.items()} == {
                k: None if isinstance(v, float) and math.isnan(v) else v for k, v in row.items()
            }

    def test_modes_of_the_first_seed(self) -> None:
        found = data_in(HtmlReporter().render(SMALL))
        first = {(r.case, r.strategy): r for r in SMALL.results if r.seed == 1}
        assert found["details"]
        for key, detail in found["details"].items():
            c, s = map(int, key.split(":"))
            result = first[found["cases"][c]["name"], found["strategies"][s]["name"]]
            modes = [mode for block in result.blocks.values() for mode in block.modes]
            assert [mode["mode"] for mode in detail["modes"]] == [mode.number for mode in modes]
            assert [mode["predicted_hz"] for mode in detail["modes"]] == pytest.approx(
                [mode.predicted_hz for mode in modes], rel=1e-6
            )
            assert len(detail["parameters"]) == len(result.parameters)
            assert len(detail["history"]) == len(result.history)

    def test_rounding(self) -> None:
        assert [rounded(x, 4) for x in (1234.56, 0.000123456, 5, None, math.nan, "x", True)] == [
            *(1235, 0.0001235, 5, None, None, None, None)
        ]
        assert plain_data({"a": [math.inf, np.float64(2.0)]}) == {"a": [None, 2.0]}
        deep: Any = []
        for _ in range(20):
            deep = [deep]
        assert json.dumps(plain_data(deep)).count("[") == 8

    def test_a_page_keeps_to_its_size(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(page, "MOST_DETAILS", 20_000)
        found = page_data(SMALL)
        assert 0 < len(json.dumps(found["details"])) <= 20_000
        assert any("to keep the page small" in note for note in found["notes"])
        ranks = {(r.case, r.strategy): r.rank for r in SMALL.results if r.seed == 1}
        kept = [tuple(map(int, key.split(":"))) for key in found["details"]]
        names = [(found["cases"][c]["name"], found["strategies"][s]["name"]) for c, s in kept]
        assert sorted(ranks[name] or 0 for name in names) == [ranks[name] for name in names]

    def test_exhibits_are_taken_by_digest_and_key(self) -> None:
        class Shelf:
            notes = ("one.json: a picture was left out",)

            def stage(self, digest: str) -> dict[str, Any] | None:
                return {"digest": digest, "nodes": [1], "elements": []}

            def of(self, key: str) -> dict[str, Any] | None:
                modes = [{"shape": [0] * (1 if key == "k" else 2)}]
                return {"key": key, "odd": math.inf, "modes": modes}

        result = replace(SMALL.results[0], key="k", seed=1)
        run = Run(SMALL.meta, (result,))
        found = data_in(HtmlReporter().render_with(run, Shelf()))
        case = found["cases"][0]
        assert case["stage"]["digest"] == SMALL.meta["cases"][case["name"]]["digest"]
        own = {"key": "k", "odd": None, "modes": [{"shape": [0]}]}
        assert found["details"]["0:0"]["exhibit"] == own
        assert "one.json: a picture was left out" in found["notes"]
        # The shape is on two nodes, the structure has one.
        run = Run(SMALL.meta, (replace(result, key="other"),))
        found = data_in(HtmlReporter().render_with(run, Shelf()))
        assert found["details"]["0:0"]["exhibit"] is None


class TestStatistics:
    def test_letters_say_who_cannot_be_told_apart(self) -> None:
        run = synthetic_run(12, 40)
        found = outcome_of(run)
        letters = found.letters()
        assert len(found.pairs) == 12 * 11 / 2
        for i, j, p in found.pairs:
            shared = set(letters[i].split()) & set(letters[j].split())
            assert bool(shared) == (p >= 0.05)

    def test_holm_by_hand(self) -> None:
        run = synthetic_run(4, 12, failing=0.0)
        table = scores_of(run)
        pairs = [(i, j) for i in range(4) for j in range(i + 1, 4)]
        raw = [
            float(wilcoxon(np.log(table[:, i] / table[:, j]), method="exact").pvalue)
            for i, j in pairs
        ]
        order = np.argsort(raw)
        holm, most = {}, 0.0
        for place, index in enumerate(order):
            most = max(most, min(1.0, (len(raw) - place) * raw[index]))
            holm[pairs[index]] = most
        assert {(i, j): p for i, j, p in outcome_of(run).pairs} == pytest.approx(holm)

    def test_few_strategies_or_cases_are_not_tested(self) -> None:
        for run in (synthetic_run(2, 12), scored({name: [1.0] * 4 for name in "abc"})):
            found = outcome_of(run)
            assert found.friedman is None
            assert found.pairs == found.groups == ()
            assert "not tested" in found.note

    def test_strategies_that_score_the_same_are_one_group(self) -> None:
        found = outcome_of(scored({name: [1.0, 0.5, 0.2, 2.0, 1.0] for name in "abcd"}))
        assert found.friedman is None
        assert found.groups == ((0, 1, 2, 3),)
        assert "same on every case" in found.note

    def test_no_difference_at_all_is_one_group(self) -> None:
        random = np.random.default_rng(1)
        found = outcome_of(scored({name: list(random.uniform(0.9, 1.1, 12)) for name in "abcd"}))
        assert found.friedman is not None
        assert found.friedman.p > 0.05
        assert [sorted(group) for group in found.groups] == [[0, 1, 2, 3]]
        assert found.pairs == ()

    def test_too_few_cases_to_tell_any_pair_apart_are_told(self) -> None:
        steps = {name: [0.1 * 2**n] * 6 for n, name in enumerate("abcdef")}
        found = outcome_of(scored(steps))
        assert len(found.groups) == 1
        assert "however large the difference" in found.note

    def test_a_missing_result_scores_as_a_failure(self) -> None:
        whole = synthetic_run(4, 8, failing=0.0)
        gone = [result for result in whole.results if result.strategy != "strategy-000"]
        assert np.all(scores_of(Run(whole.meta, tuple(gone)))[:, 0] == 10.0)

    def test_many_overlapping_groups_become_stretches(self) -> None:
        run = synthetic_run(120, 30)
        found = outcome_of(run)
        order = {name: place for place, name in enumerate(leaderboard(run)["strategy"])}
        names = run.meta["strategies"]
        places = [[order[names[index]] for index in group] for group in found.groups]
        assert all(group == list(range(group[0], group[-1] + 1)) for group in places)
        assert {index for group in found.groups for index in group} == set(range(120))
        assert "neighbours in the ranking" in found.note

    def test_markdown_has_groups_coverage_and_the_test(self) -> None:
        text = MarkdownReporter().render(SMALL)
        assert "| ok | group |" in text
        assert "Friedman's test on 9 cases and 6 strategies" in text


class TestPapers:
    def test_columns_are_those_of_the_transcribed_tables(self) -> None:
        frame, hframe = printed("frame"), printed("hframe")
        assert frame["table1"]["measured"] == page_file("frame")["measured"]
        assert hframe["table1"]["frequency"][:5] == page_file("hframe")["measured"]
        theirs = {
            "unchanged": frame["table1"]["fe"],
            "baruch": frame["table2"]["baruch"]["modes"],
            "kabe": frame["table2"]["nonzeros"]["modes"],
            "kabe-rigid": frame["table2"]["nonzeros_rigid"]["modes"],
            "physical": frame["table3"]["physical"]["modes"],
            "nobari": frame["table3"]["nobari"]["modes"],
            "generic-ls": frame["table4"]["generic_ls"]["modes"],
            "generic-adjusted": frame["table4"]["generic_adjusted"]["modes"],
        }
        assert page_file("frame")["strategies"] == theirs
        rows = hframe["table4"]
        assert page_file("hframe")["strategies"] == {
            "unchanged": rows["a_global_prototype"]["initial"],
            "global": rows["a_global_prototype"]["updated"],
            "local": rows["b_local_prototype"]["updated"],
            "spring": rows["d_spring"]["updated"],
            "offset": rows["e_offset"]["updated"],
        }

    def test_stand_beside_the_case_of_the_paper_alone(self) -> None:
        run = frame_run(1.0)
        assert papers_of(run)["frame"]["baruch"][4] == 911.3
        assert papers_of(frame_run(1.01)) == {}
        text = MarkdownReporter().render(run)
        assert "| *baruch, as the paper prints it* | 226.8 (+0.00) | 275.2" in text


def page_file(paper: str) -> dict[str, Any]:
    from femubench.reports.page.papers import _printed

    found: dict[str, Any] = _printed()[paper]
    return found


def frame_run(factor: float) -> Run:
    """Return a run on the first paper's case, or on one whose frequencies are others."""
    hertz = [factor * f for f in (226.8, 275.2, 537.4, 861.5, 974.8)]
    modes = [PairedMode(n, f, 1.01 * f, 0.99) for n, f in enumerate(hertz, start=1)]
    blocks = {
        "used": Block(1.0, 0.99, tuple(modes[:3])),
        "higher": Block(1.0, 0.99, tuple(modes[3:])),
    }
    return Run({"seeds": [0]}, (JobResult("frame", "baruch", 0, "ok", blocks=blocks),))


class TestDocument:
    def test_nothing_is_fetched_and_nothing_else_may_run(self) -> None:
        html = HtmlReporter().render(SMALL)
        assert "default-src 'none'" in html
        outside = re.sub(r"<script.*?</script>", "", html, flags=re.S)
        assert not re.search(r"(src|href)\s*=\s*[\"']?\s*(https?:)?//", outside)
        assert not re.search(r"@import|url\(\s*['\"]?(?!data:|#)", outside)
        assert html.count("<script") == 2

    def test_every_asset_of_the_run_page_is_in_it(self) -> None:
        others = ("compare", "diagnosis", "site", "publish", "history")
        own = [p.name for p in ASSETS.iterdir() if not p.name.startswith(others)]
        assert sorted(own) == sorted([*SCRIPTS, *STYLES, "run.html"])

    def test_no_asset_ends_its_element(self) -> None:
        for name in (*SCRIPTS, *STYLES):
            assert not re.search(r"</(script|style)|<!--", asset(name), re.I), name

    def test_embedded_json_cannot_leave_its_element(self) -> None:
        evil = {"</script><script>alert(1)</script>": "<!-- & \u2028 \u2029 \ud800"}
        text = embedded_json(evil)
        assert not set("<>&\u2028\u2029\ud800") & set(text)
        assert json.loads(text) == evil

    def test_a_run_of_nothing_has_a_page(self) -> None:
        assert data_in(HtmlReporter().render(Run({}, ())))["results"] == []
