"""The data of a run's page: the run's own figures, statistics, printed columns, safe in HTML."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scored
from synthetic_run import synthetic_run

from femubench.core.schema.results import Block
from femubench.core.score.leaderboard import leaderboard
from femubench.core.score.ranking import rank_results
from femubench.papers.printed import read_printed
from femubench.reports.htmls import HtmlReporter
from femubench.reports.page import data as page
from femubench.reports.page.data import page_data
from femubench.reports.page.document import SCRIPTS, STYLES, asset, embed_json
from femubench.reports.page.papers import papers_of
from femubench.reports.page.rounding import compact_json
from femubench.reports.runs import MarkdownReporter
from femubench.results import JobResult, PairedMode, Rule, RunData, run_to_json

SMALL = synthetic_run(6, 8, seeds=2)


def data_in(html: str) -> dict[str, Any]:
    """Return the data that a page holds."""
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    found: dict[str, Any] = json.loads(text)
    return found


class TestNumbers:
    def test_are_those_of_the_json(self) -> None:
        """Read from the page itself, to the last digit."""
        found, stored = data_in(HtmlReporter().render(SMALL)), run_to_json(SMALL)["results"]
        assert len(found["results"]) == len(stored)
        assert found["baseline"] == SMALL.meta["baseline"]
        for ours, theirs in zip(found["results"], stored, strict=True):
            assert found["cases"][ours["c"]]["name"] == theirs["case"]
            assert found["strategies"][ours["s"]]["name"] == theirs["strategy"]
            assert ours["seed"] == theirs["seed"]
            blocks = [theirs[name] for name in found["blocks"]]
            assert ours["rms"] == [block and block["rms_percent"] for block in blocks]
            assert ours["gain"] == pytest.approx(theirs["gain"], rel=1e-12)
            assert ours["status"] == theirs["status"]
            assert ours["unphysical"] == theirs["unphysical"]
            assert ours["seconds"] == pytest.approx(theirs["seconds"], rel=1e-3)
        references = {case["name"]: case["reference"] for case in found["cases"]}
        assert references == SMALL.meta["reference"]

    def test_board_is_the_leaderboard(self) -> None:
        board = page_data(SMALL)["board"]
        for row, ours in zip(leaderboard(SMALL).to_dict("records"), board, strict=True):
            for key, value in row.items():
                is_none = isinstance(value, float) and math.isnan(value)
                assert ours[key] == (None if is_none else value), key

    def test_starts_and_results_average_to_the_board(self) -> None:
        """What the page computes anew with a filter, from its own data."""
        found = page_data(SMALL)
        strategies = [item["name"] for item in found["strategies"]]
        for row in found["board"]:
            own = {(r["c"], r["seed"]): r["gain"] for r in found["results"]
                   if strategies[r["s"]] == row["strategy"]}  # fmt: skip
            gains = [
                np.mean([own.get((c, seed), case["start"]["gain"]) for seed in found["seeds"]])
                for c, case in enumerate(found["cases"])
            ]
            assert np.mean(gains) == pytest.approx(row["gain"], abs=1e-12)

    def test_a_page_keeps_to_its_size(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(page, "MOST_DETAILS", 20_000)
        found = page_data(SMALL)
        assert 0 < len(compact_json(found["details"])) <= 20_000
        assert any("to keep the page small" in note for note in found["notes"])
        ranks = {(r.case, r.strategy): r.rank for r in SMALL.results if r.seed == 1}
        kept = [tuple(map(int, key.split(":"))) for key in found["details"]]
        names = [(found["cases"][c]["name"], found["strategies"][s]["name"]) for c, s in kept]
        assert sorted(ranks[name] or 0 for name in names) == [ranks[name] for name in names]

    def test_exhibits_are_taken_by_digest_and_key(self) -> None:
        class Shelf:
            notes = ("one.json: a picture was left out",)

            def case(self, digest: str) -> dict[str, Any] | None:
                return {"digest": digest, "nodes": [[0.0, 0.0, 0.0]], "elements": []}

            def of(self, key: str) -> dict[str, Any] | None:
                modes = [{"shape": [0] * (1 if key == "k" else 2)}]
                return {"key": key, "odd": math.inf, "modes": modes}

        result = replace(SMALL.results[0], key="k", seed=1)
        run = RunData(SMALL.meta, (result,))
        found = data_in(HtmlReporter().render_with(run, Shelf()))
        case = found["cases"][0]
        assert case["stage"]["digest"] == SMALL.meta["cases"][case["name"]]["digest"]
        own = {"key": "k", "odd": None, "modes": [{"shape": [0]}]}
        assert found["details"]["0:0"]["exhibit"] == own
        assert "one.json: a picture was left out" in found["notes"]
        # The shape is on two nodes, the structure has one.
        run = RunData(SMALL.meta, (replace(result, key="other"),))
        found = data_in(HtmlReporter().render_with(run, Shelf()))
        assert found["details"]["0:0"]["exhibit"] is None


class TestPapers:
    def test_columns_are_those_of_the_transcribed_tables(self) -> None:
        frame, hframe = read_printed("frame"), read_printed("hframe")
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

    def test_stand_next_to_the_case_of_the_paper_alone(self) -> None:
        run = frame_run(1.0)
        assert papers_of(run)["frame"]["baruch"][4] == 911.3
        assert papers_of(frame_run(1.01)) == {}
        text = MarkdownReporter().render(run)
        assert "| baruch, as the paper prints it | 226.8 (+0.00) | 275.2" in text


def page_file(paper: str) -> dict[str, Any]:
    from femubench.reports.page.papers import _printed

    found: dict[str, Any] = _printed()[paper]
    return found


def frame_run(factor: float) -> RunData:
    """Return a run on the first paper's case, or on one whose frequencies are others."""
    hertz = [factor * f for f in (226.8, 275.2, 537.4, 861.5, 974.8)]
    modes = [PairedMode(n, f, 1.01 * f, 0.99) for n, f in enumerate(hertz, start=1)]
    blocks = {
        "used": Block(1.0, 0.99, tuple(modes[:3])),
        "higher": Block(1.0, 0.99, tuple(modes[3:])),
    }
    meta = {
        "seeds": [0],
        "rule": Rule().to_json(),
        "models": {"frame": {"drawn": scored.plain(blocks)}},
    }
    return RunData(meta, rank_results([JobResult("frame", "baruch", 0, "ok", blocks=blocks)], meta))


class TestDocument:
    def test_nothing_is_fetched_and_nothing_else_may_run(self) -> None:
        html = HtmlReporter().render(SMALL)
        assert "default-src 'none'" in html
        outside = re.sub(r"<script.*?</script>", "", html, flags=re.S)
        assert not re.search(r"(src|href)\s*=\s*[\"']?\s*(https?:)?//", outside)
        assert not re.search(r"@import|url\(\s*['\"]?(?!data:|#)", outside)
        assert html.count("<script") == 2

    def test_no_asset_ends_its_element(self) -> None:
        for name in (*SCRIPTS, *STYLES):
            assert not re.search(r"</(script|style)|<!--", asset(name), re.I), name

    def test_embedded_json_cannot_leave_its_element(self) -> None:
        evil = {"</script><script>alert(1)</script>": "<!-- & \u2028 \u2029 \ud800"}
        text = embed_json(evil)
        assert not set("<>&\u2028\u2029\ud800") & set(text)
        assert json.loads(text) == evil

    def test_a_run_of_nothing_has_a_page(self) -> None:
        assert data_in(HtmlReporter().render(RunData({}, ())))["results"] == []
