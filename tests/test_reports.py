"""Reports on results that were put together by hand: what is in them and what cannot break them."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from dataclasses import replace

import pytest
import scored
from synthetic_run import synthetic_run

from femubench.core.library.report import render_report
from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.validation import check_reporter
from femubench.core.schema.results import Block
from femubench.core.score.leaderboard import leaderboard, list_rows
from femubench.core.score.scoring import frequency_error
from femubench.reports import femubench_reporters
from femubench.reports.csvs import CsvReporter
from femubench.reports.jsons import JsonReporter
from femubench.reports.markdown import escape
from femubench.reports.page.data import page_data
from femubench.reports.runs import MarkdownReporter, TerminalReporter
from femubench.reports.summary import finding, shortfalls
from femubench.results import JobResult, PairedMode, Rule, RunData


def mode(
    number: int, measured: float, predicted: float | None, change: str | None = None
) -> PairedMode:
    return PairedMode(number, measured, predicted, None if predicted is None else 0.9, change)


def block(*modes: PairedMode) -> Block:
    squares = [frequency_error(mode) ** 2 for mode in modes]
    return Block(100.0 * math.sqrt(sum(squares) / len(squares)), 0.9, modes)


def result(strategy: str, factor: float = 1.0, **changes: object) -> JobResult:
    """Return a result whose frequencies are all off by a factor, 10 % at 1."""
    error = 1.0 + 0.1 * factor
    blocks = {
        "used": block(mode(1, 100.0, 100.0 * error), mode(2, 200.0, 200.0 * error)),
        "higher": block(mode(3, 300.0, 300.0 * error)),
        "modified": block(
            mode(1, 80.0, 80.0 * error, "mass at 6"),
            mode(2, 160.0, None, "mass at 6"),
            mode(1, 90.0, 90.0 * error, "spring at 6"),
        ),
    }
    made = JobResult(
        case="beam",
        strategy=strategy,
        seed=0,
        status="ok",
        seconds=1.25,
        blocks=blocks,
        rigid_body_modes=3,
        rigid_body_modes_expected=3,
        negative_eigenvalues=0,
        parameter_count=4,
        evaluations=17,
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def run_of(*results: JobResult, **meta: object) -> RunData:
    cases = dict.fromkeys(result.case for result in results)
    full = {
        "run": "20260101T000000Z-abcdef",
        "seed": 0,
        "seeds": sorted({result.seed for result in results}),
        "strategies": list(dict.fromkeys(result.strategy for result in results)),
        "versions": {"python": "3.11.0", "femubench": "0.1.0"},
        "machine": {"platform": "Linux", "cpu_count": 2},
        "cases": {case: {"title": f"The {case}", "digest": "0"} for case in cases},
        "rule": Rule().to_json(),
        "models": {case: {"drawn": scored.plain(NOMINAL)} for case in cases},
        "reference": {case: {n: b.rms_percent for n, b in NOMINAL.items()} for case in cases},
        "citations": {"good": "A. Author 2001, (1)"},
    }
    return RunData({**full, **meta}, results)


NOMINAL = result("nominal").blocks
GOOD = result("good", 0.1)
WORSE = result("worse", 1.5)
IMAGINARY = result(
    "imaginary",
    0.05,
    negative_eigenvalues=2,
    rigid_body_modes=1,
    blocks={"used": block(mode(1, 100.0, -102.46), mode(2, 200.0, 200.0))},
)
FAILED = JobResult("beam", "broken", 0, "failed", "stiffness: measured 3e-2, allowed 1e-8")
SPARED = JobResult("beam", "picky", 0, "not-applicable", "the model has no joints")
RUN = run_of(WORSE, GOOD, IMAGINARY, FAILED, SPARED)


def cells(line: str) -> list[str]:
    """Return the cells of a Markdown row, escaped bars left alone."""
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def tables(text: str) -> list[list[list[str]]]:
    """Return all Markdown tables; every row of a table has as many cells as its header."""
    found: list[list[list[str]]] = [[]]
    for line in text.splitlines():
        if line.startswith("|"):
            found[-1].append(cells(line))
        elif found[-1]:
            found.append([])
    found = [table for table in found if table]
    for table in found:
        assert {len(row) for row in table} == {len(table[0])}
    return found


def with_header(text: str, *start: str) -> list[list[str]]:
    """Return the body of the table whose header starts with these cells."""
    (table,) = [t for t in tables(text) if tuple(t[0][: len(start)]) == start]
    return table[2:]


def test_builtin_reporters_fill_the_role() -> None:
    reporters = load_plugins().reporters
    names = ["terminal", "html", "markdown", "csv", "modes-csv", "json", "jsonl"]
    names += ["predictive", "parquet"]
    assert list(reporters)[: len(names)] == names
    for name in names:
        assert check_reporter(reporters[name]).name == name


@pytest.mark.parametrize("name", femubench_reporters())
def test_every_format_takes_an_empty_run(name: str) -> None:
    content = render_report(load_plugins().reporters[name], run_of(strategies=[]))
    # Libraries of a page may say what they like.
    assert isinstance(content, bytes) or "nan" not in content.partition("<script>")[0]


class TestTerminal:
    def test_table_is_ranked_and_shows_every_figure(self) -> None:
        text = TerminalReporter().render(RUN)
        rows = [line.split() for line in text.splitlines()[3:8]]
        assert [row[1] for row in rows] == ["good", "broken", "imaginary", "picky", "worse"]
        assert [row[0] for row in rows] == ["1", "*2", "!2", "*2", "5"]
        gain = 1.0 - math.log(1.01) / math.log(1.1)
        off = 100.0 * math.log(1.01)
        assert rows[0][2:9] == [f"{gain:.3f}", f"{off:.2f}", "100", f"{gain:.3f}", "1", "of", "1"]
        assert [row[6:9] for row in rows[1:4]] == [["0", "of", "1"]] * 3
        assert "some models lost rigid-body modes or have negative eigenvalues" in text

    def test_failures_are_said_and_counted(self) -> None:
        text = TerminalReporter().render(RUN)
        assert re.search(r"beam +broken +0 +failed +stiffness: measured 3e-2,", text)
        counted = "counted as the model that was given: picky: the model has no joints."
        assert counted in " ".join(text.split())
        many = [replace(FAILED, case=f"case{number}") for number in range(30)]
        assert "... and 10 more in the report" in TerminalReporter().render(run_of(*many))


class TestMarkdown:
    TEXT = MarkdownReporter().render(RUN)

    def test_names_cannot_break_it(self) -> None:
        evil = "a|b <script>*x*</script> [l](u) `c`\n| new"
        failed = replace(FAILED, case=evil, strategy=evil, reason=evil)
        other = result(evil, case=evil)
        text = MarkdownReporter().render(run_of(failed, other, citations={evil: evil}))
        assert tables(text)
        assert "<script>" not in text
        shown = r"a\|b &lt;script&gt;\*x\*&lt;/script&gt; \[l\](u) \`c\` \| new"
        assert escape(evil) == shown
        assert with_header(text, "case", "strategy", "seeds")[0][:2] == [shown, shown]


def test_gains_from_two_drawings_stand_next_to_each_other() -> None:
    """Over the cases that have both, each as on a board of its own."""
    on = (("beam", 0.1), ("beam:solid", 0.5), ("arch", 1.2))
    jobs = [result("good", factor, case=case) for case, factor in on]
    run = run_of(*jobs, structures={"beam:solid": "beam"})
    first, solid = (list_rows(run_of(job))[0] for job in jobs[:2])
    pairs = {key: [first[key], solid[key]] for key in ("gain", "error_percent")}
    assert pairs["gain"][0] > pairs["gain"][1] + 0.1
    (row,) = with_header(MarkdownReporter().render(run), "strategy", "gain first", "gain solid")
    digits = {"gain": 3, "error_percent": 2}
    assert row == ["good", *(f"{v:.{digits[key]}f}" for key, both in pairs.items() for v in both)]
    (strategy,) = page_data(run)["strategies"]
    assert {k: pytest.approx(v) for k, v in strategy["drawings"]["solid"].items()} == pairs
    alone = run_of(*jobs[:1], *jobs[2:])
    assert "gain first" not in MarkdownReporter().render(alone)
    assert page_data(alone)["strategies"][0]["drawings"] == {}


class TestCsv:
    def test_jobs(self) -> None:
        rows = list(csv.DictReader(io.StringIO(CsvReporter().render(RUN))))
        assert [row["strategy"] for row in rows] == [result.strategy for result in RUN.results]
        assert float(rows[1]["used_percent"]) == pytest.approx(1.0)
        assert rows[3]["reason"] == FAILED.reason

    @pytest.mark.parametrize("start", ["=", "+", "-", "@", "\t", "\r"])
    def test_no_cell_is_a_formula(self, start: str) -> None:
        reason = f'{start}HYPERLINK(1),"x"'
        text = CsvReporter().render(run_of(replace(FAILED, reason=reason, case=reason)))
        (row,) = csv.DictReader(io.StringIO(text, newline=""))
        assert row["reason"] == row["case"] == f"'{reason}"


class TestJson:
    def test_is_strict(self) -> None:
        def refuse(word: str) -> None:
            raise AssertionError(word)

        odd = replace(GOOD, diagnostics={"residual": math.nan, "bound": math.inf})
        text = JsonReporter().render(run_of(odd, timeout=math.inf))
        data = json.loads(text, parse_constant=refuse)
        assert data["results"][0]["diagnostics"] == {"residual": None, "bound": None}


def test_what_ranks_lack_is_said_of_every_run() -> None:
    here = result("here", provenance={"sandbox": "namespaces"})
    run = run_of(here, FAILED, strategies=["here", FAILED.strategy, "lost"], sandbox="none")
    assert shortfalls(run)[1:] == [
        "strategies ran without a sandbox and could read what they were not given",
        "1 of 3 jobs are missing and count as the model that was given: beam lost seed 0 drawn",
        f"1 of 2 jobs failed: {FAILED.strategy} on beam ({FAILED.status})",
    ]
    text = TerminalReporter().render(run)
    assert "^" not in next(line for line in text.splitlines() if " here " in line)
    assert "^" in next(line for line in text.splitlines() if f" {FAILED.strategy} " in line)


class TestFinding:
    """The sentences on what a run shows."""

    def stated(self, run: RunData) -> list[str]:
        return finding(run, list_rows(run))

    def test_how_far_off_in_percent_and_how_sure_that_is(self) -> None:
        run = synthetic_run(20, 12, failing=0.0)
        best = leaderboard(run).to_dict("records")[0]
        said = [sentence.replace("\u2212", "-") for sentence in self.stated(run)]
        assert said[0] == (
            f"Above the given band the nominal models are {best['textbook_percent']:.1f} % off, "
            f"the best strategy, {best['strategy']}, {best['error_percent']:.1f} %."
        )
        count = len(run.meta["cases"])
        better, worse = (f"{100 * best[key]:.0f} %" for key in ("better_share", "worse_share"))
        assert said[1] == (
            f"It is better than the nominal models on {better} of the {count} structures, worse by "
            f"more than a quarter on {worse}."
        )
        ends = f"{best['gain_low']:.3f} to {best['gain_high']:.3f}"
        assert said[2] == (
            f"Its gain is {best['gain']:.3f} (95 % interval {ends} over {count} structures)."
        )
        assert 5 < len(best["better_than"]) < 20
        below = [name for name in best["better_than"] if name != "unchanged"]
        assert said[3] == f"It is shown to be better than {len(below)} of 18 other strategies."
        assert said[4].startswith("Shown to be better than the models that were given: ")

    def test_a_yardstick_never_leads_and_stands_between_handbooks_and_the_best(self) -> None:
        line = {"good": "the given ratios carried on"}
        first, *_ = self.stated(run_of(GOOD, result("best", 0.5), yardsticks=line))
        assert (
            "9.5 % off, the given ratios carried on 1.0 %, the best strategy, best, 4.9 %" in first
        )

    def test_few_structures_or_no_model(self) -> None:
        alone = self.stated(run_of(GOOD))
        assert alone[1] == "That is better than the nominal models."
        assert "interval" not in " ".join(alone)
        assert self.stated(run_of(FAILED)) == ["No strategy gave a possible model."]
        assert self.stated(RunData({}, ())) == []


def test_notes_name_what_still_moves_and_what_does_not_apply() -> None:
    slow = replace(result("slow"), diagnostics={"converged": 0.0, "iterations": 100.0})
    done = replace(result("done"), diagnostics={"converged": 1.0})
    run = run_of(slow, done, SPARED)
    for text in (TerminalReporter().render(run), MarkdownReporter().render(run)):
        assert "Still moving at their last iteration (jobs): slow (1)." in text
    lines = " ".join(TerminalReporter().render(run).split())
    assert f"Not applicable, counted as the model that was given: picky: {SPARED.reason}." in lines
    assert "Still moving" not in TerminalReporter().render(run_of(done))
