"""Studies: what is expanded, what strategies see of it, how gain is taken together."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from harness_toys import tiny_case
from numpy.testing import assert_allclose
from study_toys import BROKEN, Spy

import femubench
from femubench import InputError, Run
from femubench.core.library.report import render_report, reporter
from femubench.core.library.study import StudyPlan, study_plan
from femubench.core.plugin.loader import Plugins, load_plugins
from femubench.core.run.executor import LocalProcesses
from femubench.core.run.recording import Progress
from femubench.core.run.runner import Receivers
from femubench.core.score.leaderboard import leaderboard
from femubench.core.study.conditions import vary_case
from femubench.core.study.gain import gain_by
from femubench.core.study.study_file import read_study
from femubench.results import JobResult, Store
from tests.command import call_bench

ROD = """\
[case]
name = "rod"
title = "A cantilever"
source = "made up"
[model]
kind = "frame"
plane = "in-plane"
beam = "euler-bernoulli"
materials.steel = {E = 210e9, nu = 0.3, rho = 7850.0}
sections.bar = {A = 1e-4, Iy = 1e-9, Iz = 1e-9, J = 1e-9, Jp = 2e-9, kappa = 0.83}
joints = [{name = "A", xyz = [0.0, 0.0, 0.0]}, {name = "B", xyz = [1.0, 0.0, 0.0]}]
members = [
  {name = "bar", ends = ["A", "B"], elements = 4, section = "bar", material = "steel"},
]
supports = [{at = "A", fixed = ["x", "z", "ry"]}]
[measurement]
sensors = "sensors.csv"
modes = "modes.csv"
shape_std = 0.01
used = [1]
held_out = [2]
"""
SENSORS = "label,x,y,z,direction\n" + "".join(f"s{i},{i / 5},0,0,z\n" for i in range(1, 6))
MODES = (
    "mode,frequency,frequency_std,s1,s2,s3,s4,s5\n"
    "1,9.0,0.01,0.06,0.23,0.46,0.73,1\n2,57.0,0.05,-0.3,-0.68,-0.59,0.07,1\n"
)
STUDY = """
[study]
title = "A spy"
[axes]
cases = ["./rod"]
seeds = 2
noise = [0.5, 1.0, 2.0]
sensors_left_out = [0, 3]
[[strategies]]
name = "spy"
options = {factor = [1.0, 1.2], loud = [false, true]}
"""
PLUGINS = Plugins(strategies={"spy": Spy()})


def put_case(folder: Path) -> None:
    folder.mkdir()
    files = {"case.toml": ROD, "sensors.csv": SENSORS, "modes.csv": MODES}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder with one small case."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("FEMUBENCH_STORE", raising=False)
    put_case(tmp_path / "rod")
    return tmp_path


def plan_of(text: str = STUDY, plugins: Plugins = PLUGINS) -> StudyPlan:
    Path("study.toml").write_text(text, encoding="utf-8")
    return study_plan(read_study("study.toml"), plugins)


def run_plan(
    plan: StudyPlan, workers: int, store: Store | None = None, progress: Progress | None = None
) -> Run:
    """Run a study on this machine."""
    return Run.of(plan.run(LocalProcesses(workers), Receivers(store, progress)))


def values(run: Run, *names: str) -> dict[tuple[str, str, int], tuple[Any, ...]]:
    """Return fields of all results by job."""
    return {
        (r.case, r.strategy, r.seed): tuple(getattr(r, name) for name in names) for r in run.results
    }


@pytest.fixture(scope="module")
def spied(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Return a study that was run once for this file."""
    at = tmp_path_factory.mktemp("spied")
    put_case(at / "rod")
    text = STUDY.replace("[1.0, 1.2], loud = [false, true]", f"[1.0, 1.2, {BROKEN}]")
    (at / "study.toml").write_text(text.replace("[0.5, 1.0, 2.0]", "[1.0, 2.0]"), encoding="utf-8")
    return run_plan(study_plan(read_study(at / "study.toml"), PLUGINS), 2)


class TestExpansion:
    def test_every_combination_is_there_once(self) -> None:
        plan = plan_of()
        assert (plan.cells, plan.jobs) == (3 * 2 * 4, 3 * 2 * 4 * 2)
        assert [s.name for s in plan.strategies] == [
            "spy", "spy:loud=true", "spy:factor=1.2", "spy:factor=1.2,loud=true",
        ]  # fmt: skip
        assert len({case.name for case in plan.cases}) == len({c.digest for c in plan.cases}) == 6
        assert plan.axes.varied == ("noise", "sensors_left_out", "spy.factor", "spy.loud")
        assert plan.axes.pictured == ("noise", "sensors_left_out")


class TestConditions:
    CASE = tiny_case()

    def test_noise_scales_with_its_stated_deviation(self) -> None:
        true = self.CASE.used_measurement()
        once, twice = (vary_case(self.CASE, f, 0).used_measurement(3) for f in (1.0, 2.0))
        assert_allclose(once.frequencies, self.CASE.used_measurement(3).frequencies)
        assert_allclose(
            twice.frequencies - true.frequencies, 2 * (once.frequencies - true.frequencies)
        )
        assert_allclose(twice.shapes - true.shapes, 2 * (once.shapes - true.shapes))
        assert_allclose(twice.frequency_std, 2 * once.frequency_std)
        assert_allclose(twice.shape_std, 2 * once.shape_std)

    def test_sensors_are_left_out_with_their_readings(self) -> None:
        few = vary_case(self.CASE, 1.0, 3)
        seen, whole = few.used_measurement(2), self.CASE.used_measurement(2)
        kept = [whole.sensors.labels.index(label) for label in seen.sensors.labels]
        assert len(kept) == len(whole.sensors) - 3
        assert_allclose(seen.shapes, whole.shapes[kept])
        assert_allclose(seen.sensors.xyz, whole.sensors.xyz[kept])
        hidden = str(few.conditions(2)["sensors_left_out"]).split()
        assert {*hidden, *seen.sensors.labels} == set(whole.sensors.labels)
        more = str(vary_case(self.CASE, 1.0, 5).conditions(2)["sensors_left_out"]).split()
        assert set(hidden) < set(more)
        others = {
            vary_case(self.CASE, 1.0, 3).conditions(s)["sensors_left_out"] for s in range(1, 9)
        }
        assert len(others) > 3


class TestRun:
    def test_a_strategy_sees_the_conditions_and_the_record_tells_them(self, spied: Run) -> None:
        found = {(r.case, r.seed): r for r in spied.results if r.strategy == "spy"}
        plain, loud = found["rod", 1].diagnostics, found["rod (noise 2)", 1].diagnostics
        assert loud["frequency_std"] == pytest.approx(2 * plain["frequency_std"])
        assert loud["shape_std"] == pytest.approx(2 * plain["shape_std"])
        assert loud["frequency"] - 9.0 == pytest.approx(2 * (plain["frequency"] - 9.0))
        few = found["rod (3 sensors left out)", 1]
        assert (few.diagnostics["sensors"], few.diagnostics["rows"]) == (2.0, 2.0)
        assert len(str(few.provenance["sensors_left_out"]).split()) == 3
        both = found["rod (noise 2, 3 sensors left out)", 2]
        assert both.provenance["noise"] == 2.0
        assert "noise" not in found["rod", 1].provenance

    def test_held_out_scores_do_not_depend_on_what_was_hidden(self, spied: Run) -> None:
        blocks: dict[str, set[tuple[str, float]]] = {}
        for result in spied.results:
            for block in result.blocks:
                error = round(result.blocks[block].rms_percent, 9)
                blocks.setdefault(result.strategy, set()).add((block, error))
        assert {name: len(found) for name, found in blocks.items()} == {
            "spy": 2, "spy:factor=1.2": 2,
        }  # fmt: skip

    def test_cells_are_leaderboards_of_their_own(self, spied: Run) -> None:
        table = gain_by(spied, "noise", "spy.factor").set_index(["noise", "spy.factor"])
        assert table["jobs"].tolist() == [4] * 6
        alone = Run(
            {**spied.meta, "strategies": ["spy:factor=1.2"]},
            tuple(r for r in spied.results if r.strategy == "spy:factor=1.2"),
        )
        expected = leaderboard(alone)["gain"][0]
        assert_allclose(table["gain"][[(1.0, 1.2), (2.0, 1.2)]], expected)
        broken = table.loc[(2.0, BROKEN)]
        assert (broken["failed"], broken["missing"]) == (4, 0)
        assert broken["gain"] == 0.0  # as the model that was given
        part = Run(spied.meta, spied.results[1:])
        assert gain_by(part, "spy.factor")["missing"].tolist() == [1, 0, 0]
        with pytest.raises(InputError, match="no axis 'nois'; did you mean 'noise'"):
            gain_by(spied, "nois")

    def test_report_in_every_format(self, spied: Run) -> None:
        plugins = load_plugins()
        texts = {
            name: render_report(reporter(plugins, name), spied)
            for name in ("terminal", "markdown", "html", "json", "csv")
        }
        assert max(map(len, str(texts["terminal"]).splitlines())) <= 80
        for name in ("terminal", "markdown", "html"):
            assert "2 failed of 2" in str(texts[name])
            assert "the factor is 9" in " ".join(str(texts[name]).split())
        assert "<svg" in str(texts["html"])
        cells = json.loads(str(texts["json"]))["cells"]
        assert [cell["gain"] for cell in cells] == gain_by(spied)["gain"].tolist()


class TestResume:
    def test_an_interrupted_study_ends_like_an_undisturbed_one(self) -> None:
        text = STUDY.replace("[0.5, 1.0, 2.0]", "[2.0]").replace(", loud = [false, true]", "")
        plan, store = plan_of(text), Store("broken-off")

        def stop(result: JobResult, done: int, total: int) -> None:
            if done == 3:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            run_plan(plan, 1, store, stop)
        early = store.load()
        assert len(early.results) == 3
        # Seed after seed: the first jobs are of different cells.
        assert {result.seed for result in early.results} == {1}
        seen: list[int] = []
        resumed = run_plan(plan, 2, store, lambda result, done, total: seen.append(done))
        assert seen == list(range(1, 9))
        assert store.runs() == (early.meta["run"],)
        whole = run_plan(plan, 2, Store("calm"))
        fields = ("status", "gain", "key", "blocks", "diagnostics")
        assert values(resumed, *fields) == values(whole, *fields)
        assert resumed.gain_by().equals(
            whole.gain_by().assign(seconds=resumed.gain_by()["seconds"])
        )
        again = run_plan(plan, 2, store)
        assert [r.seconds for r in again.results] == [r.seconds for r in resumed.results]


class TestDryRun:
    TEXT = STUDY.replace('"spy"', '"unchanged"').replace(
        "options = {factor = [1.0, 1.2], loud = [false, true]}", ""
    )

    def test_it_counts_and_runs_nothing(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def refuse(*given: object, **options: object) -> None:
            raise AssertionError("a job was run")

        monkeypatch.setattr("femubench.core.run.runner.Plan.run", refuse)
        Path("study.toml").write_text(self.TEXT, encoding="utf-8")
        done = call_bench("study", "study.toml", "--dry-run", "--store", "kept")
        assert "A spy: 6 cells on 1 case, 2 seeds, 12 jobs" in done.output
        assert "0 jobs in kept already, 12 to run" in done.output
        assert "unknown, since no result is stored, jobs of: unchanged on rod 12" in done.output
        assert not Path("kept").exists()


def test_a_study_goes_on_by_its_own_command() -> None:
    store = Store("results")
    text = STUDY.replace("[0.5, 1.0, 2.0]", "[2.0]").replace("[0, 3]", "[0]")
    text = text.replace("[1.0, 1.2], loud = [false, true]", "1.0").replace("seeds = 2", "seeds = 1")
    run_plan(plan_of(text), 1, store)
    with pytest.raises(InputError, match=r"is a study \(expected `bench study FILE`"):
        femubench.rank(resume=True, store=store)


WRONG = {
    'cases = ["./rod"]|cases = []': "study.toml:5: axes.cases: an empty list",
    'cases = ["./rod"]|cases = ["./rod", "./rot"]': "study.toml:5: axes.cases[1]: there is no case",
    'cases = ["./rod"]|cases = ["rodd"]': "study.toml:5: axes.cases[0]: no case 'rodd'",
    "seeds = 2|seeds = 0": "study.toml:6: axes.seeds: neither a number of draws",
    "seeds = 2|seeds = [1, 1]": "study.toml:6: axes.seeds: an entry stands twice",
    "seeds = 2|seeds = [0, 1]": "study.toml:6: axes.seeds: noise is a factor on what is drawn",
    "seeds = 2\n|": "study.toml:6: axes.noise: noise is a factor on what is drawn",
    "seeds = 2|sedes = 2": "study.toml:6: axes.sedes: unknown key; is 'seeds' meant?",
    "[0.5, 1.0, 2.0]|[0.5, 0.0]": "study.toml:7: axes.noise[1]: 0.0 is not allowed",
    "[0, 3]|[0, 5]": "study.toml:8: axes.sensors_left_out[1]: 5 sensors left out of rod",
    'name = "spy"|name = "spi"': "study.toml:10: strategies[0].name: no strategy 'spi'; did you",
    "{factor = |{facto = ": "study.toml:11: strategies[0].options: strategy 'spy' has no option",
    "[1.0, 1.2]|[1.0, \"x\"]": "study.toml:11: strategies[0].options: strategy 'spy': option",
    "[1.0, 1.2]|[]": "study.toml:11: strategies[0].options.factor: an empty list",
    "[false, true]}|[true]}\n[heat_map]\nx = \"noise\"\ny = \"spy.lod\"": (
        "study.toml:14: heat_map.y: there is no axis 'spy.lod'; did you mean 'spy.loud'"
    ),
    "[study]|[study": "study.toml:2: ",
    "seeds = 2|seeds = 9000": "study.toml: 216000 jobs (expected at most 100000)",
}  # fmt: skip


@pytest.mark.parametrize("change", WRONG)
def test_what_is_wrong_is_said_in_one_line_with_its_place(change: str) -> None:
    old, new = change.split("|")
    assert old in STUDY
    with pytest.raises(InputError) as caught:
        plan_of(STUDY.replace(old, new))
    assert str(caught.value).startswith(WRONG[change])
    assert "\n" not in str(caught.value)
