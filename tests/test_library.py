"""All that the command line does, from Python: same results, same files, and short to look at."""

from __future__ import annotations

import json
import os
import re
import textwrap
import threading
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import femubench
import femubench.papers
from femubench.core.display import LINES, WIDTH
from femubench.core.schema.run_options import RunOptions, Where, split_keywords
from femubench.core.score.repeatability import result_differences
from tests.command import call_bench, run_python
from tests.frf_problems import frf_set, write_universal
from tests.test_cli import put_case
from tests.toys import reproduction_toys
from tests.toys.duck import Duck
from tests.toys.store_edits import change_data

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TWO = ["unchanged", "generic-ls"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder with one small case."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("FEMUBENCH_STORE", raising=False)
    put_case(tmp_path / "rod")
    return tmp_path


def data(file: str) -> Any:
    return json.loads(Path(file).read_text(encoding="utf-8"))


def without_times(found: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in found.items() if key not in ("seconds", "written")}


class TestEveryCommandOfTheReadme:
    """One test a verb; the last one makes sure that none is missing."""

    def test_run(self) -> None:
        words = ["baruch", "generic-ls:plain=full"]
        given = [part for word in words for part in ("-s", word)]
        call_bench("run", "frame", *given, "-q", "-j", 2, "--json", "results.json")
        run = femubench.rank("frame", words, jobs=2)
        assert result_differences(femubench.read_run("results.json"), run) == []
        assert femubench.report(run, "ours.json") == Path("ours.json")
        ours, theirs = data("ours.json"), data("results.json")
        assert ours.keys() == theirs.keys()
        assert [r["gain"] for r in ours["results"]] == [r["gain"] for r in theirs["results"]]
        assert ours["meta"]["request"] == theirs["meta"]["request"]

    def test_run_with_noise_and_run_resume(self) -> None:
        call_bench("run", "rod", "-s", "unchanged", "--seeds", 3, "-q", "-j", 2, "--store", "a")
        run = femubench.rank("rod", "unchanged", seeds=3, jobs=2, store="b")
        assert run.table["seed"].tolist() == [1, 2, 3, 1, 2, 3]
        assert run.table["nominal"].tolist() == 3 * ["textbook"] + 3 * ["drawn"]
        assert result_differences(femubench.read_run(store="a"), run) == []
        again = femubench.rank(resume=True, store="b")
        assert again.meta["run"] == run.meta["run"]
        assert again.results == run.results
        with pytest.raises(femubench.InputError, match="resume alone goes on as before; seeds"):
            femubench.rank(resume=True, seeds=4, store="b")

    def test_study(self) -> None:
        lines = ['axes = {cases = ["rod"], seeds = 1, noise = [1, 2]}', "[[strategies]]"]
        Path("study.toml").write_text("\n".join([*lines, 'name = "unchanged"']), encoding="utf-8")
        call_bench("study", "study.toml", "-q", "-j", 2, "--json", "theirs.json", "--store", "s")
        run = femubench.study("study.toml", jobs=2)
        femubench.report(run, "ours.json")
        assert data("ours.json")["cells"][0].keys() == data("theirs.json")["cells"][0].keys()
        cells = [[cell["gain"] for cell in data(f)["cells"]] for f in ("ours.json", "theirs.json")]
        assert cells[0] == cells[1] == run.gain_by("noise")["gain"].tolist()
        again = femubench.study("study.toml", store="s")
        assert again.meta["run"] == data("theirs.json")["meta"]["run"]

    def test_report(self) -> None:
        femubench.rank("rod", TWO, jobs=2, store="s")
        call_bench("report", "--store", "s", "-f", "html,md,csv", "-o", "out")
        for theirs in Path("out").iterdir():
            ours = femubench.report(None, f"ours{theirs.suffix}", store="s")
            assert Path(ours).read_bytes() == theirs.read_bytes()
        assert str(femubench.report(store="s")) in call_bench("report", "--store", "s").output

    def test_compare(self) -> None:
        a = femubench.rank("rod", TWO, jobs=2, store="s")
        b = femubench.rank("rod", TWO, jobs=2, store="s")
        words = ("compare", a.meta["run"], b.meta["run"], "--store", "s", "--fail", "loss>0.2")
        call_bench(*words, "-f", "json", "-o", "theirs.json")
        found = femubench.compare(a, b.meta["run"], fail="loss>0.2", store="s")
        assert not found.worse
        femubench.report(found, "ours.json")
        assert data("ours.json") == data("theirs.json")
        with pytest.raises(femubench.InputError, match="'skil>1' is no threshold"):
            femubench.compare(a, b, fail="skil>1")

    def test_store(self) -> None:
        run = femubench.rank("rod", "unchanged", jobs=2, store="s")
        assert "1 run, 0 faults" in call_bench("store", "check", "--store", "s").output
        lines = call_bench("report", "-f", "jsonl", "--store", "s").stdout.splitlines()
        text = femubench.report(style="jsonl", store="s")
        assert str(text).splitlines() == lines
        kept = [item["result"] for item in map(json.loads, lines) if "result" in item]
        assert {item["key"] for item in kept} == {result.key for result in run.results}
        (file,) = Path("s").glob("*.sqlite")
        change_data(file, '"status":"ok"', '"status":"oj"')
        lost, missing = femubench.read_run(store="s").meta["notes"]
        assert "sqlite:2: damaged" in lost
        assert missing.startswith(
            "1 of 2 jobs are missing and count as the model that was given: rod unchanged"
        )
        call_bench("store", "repair", "--store", "s")
        assert femubench.read_run(store="s").meta["notes"] == [missing]

    def test_publish(self) -> None:
        run = femubench.rank("rod", TWO, jobs=2)
        file = femubench.report(run, "results.json")
        call_bench("publish", "theirs", file, "--unverified", "-q")
        femubench.publish("ours", run, unverified=True)
        femubench.publish("files", ["results.json"], unverified=True)
        pages = [sorted(p.name for p in Path(f).rglob("*")) for f in ("theirs", "ours", "files")]
        assert pages[0] == pages[1] == pages[2]

    def test_init_and_diagnose(self) -> None:
        call_bench("init", "theirs")
        ours = femubench.init_case("ours")
        assert sorted(path.name for path in ours) == sorted(os.listdir("theirs"))
        effects = ["torsion-constant", "shear-deformation"]
        found = femubench.diagnose("frame", effects, pairs=False, output="ours-extended")
        call_bench(
            *("diagnose", "frame", "--effects", ",".join(effects), "--no-pairs", "-q"),
            *("--json", "theirs.json", "-o", "theirs-extended"),
        )
        femubench.report(found, "ours.json")
        assert without_times(data("ours.json")) == without_times(data("theirs.json"))
        texts = [Path(f"{who}-extended", "case.toml").read_text() for who in ("ours", "theirs")]
        assert texts[0] == texts[1]
        assert found.causes[0].effect == "torsion-constant"
        assert found.sentence in " ".join(str(femubench.report(found)).split())

    @pytest.mark.slow(5)
    def test_identify(self) -> None:
        measured = frf_set(4, modes=4, pairs=0, references=1, step=0.5, band=(20.0, 200.0)).measured
        write_universal(Path("test.uff"), measured)
        call_bench("identify", "test.uff", "--output", "theirs")
        found = femubench.identify("test.uff")
        theirs = pd.read_csv("theirs/modes.csv")
        assert theirs["frequency"].tolist() == found.frequencies.tolist()
        assert theirs["fit_std"].tolist() == found.measurement.frequency_std.tolist()

    def test_init_of_files_and_update(self) -> None:
        n = 6
        stiffness = 1e6 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
        xyz = np.outer(np.arange(n), [0.5, 0.0, 0.0])
        labels = {"node": np.arange(1, n + 1), "direction": n * ["x"], "xyz": xyz}
        np.savez("chain.npz", K=stiffness, M=2.0 * np.eye(n), **labels)
        values, shapes = np.linalg.eigh(stiffness / 2.0)
        frequencies = 1.05 * np.sqrt(values[:3]) / (2.0 * np.pi)
        np.savez("test.npz", frequencies=frequencies, shapes=shapes[:, :3], **labels)
        call_bench("init", "theirs", "--model", "chain.npz", "--modes", "test.npz")
        femubench.init_case("ours", "chain.npz", "test.npz")
        assert Path("ours/case.toml").read_text() == Path("theirs/case.toml").read_text().replace(
            "theirs", "ours"
        )
        printed = call_bench("update", "theirs", "-s", "global", "-o", "updated")
        assert ": 1 → 1.103" in printed.output
        case = femubench.read_case("ours")
        result = femubench.strategies["global"].update(
            case.model, case.used_measurement(), np.random.default_rng(0)
        )
        femubench.write_model(result.model, "written", like="ours/chain.npz")
        with np.load("updated/chain.npz") as theirs, np.load("written/chain.npz") as ours:
            assert_allclose(theirs["K"], 1.05**2 * stiffness, rtol=1e-6)
            assert_allclose(ours["K"], theirs["K"], rtol=1e-12)

    def test_reproduce(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(
            femubench.papers, "study", lambda paper, _: reproduction_toys.study(paper)
        )
        monkeypatch.setattr("femubench.core.plot.figure.render_figure", reproduction_toys.drawn)
        call_bench("reproduce", "hframe", "-q", "-o", "theirs")
        studies = femubench.reproduce("hframe", output="ours")
        names = [p.relative_to("theirs") for p in Path("theirs").rglob("*") if p.is_file()]
        assert len(names) > 3
        for name in names:
            assert Path("ours", name).read_bytes() == Path("theirs", name).read_bytes()
        femubench.report(studies, "studies.json")
        assert data("studies.json") == data("ours/reproduce.json")

    def test_scenarios(self) -> None:
        shown = call_bench("scenarios", "show", "frame-solid").output
        case = femubench.cases["frame-solid"]
        assert case.title.split()[0] in shown
        assert {"source", "sensors", "used"} <= {key for key, _ in case.rows()}

    def test_plugins(self) -> None:
        listed = call_bench("plugins", "list").output.replace("\n", " ")
        for catalogue in (femubench.strategies, femubench.effects):
            assert len(catalogue) > 5
            assert all(name in listed for name in catalogue)
        Path("a").mkdir()
        Path("b").mkdir()
        call_bench("plugins", "new", "my-method", "-o", "a")
        ours = femubench.new_plugin("my-method", output="b")
        theirs = [path.relative_to("a") for path in Path("a").rglob("*") if path.is_file()]
        assert sorted(path.relative_to("b") for path in ours) == sorted(theirs)
        assert all(Path("a", p.relative_to("b")).read_bytes() == p.read_bytes() for p in ours)

    def test_challenge(self) -> None:
        call_bench("challenge", "new", "theirs", "--seed", 3, "--hidden", "none")
        blind = femubench.challenge("ours", 3, hidden="none")
        assert (blind.folder / "case.toml").read_bytes() == Path("theirs/case.toml").read_bytes()
        answer = {"verdict": "none", "causes": []}
        Path("answer.json").write_text(json.dumps(answer))
        call_bench("challenge", "score", "theirs", "answer.json", "--json", "scored.json")
        assert (
            blind.score("answer.json").judgement.right is data("scored.json")["judgement"]["right"]
        )

    def test_no_command_is_missing(self) -> None:
        blocks = re.findall(r"```console\n(.*?)```", README, re.DOTALL)
        words = re.findall(r"\bbench ([a-z]+)(?: (new|check|list|show))?", " ".join(blocks))
        tests = " ".join(vars(type(self)))
        assert {verb for verb, _ in words} >= {"run", "report", "plugins", "diagnose"}
        for verb, _ in words:
            assert f"_{verb}" in tests, verb


@dataclass(frozen=True)
class Scaled:
    """Scale the stiffness.

    Arguments:
        factor: on all of it.
        held: something that need not be sent.
    """

    factor: float = 1.1
    held: Any = field(default=None, repr=False)

    name = "scaled"
    citation = "Nobody (2026), equation (1)"

    def update(self, model: Any, measurement: Any, rng: Any) -> femubench.UpdateResult:
        changed = replace(model, stiffness=self.factor * model.stiffness)
        return femubench.UpdateResult(changed, 1)


class TestCatalogues:
    @pytest.mark.parametrize("kind", [KeyError, femubench.InputError])
    def test_unknown_names_are_said_with_near_ones(self, kind: type[Exception]) -> None:
        with pytest.raises(kind, match=r"^no case 'fram'; did you mean 'frame' or 'hframe'\?$"):
            femubench.cases["fram"]
        with pytest.raises(kind, match="no strategy 'loca'; did you mean 'local'"):
            femubench.strategies["loca"]

    def test_options_by_name(self) -> None:
        local = femubench.strategies["local"]
        assert local(damping=1e-3).name == "local:damping=0.001"
        assert local(**{"options.damping": 1e-3}) == local(damping=1e-3)
        assert local(damping=1e-5).name == local().name == "local"
        softer = femubench.strategies["spring"](**{"stiffness.ry": 3e6}, damping=0.1)
        assert softer.name == "spring:damping=0.1,stiffness.ry=3000000.0"
        words = femubench.strategies["generic-ls"](orthogonality=False, plain="full")
        assert words.name == "generic-ls:orthogonality=false,plain=full"


class TestRank:
    def test_two_instances_of_one_class_have_names_of_their_own(self) -> None:
        given = [Scaled(), Scaled(0.9), Scaled(1.3), Duck, femubench.strategies["unchanged"]]
        # This module imports the papers, which are not there in a sandbox.
        rod = femubench.read_case("rod")
        run = femubench.rank(rod, given, jobs=2, nominal="textbook", sandbox="off")
        names = ["scaled", "scaled:factor=0.9", "scaled:factor=1.3", "duck", "unchanged"]
        assert run.table["strategy"].tolist() == names
        assert set(run.table["status"]) == {"ok"}, run.table["reason"].tolist()
        assert run.leaderboard["strategy"].tolist()[0] in names
        assert run.modes["strategy"].nunique() == 5

    def test_what_cannot_be_set_apart_is_refused(self) -> None:
        with pytest.raises(femubench.InputError, match="strategy 'scaled' occurs twice"):
            femubench.rank("rod", [Scaled(held=[1]), Scaled(held=[2])])

    def test_what_cannot_be_sent_to_a_worker_is_said(self) -> None:
        run = femubench.rank("rod", [Scaled(held=threading.Lock())], jobs=1, nominal="drawn")
        (reason,) = run.table["reason"]
        assert reason.startswith("Scaled cannot be sent to a worker process: TypeError")

    @pytest.mark.slow(5)
    @pytest.mark.parametrize("how", ["script", pytest.param("stdin", marks=pytest.mark.nightly)])
    def test_a_class_of_a_script_or_notebook_needs_no_guard(self, folder: Path, how: str) -> None:
        """It is sent with its code, and the script itself does not run again in a worker."""
        script = textwrap.dedent(
            """
            from dataclasses import replace
            import femubench
            print("once")
            FACTOR = 1.2
            class Mine:
                name = "mine"
                citation = "me"
                def update(self, model, measurement, rng):
                    changed = replace(model, stiffness=FACTOR * model.stiffness)
                    return femubench.UpdateResult(changed, 1)
            run = femubench.rank("rod", Mine, jobs=1)
            print(run.results[0].status, run.results[0].reason)
            """
        )
        (folder / "script.py").write_text(script)
        words = ["script.py"] if how == "script" else ["-"]
        assert run_python(*words, input=script).stdout.split() == ["once", "ok"]


class TestLooks:
    def test_reprs_are_short(self) -> None:
        case = femubench.cases["frame"]
        run = femubench.rank(["frame", "rod"], ["unchanged", "local"], jobs=2, seeds=2)
        result = femubench.strategies["local"].update(case.model, case.used_measurement(), None)  # type: ignore[arg-type]
        found = femubench.diagnose("frame", "torsion-constant", pairs=False)
        for shown in (case, case.model, case.measurement, result, run, found):
            lines = repr(shown).splitlines()
            assert len(lines) <= LINES == 10
            assert max(map(len, lines)) <= WIDTH == 100
            assert lines[0].startswith(type(shown).__name__)
            page = shown._repr_html_()  # type: ignore[attr-defined]
            assert page.startswith("<table>")
            assert page.count("<tr>") == page.count("</tr>") > 0
        assert "gain" in repr(run)
        assert found.verdict in repr(found)


class TestOptionsOfARun:
    def test_keywords_are_options_of_a_run_or_where_it_is_computed(self) -> None:
        keywords = {"seeds": [3, 4], "timeout": None, "twins": (2, 7), "jobs": 3}
        given, where = split_keywords(keywords)
        assert where == Where(3)
        assert given == {"seeds": (3, 4), "twins": 2, "twin_seed": 7}
        assert RunOptions(**given).all_seeds == (3, 4)

    def test_no_other_keyword(self) -> None:
        with pytest.raises(TypeError, match="unexpected keyword argument 'sedes'"):
            femubench.rank("rod", "unchanged", sedes=1)  # type: ignore[call-arg]
        with pytest.raises(TypeError, match="unexpected keyword argument 'seeds'"):
            femubench.study("study.toml", seeds=1)  # type: ignore[call-arg]


@pytest.mark.nightly
def test_the_page_of_the_docs_runs() -> None:
    """All its snippets are one script, as a reader types them."""
    text = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
    script = "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
    Path("page.py").write_text(script)
    done = run_python("page.py")
    assert "local:damping=0.001" in done.stdout
    assert "softer:share=0.2" in done.stdout
    assert "torsion-constant" in done.stdout
    missing = [
        name
        for name, what in ((name, getattr(femubench, name)) for name in femubench.__all__)
        if callable(what) and not isinstance(what, type) and f"{name}(" not in text
    ]
    assert set(missing) <= {"hookimpl", "read_case", "solve_modes"}
