"""`bench compare`: ratios, evidence, thresholds, exit codes, and what a name cannot do."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import harness_toys as toys
import numpy as np
import pytest
from click.testing import Result
from run_edits import called, failed, moved, renamed, scaled
from running import run_jobs

from femubench.core.errors import InputError
from femubench.core.schema.records import run_from_json, run_to_json
from femubench.core.score.comparison import METRICS, Against, Threshold, compare_runs
from femubench.core.score.ranking import rank_results
from femubench.core.score.statistics import weigh_evidence
from femubench.reports.compare_page import comparison_html, comparison_markdown, comparison_text
from tests.command import call_bench

Data = dict[str, Any]
HOSTILE = "<script>alert(1)</script>\x1b[2J|`x`"


@pytest.fixture(scope="module")
def data() -> Data:
    cases = [toys.tiny_case(), toys.tiny_case("other/corner", 80.0e9)]
    run = run_jobs(cases, [toys.Unchanged(), toys.Softer()], jobs=2)
    made: Data = json.loads(json.dumps(run_to_json(run)))
    assert {result["status"] for result in made["results"]} == {"ok"}
    return made


def compared(a: Data, b: Data, **options: Any) -> Data:
    return json.loads(  # type: ignore[no-any-return]
        json.dumps(compare_runs(run_from_json(a), run_from_json(b), **options).to_json())
    )


def row(found: Data, strategy: str, scenario: str | None = None) -> Data:
    rows = [r for r in found["rows"] if (r["strategy"], r["scenario"]) == (strategy, scenario)]
    assert len(rows) == 1
    return dict(rows[0]["values"])


def called_with(tmp_path: Path, a: Data, b: Data, *options: str) -> Result:
    for name, run in (("a.json", a), ("b.json", b)):
        (tmp_path / name).write_text(json.dumps(run))
    files = [str(tmp_path / "a.json"), str(tmp_path / "b.json")]
    return call_bench("compare", *files, *options, code=None)


def test_a_run_is_no_worse_than_itself(data: Data, tmp_path: Path) -> None:
    found = compared(data, data)
    assert not found["worse"]
    assert found["jobs"] == 4
    for strategy in ("unchanged", "softer"):
        values = row(found, strategy)
        assert [values[name] for name in METRICS] == [0.0] + [1.0] * 4 + [0.0]
    assert {item["verdict"] for item in found["evidence"]} == {"same"}
    answer = called_with(tmp_path, data, data)
    assert answer.exit_code == 0
    assert "B is not worse than A" in " ".join(answer.output.split())
    assert "nothing differs" in answer.output


def test_ratios_by_block_and_scenario_are_those_of_the_errors(data: Data) -> None:
    worse = scaled(data, "softer", 1.5)
    found = compared(data, worse)
    for scenario, case in (("corner", "corner"), ("other", "other/corner")):
        old = next(r for r in data["results"] if (r["strategy"], r["case"]) == ("softer", case))
        values = row(found, "softer", scenario)
        for block in ("used", "higher", "modified"):
            rms = old[block]["rms_percent"]
            ratio = (1.5 * rms + 0.05) / (rms + 0.05)
            assert values[block] == pytest.approx(ratio, rel=1e-12)
        after = next(
            r
            for r in rank_results(run_from_json(worse).results, worse["meta"])
            if (r.strategy, r.case) == ("softer", case)
        )
        assert values["loss"] == pytest.approx(old["gain"] - after.gain, rel=1e-12)
        assert values["loss"] > 0.02
    assert row(found, "unchanged")["loss"] == 0.0
    assert found["worse"]
    assert {item["strategy"] for item in found["excesses"]} == {"softer"}
    assert {item["scenario"] for item in found["excesses"]} == {None, "corner", "other"}


def test_evidence_needs_six_structures_that_differ() -> None:
    few, many = [-0.1] * 5, [-0.1, -0.2, -0.3, -0.05, -0.15, -0.4, -0.01, -0.2]
    found = {item.strategy: item for item in weigh_evidence({"few": few, "many": many})}
    assert (found["few"].verdict, found["few"].p, found["few"].low) == (
        "too few structures",
        None,
        None,
    )
    assert found["many"].verdict == "worse"
    assert found["many"].p == pytest.approx(2 / 2**8)
    low, high, change = found["many"].low, found["many"].high, found["many"].difference
    assert low is not None
    assert high is not None
    assert change is not None
    assert low < change < high < 0.0
    better = weigh_evidence({"many": np.negative(many), "mixed": [0.5, -0.5] * 4, "none": []})
    assert [item.verdict for item in better] == [
        "better",
        "no difference shown",
        "too few structures",
    ]
    # What two machines round differently is no difference.
    assert weigh_evidence({"a": [1e-9 * k for k in range(1, 20)]})[0].verdict == "same"


def test_neither_seeds_nor_cases_of_one_structure_count_as_structures(data: Data) -> None:
    """Draws of the noise on one structure say nothing about other structures."""
    before, after = data, scaled(data, "softer", 1.5)
    several = [json.loads(json.dumps(run)) for run in (before, after)]
    for run in several:
        run["results"] = [{**r, "seed": seed} for r in run["results"] for seed in (1, 2, 3)]

    def evidence(*runs: Data) -> Data:
        (found,) = compared(*runs, strategies=["softer"])["evidence"]
        return dict(found)

    assert before["meta"]["structures"] == {"corner": "corner", "other/corner": "other/corner"}
    assert evidence(before, after)["structures"] == evidence(*several)["structures"] == 2
    for run in several:
        run["meta"]["structures"]["other/corner"] = "corner"
    found = evidence(*several)
    assert (found["structures"], found["verdict"]) == (1, "too few structures")
    loss = row(compared(*several), "softer")["loss"]
    assert found["difference"] == pytest.approx(-loss, rel=1e-12)


VARIANT = "softer:factor=0.5"


def test_two_variants_of_a_strategy_are_compared(data: Data, tmp_path: Path) -> None:
    varied = renamed(scaled(data, "softer", 1.5), "softer", VARIANT)
    found = compared(data, varied)
    assert found["against"] == [{"before": "softer", "after": VARIANT}]
    assert found["only_before"] == found["only_after"] == []
    same = compared(data, scaled(data, "softer", 1.5))
    assert row(found, VARIANT) == row(same, "softer")
    assert row(found, "unchanged")["loss"] == 0.0
    ours, theirs = ({e["strategy"]: e for e in f["evidence"]} for f in (found, same))
    assert ours[VARIANT] == {**theirs["softer"], "strategy": VARIANT}
    for form in ("terminal", "markdown", "html"):
        answer = called_with(tmp_path, data, varied, "-f", form)
        assert answer.exit_code == 1
        text = answer.output.replace("\\", "")
        assert "(softer)" in text
        assert f"({VARIANT})" in " ".join(text.split())
    assert called_with(tmp_path, varied, data).exit_code == 0
    assert called_with(tmp_path, data, varied, "-s", "softer").exit_code == 1
    assert called_with(tmp_path, data, varied, "-s", "unchanged").exit_code == 0


def test_unlike_strategies_are_not_compared_unasked(data: Data) -> None:
    found = compared(data, renamed(data, "softer", "harder"))
    assert found["against"] == []
    assert {job["strategy"] for job in found["only_before"]} == {"softer"}
    assert {job["strategy"] for job in found["only_after"]} == {"harder"}
    two = renamed(data, "unchanged", "softer:factor=2.0")
    two = renamed(two, "softer", VARIANT)
    with pytest.raises(InputError, match="no job in common"):
        compared(data, two)
    # Where each run has one strategy there is no doubt about what is asked.
    for run in (alone := [renamed(data, "softer", name) for name in ("softer", "harder")]):
        run["results"] = [r for r in run["results"] if r["strategy"] != "unchanged"]
    assert compared(*alone)["against"] == [{"before": "softer", "after": "harder"}]


def test_two_strategies_of_one_run(data: Data, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(data))

    def called_by(*words: str) -> Result:
        return call_bench("compare", path, *words, code=None)

    run = run_from_json(data)
    found = compare_runs(run, run, against=Against("unchanged", "softer"))
    assert (found.jobs, found.worse) == (2, False)
    assert {row.strategy for row in found.rows} == {"softer"}
    for block in ("used", "higher", "modified"):
        ratio = next(row for row in found.rows if row.scenario == "corner").values[block]
        rms = {
            r.strategy: r.blocks[block].rms_percent + 0.05
            for r in run.results
            if r.case == "corner"
        }
        assert ratio == pytest.approx(rms["softer"] / rms["unchanged"], rel=1e-12)
    assert called_by("--of", "unchanged", "--with", "softer").exit_code == 0
    worse = called_by("--of", "softer", "--with", "unchanged")
    assert worse.exit_code == 1
    assert "B is worse than A: unchanged" in " ".join(worse.output.split())
    for words, said in (
        ([], "one run alone"),
        (["--of", "softer"], "belong together"),
        (["--of", "softer", "--with", "unchange"], "did you mean 'unchanged'"),
        (["--of", "softer", "--with", "unchanged", "-s", "softer"], "without --strategy"),
    ):
        answer = called_by(*words)
        assert answer.exit_code == 2
        assert said in answer.stderr


def test_what_ended_otherwise_comes_first(data: Data, tmp_path: Path) -> None:
    broken = failed(data, "softer")
    found = compared(data, broken)
    assert [(c["kind"], c["before"], c["after"]) for c in found["changes"]] == [
        ("lost", "ok", "failed")
    ] * 2
    assert row(found, "softer")["failures"] == 2.0
    assert row(found, "softer")["used"] is None
    assert row(found, "softer")["loss"] > 0.1
    text = called_with(tmp_path, data, broken)
    assert text.exit_code == 1
    assert text.output.index("Ended otherwise") < text.output.index("strategy  ")
    repaired = compared(broken, data)
    assert {c["kind"] for c in repaired["changes"]} == {"gained"}
    assert not repaired["worse"]
    # What was made before there was a rule cannot be compared.
    bare = [
        {**run, "meta": {**run["meta"], "rule": None, "models": None}} for run in (data, broken)
    ]
    with pytest.raises(InputError, match="run it again"):
        compared(*bare)


def test_a_model_that_became_unphysical_is_a_lost_result(data: Data) -> None:
    after = json.loads(json.dumps(data))
    for result in after["results"]:
        if result["strategy"] == "softer":
            result["negative_eigenvalues"] = 2
    found = compared(data, after)
    assert {(c["kind"], c["after"]) for c in found["changes"]} == {("lost", "unphysical")}
    assert "2 eigenvalues < 0" in found["changes"][0]["reason"]
    assert found["worse"]


def test_only_jobs_of_both_are_compared(data: Data) -> None:
    less = json.loads(json.dumps(data))
    less["results"] = [r for r in less["results"] if r["case"] == "corner"]
    found = compared(data, less)
    assert found["jobs"] == 2
    assert {job["case"] for job in found["only_before"]} == {"other/corner"}
    assert found["only_after"] == []
    assert {job["case"] for job in compared(less, data)["only_after"]} == {"other/corner"}
    changed = moved(data, "corner", "4567")
    found = compared(data, changed)
    assert {job["case"] for job in found["other_cases"]} == {"corner"}
    assert found["jobs"] == 2
    assert any(line.startswith("case corner: 0123 then") for line in found["environment"])
    with pytest.raises(InputError, match="no job in common"):
        compared(less, changed)


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ([], 1),
        (["--fail", "loss>0.6"], 0),
        (["--fail", "loss>0.6", "--fail", " used > 1.2 "], 1),
        (["--fail", "failures>0"], 0),
        (["--fail", "seconds>0.9"], 1),
        (["-s", "unchanged"], 0),
        (["-s", "softer"], 1),
    ],
)
def test_thresholds_decide_the_exit_code(
    data: Data, tmp_path: Path, options: list[str], code: int
) -> None:
    answer = called_with(tmp_path, data, scaled(data, "softer", 1.5), *options, "-q")
    assert (answer.exit_code, answer.output) == (code, "")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--fail", "rank>1"], "'rank>1' is no threshold"),
        (["--fail", "gain>1e999"], "METRIC>NUMBER"),
        (["-s", "softr"], "no strategy 'softr'; did you mean 'softer'"),
        (["-f", "pdf"], "'pdf'"),
    ],
)
def test_wrong_options(data: Data, tmp_path: Path, options: list[str], message: str) -> None:
    answer = called_with(tmp_path, data, data, *options)
    assert answer.exit_code == 2
    assert message.lower() in answer.stderr.lower()


def test_wrong_files(data: Data, tmp_path: Path) -> None:
    worse = json.loads(json.dumps(data))
    worse["results"][1]["seconds"] = -1
    answer = called_with(tmp_path, data, worse)
    assert answer.exit_code == 2
    assert "b.json: results[1].seconds" in answer.stderr
    call_bench("compare", "a", "b", "--store", tmp_path / "no", code=2)
    strange = json.loads(json.dumps(data))
    strange["meta"] |= {"versions": [1], "machine": "mine"}
    assert called_with(tmp_path, data, strange).exit_code == 0


def test_hostile_names_are_text(data: Data) -> None:
    a = renamed(data, "softer", HOSTILE)
    b = called(failed(a, HOSTILE), HOSTILE, cpu=HOSTILE)
    b["results"][0]["reason"] = HOSTILE
    found = compared(a, b)
    html = comparison_html(found)
    assert "<script" not in html
    assert "&lt;script&gt;alert(1)" in html
    assert 'http-equiv="Content-Security-Policy" content="default-src \'none\'' in html
    assert "http" not in re.sub("http-equiv", "", html)
    for text in (html, comparison_markdown(found), comparison_text(found)):
        assert "\x1b" not in text
    assert "<script" not in comparison_markdown(found)
    tables = [line for line in comparison_markdown(found).splitlines() if line.startswith("| ")]
    assert len({re.sub(r"\\\|", "", line).count("|") for line in tables}) <= 3


def test_a_threshold_that_nothing_is_held_against_is_said(data: Data) -> None:
    bare = json.loads(json.dumps(data))
    for result in bare["results"]:
        result["higher"] = None
    found = compared(bare, bare, thresholds=[Threshold("higher", 1.1)])
    assert found["untested"] == ["higher"]
    assert "nothing was held against" in comparison_text(found)
