"""The command line: what it prints, writes and returns."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import click
import pytest
from click.testing import Result
from distributions import install_module

from femubench.core.cli.main import VERBS, bench
from femubench.core.errors import OutputError
from femubench.core.files import write_atomically
from femubench.core.run.store import Store
from femubench.core.schema.quantities import parse_size, parse_timeouts, say_duration
from tests.command import call_bench, run_python
from tests.toys.store_edits import edit, records

MODULE = "femubench.core.cli.{}"  # of a verb
CASE = Path(__file__).parent / "cases" / "in-plane"

PLUGIN = """
import time

from femubench import Strategy, StrategyFailure, UpdateResult, hookimpl

class Nothing(Strategy):
    name = "test-nothing"
    citation = "A. Author 2001, (1)"
    def update(self, model, measurement, rng):
        return UpdateResult(model)

class Fails(Nothing):
    name = "test-fails"
    def update(self, model, measurement, rng):
        raise StrategyFailure("residual 3e-2, allowed 1e-8")

class Sleeps(Nothing):
    name = "test-sleeps"
    def update(self, model, measurement, rng):
        time.sleep(600.0)

class Picky(Nothing):
    name = "test-picky"
    needs = frozenset({"joints"})
    def update(self, model, measurement, rng):
        from femubench import NotApplicable
        raise NotApplicable("no joint to be soft")

@hookimpl
def femubench_strategies():
    return [Nothing, Fails, Sleeps, Picky]
"""

Invoke = Callable[..., Result]


def put_case(folder: Path, *, name: str = "rod") -> Path:
    shutil.copytree(CASE, folder)
    change(folder / "case.toml", 'name = "portal"', f'name = "{name}"')
    return folder


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Install a plugin with well-known strategies for this file."""
    folder = tmp_path_factory.mktemp("site")
    install_module(folder, "femubench_cli_tests", PLUGIN)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        yield folder
    sys.modules.pop("femubench_cli_tests", None)


@pytest.fixture
def invoke(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Call `bench` in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("FEMUBENCH_STORE", raising=False)
    return lambda *words: call_bench(*words, code=None)


def python(code: str) -> str:
    """Return what a fresh interpreter prints."""
    return run_python("-c", textwrap.dedent(code)).stdout


class TestHelp:
    def test_help_is_lighter_than_numpy(self) -> None:
        """No clock: a help that loads fewer modules than numpy, and no big one, is no slower."""
        loaded = python(
            """
            import contextlib, io, sys
            from femubench.core.cli.main import bench
            with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
                bench(["--help"])
            print(" ".join(sys.modules))
            """
        ).split()
        numpy = python("import sys, numpy; print(' '.join(sys.modules))").split()
        heavy = (
            "numpy",
            "scipy",
            "pandas",
            "rich",
            "pluggy",
            "pydantic",
            "tabulate",
            "psutil",
            "jinja2",
            "matplotlib",
        )
        assert "femubench.core.cli.main" in loaded
        assert not {name.partition(".")[0] for name in loaded} & set(heavy)
        assert not set(map(MODULE.format, VERBS)) & set(loaded)
        assert len(loaded) < len(numpy)

    def test_completion_imports_no_other_verb(self, monkeypatch: pytest.MonkeyPatch) -> None:
        words = "bench init --h"
        monkeypatch.setenv("_BENCH_COMPLETE", "bash_complete")
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(words.count(" ")))
        *answers, loaded = python(
            """
            import contextlib, sys
            from femubench.core.cli.main import bench
            with contextlib.suppress(SystemExit):
                bench(prog_name="bench")
            print(" ".join(sys.modules))
            """
        ).splitlines()
        assert {answer.removeprefix("plain,") for answer in answers} == {"--help"}
        assert set(map(MODULE.format, VERBS)) & set(loaded.split()) == {MODULE.format("init")}

    def test_verbs_say_of_themselves_what_the_list_says(self) -> None:
        for verb, line in VERBS.items():
            command = bench.get_command(click.Context(bench), verb)
            assert command is not None
            assert command.name == verb
            assert command.get_short_help_str(limit=200) == line

    def test_every_option_is_documented(self) -> None:
        text = (Path(__file__).parents[1] / "docs" / "commands.md").read_text(encoding="utf-8")
        for verb in VERBS:
            command = bench.get_command(click.Context(bench), verb)
            assert command is not None
            assert f"bench {verb}" in text
            options = [p for p in command.params if isinstance(p, click.Option)]
            for option in options:
                assert any(f"`{name}" in text for name in option.opts), f"{verb} {option.opts}"


class TestWrongInput:
    """Exit code 2, one line, and nothing is written."""

    @pytest.mark.parametrize(
        ("words", "expected"),
        [
            (
                ["case", "-s", "test-nothin"],
                "no strategy 'test-nothin'; did you mean 'test-nothing'",
            ),
            (["some/where"], "some/where: folder does not exist"),
            (["empty"], "empty/case.toml: missing file"),
            (["case", "--json", "no/such.json"], "no/such.json: its folder does not exist"),
            (["case", "--report", "report.docx"], "no report format has the suffix '.docx'"),
            (["case", "--json", "x.json", "--report", "x.json"], "is to hold two outputs"),
            (["case", "twin"], "the name 'rod' is also that of case"),
            (["case", "bad"], "bad/sensors.csv:4"),
        ],
    )
    def test_is_one_line(
        self, invoke: Invoke, tmp_path: Path, words: list[str], expected: str
    ) -> None:
        put_case(tmp_path / "case")
        put_case(tmp_path / "twin")
        put_case(tmp_path / "bad", name="bad")
        change(tmp_path / "bad" / "sensors.csv", "0.75,0,1.1", "0.75,0,7.1")
        (tmp_path / "empty").mkdir()
        before = sorted(tmp_path.rglob("*"))
        result = invoke("run", *words)
        assert result.exit_code == 2
        assert result.stdout == ""
        (line,) = result.stderr.splitlines()
        assert line.startswith("bench: ")
        assert expected in line
        assert sorted(tmp_path.rglob("*")) == before

    @pytest.mark.parametrize("words", [["run", "--timeout", "soon"], ["run", "-j", "0"], ["--x"]])
    def test_usage(self, invoke: Invoke, words: list[str]) -> None:
        result = invoke(*words)
        assert result.exit_code == 2
        assert len(result.stderr.splitlines()) == 1
        assert result.stderr.startswith("bench: ")

    def test_folder_that_may_not_be_written_to(self, invoke: Invoke, tmp_path: Path) -> None:
        put_case(tmp_path / "case")
        (tmp_path / "file").write_text("")
        result = invoke("run", "case", "-s", "test-nothing", "--store", "file/store")
        assert result.exit_code == 2
        assert "file/store: cannot make the folder" in result.stderr

    def test_traceback_on_request(self, invoke: Invoke) -> None:
        result = invoke("--traceback", "run", "nowhere/at-all")
        assert result.exit_code == 2
        assert "Traceback (most recent call last)" in result.stderr
        assert result.stderr.splitlines()[-1].startswith("bench: nowhere/at-all: ")

    def test_report_on_what_is_no_result(self, invoke: Invoke, tmp_path: Path) -> None:
        (tmp_path / "no.json").write_text("{")
        (tmp_path / "other.json").write_text('{"results": 3}')
        for word, expected in (("no.json", "no.json: not JSON"), ("other.json", "other.json")):
            result = invoke("report", word)
            assert result.exit_code == 2
            assert result.stderr.startswith(f"bench: {expected}")
        assert "no results" in invoke("report").stderr


class TestGoingOn:
    """`--resume`, `--overwrite`, `--locked`, limits for single strategies."""

    def test_a_run_is_continued_without_words(self, invoke: Invoke, tmp_path: Path) -> None:
        case = put_case(tmp_path / "case")
        words = ("-s", "test-nothing", "-s", "test-fails", "--seeds", 2, "-j", 1)
        words += ("--nominal", "drawn")
        assert invoke("run", case, *words).exit_code == 1
        store = Store(tmp_path / "femubench-results")
        # As if the power had failed after the first result.
        edit(*store.files, "DELETE FROM records WHERE number > 2")
        result = invoke("run", "--resume", "-j", 1)
        assert result.exit_code == 1
        assert "2 strategies, seeds 1-2" in " ".join(result.stdout.split())
        found = records(store)
        assert [item["record"] for item in found].count("run") == 1
        jobs = [
            (item["result"]["strategy"], item["result"]["seed"])
            for item in found
            if item["record"] == "result"
        ]
        assert set(jobs) == {(n, s) for n in ("test-nothing", "test-fails") for s in (1, 2)}
        assert jobs.count(("test-nothing", 1)) == 1

    def test_a_run_is_continued_under_other_limits(self, invoke: Invoke, tmp_path: Path) -> None:
        case = put_case(tmp_path / "case")
        assert invoke("run", case, "-s", "test-nothing", "--timeout", "50s").exit_code == 0
        result = invoke("run", "--resume", "--timeout", "70s")
        assert "timeout 70s" in " ".join(result.stdout.split())
        result = invoke("run", "--resume", "--seeds", 3)
        assert result.exit_code == 2
        assert "seeds needs CASE or -s" in result.stderr

    def test_a_request_that_is_none_is_said_in_one_line(
        self, invoke: Invoke, tmp_path: Path
    ) -> None:
        for field, value in (("seeds", "x"), ("timeouts", [1]), ("timeout", -1), ("cases", 5)):
            request = {"cases": [], "strategies": ["unchanged"], field: value}
            Store(tmp_path / field).begin({"run": "r", "request": request})
            result = invoke("run", "--locked", "r", "--store", tmp_path / field)
            assert result.exit_code == 2
            assert f"request of run r: {field}" in result.stderr

    def test_a_locked_run_says_what_differs(self, invoke: Invoke, tmp_path: Path) -> None:
        case = put_case(tmp_path / "case")
        assert invoke("run", case, "-s", "test-nothing").exit_code == 0
        (report,) = (tmp_path / "femubench-results").glob("*.md")
        same = invoke("run", "--locked", report.stem)
        assert same.exit_code == 0
        assert f"environment: 0 differences from run {report.stem}" in same.stdout
        assert f"results: 0 differences from run {report.stem}" in same.stdout
        change(case / "modes.csv", "21.5", "21.9")
        other = invoke("run", "--locked", report.stem)
        assert other.exit_code == 1
        text = " ".join(other.stdout.split())
        assert "environment: 1 difference" in text
        assert "rod, test-nothing, seed 0: used rms" in text

    def test_wrong_words(self, invoke: Invoke, tmp_path: Path) -> None:
        case = put_case(tmp_path / "case")
        for words, expected in (
            (("run", case, "--locked", "2026"), "cases cannot be given with it"),
            (("run", "--locked", "2026"), "no results"),
            (("run", "--locked", "2026", "--overwrite", "missing"), "overwrite cannot be given"),
            (("run", case, "--seeds", 0), "not in the range"),
            (("run", case, "--timeout", "kabee=1m", "-s", "test-nothing"), "'kabee'"),
            (("run", case, "--memory", "1k"), "no size >= 16M"),
            (("run", case, "--overwrite", "some"), "'some' is not one of"),
        ):
            result = invoke(*words)
            assert result.exit_code == 2
            assert expected in result.stderr


@pytest.fixture(scope="module")
def done(site: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    folder = tmp_path_factory.mktemp("run")
    case = put_case(folder / "case")
    words = ["run", case, "--store", folder / "store", "--seeds", 2, "--json", folder / "r.json"]
    words += ["-j", 2, "--timeout", "1m", "--nominal", "drawn"]
    for strategy in ("test-nothing", "test-fails", "test-picky"):
        words += ["-s", strategy]
    return folder, call_bench(*words, code=None)


class TestRun:
    def test_failure_is_exit_1_and_no_traceback(self, done: tuple[Path, Result]) -> None:
        _, result = done
        assert result.exit_code == 1
        assert result.stderr == ""

    def test_files(self, done: tuple[Path, Result]) -> None:
        folder, result = done
        data = json.loads((folder / "r.json").read_text(encoding="utf-8"))
        jobs = [(entry["strategy"], entry["seed"], entry["status"]) for entry in data["results"]]
        assert sorted(jobs) == [
            ("test-fails", 1, "failed"),
            ("test-fails", 2, "failed"),
            ("test-nothing", 1, "ok"),
            ("test-nothing", 2, "ok"),
            ("test-picky", 1, "not-applicable"),
            ("test-picky", 2, "not-applicable"),
        ]
        report = folder / "store" / f"{data['meta']['run']}.md"
        written = [f"html: {report.with_suffix('.html')}", f"markdown: {report}"]
        assert result.stdout.splitlines()[-2:] == written
        assert report.read_text(encoding="utf-8").startswith("# ")
        assert not list(folder.rglob(".*"))

    def test_stored_run_in_any_format(self, done: tuple[Path, Result], invoke: Invoke) -> None:
        folder, _ = done
        data = json.loads((folder / "r.json").read_text(encoding="utf-8"))
        run_id = data["meta"]["run"]
        store = ("--store", folder / "store")
        assert "test-nothing" in invoke("report", *store).stdout
        stored = json.loads(invoke("report", run_id[:10], "-f", "json", *store).stdout)

        def by_job(entry: dict[str, object]) -> tuple[str, str]:
            return str(entry["strategy"]), str(entry["seed"])

        assert sorted(stored["results"], key=by_job) == sorted(data["results"], key=by_job)
        result = invoke("report", folder / "r.json", "-f", "csv", "-f", "markdown", "-o", "new/dir")
        assert result.exit_code == 0
        assert sorted(path.name for path in Path("new/dir").iterdir()) == [
            f"{run_id}.csv",
            f"{run_id}.md",
        ]
        assert Path("new/dir", f"{run_id}.csv").read_text(encoding="utf-8").count("\n") == 7
        wrong = invoke("report", "19990101", *store)
        assert (wrong.exit_code, "no run '19990101'" in wrong.stderr) == (2, True)
        assert "did you mean 'markdown'" in invoke("report", "-f", "markdwn", *store).stderr

    def test_run_id_of_a_file_cannot_leave_the_folder(
        self, done: tuple[Path, Result], invoke: Invoke, tmp_path: Path
    ) -> None:
        data = json.loads((done[0] / "r.json").read_text(encoding="utf-8"))
        data["meta"]["run"] = "../../evil"
        (tmp_path / "evil.json").write_text(json.dumps(data), encoding="utf-8")
        result = invoke("report", "evil.json", "-f", "json", "-o", "deep/out")
        assert result.exit_code == 0
        assert [path.name for path in (tmp_path / "deep" / "out").iterdir()] == ["evil.json"]

    def test_not_applicable_is_no_failure(
        self, invoke: Invoke, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        put_case(tmp_path / "case")
        monkeypatch.setenv("FEMUBENCH_STORE", "elsewhere")
        words = ("-s", "test-nothing", "-s", "test-picky", "-j", 1, "--seeds", 3, "--quiet")
        result = invoke("run", "case/case.toml", *words, "--report", "mine.csv")
        assert (result.exit_code, result.stdout) == (0, "")
        assert "\nrod,test-nothing,3,drawn,ok," in (tmp_path / "mine.csv").read_text()
        kept = sorted(path.name for path in (tmp_path / "elsewhere").iterdir())
        (file,) = Store(tmp_path / "elsewhere").files
        assert kept == [file.name, "exhibits"]

    def test_ctrl_c(self, site: Path, tmp_path: Path) -> None:
        """A real signal to a real process: exit code 130, no traceback, no worker left behind."""
        put_case(tmp_path / "case")
        code = "from femubench.core.cli.main import bench; bench()"
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(site), *(p for p in sys.path if p)]),
        }
        command = [sys.executable, "-c", code, "run", "case", "-s", "test-sleeps", "-j", "1"]
        with subprocess.Popen(
            command,
            cwd=tmp_path,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            store = Store(tmp_path / "femubench-results")
            deadline = time.monotonic() + 60.0
            while not store.files and time.monotonic() < deadline:
                time.sleep(0.05)
            assert process.stderr is not None
            time.sleep(0.5)
            process.send_signal(signal.SIGINT)
            stated = [process.stderr.readline(), process.stderr.readline()]
            process.send_signal(signal.SIGINT)
            # ends only when the workers, who hold the pipes too, are gone
            _, error = process.communicate(timeout=60.0)
        assert process.returncode == 130
        assert [*stated, *error.splitlines(keepends=True)] == [
            "\n",
            "bench: finishing the jobs that are running; Ctrl-C once more stops them\n",
            "bench: interrupted\n",
            "bench: 0 of 2 jobs are done; to go on: bench run case -s test-sleeps -j 1 --resume\n",
        ]


class TestPluginsAndScenarios:
    def test_a_run_goes_on_without_broken_plugins_unless_it_is_strict(
        self, invoke: Invoke, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.syspath_prepend(tmp_path)
        install_module(tmp_path, "cli_broken", "import a_module_that_nobody_has\n")
        install_module(tmp_path, "cli_typo", PLUGIN.replace("_strategies()", "_strategis()"))
        install_module(tmp_path, "zz_cli_twin", PLUGIN)
        case = put_case(tmp_path / "case")
        result = invoke("run", case, "-s", "test-nothing", "-q")
        assert result.exit_code == 0
        assert len(Store(tmp_path / "femubench-results").load().results) > 0
        lines = [line for line in result.stderr.splitlines() if "cli_" in line]
        for name, what in (
            ("cli_broken", "ModuleNotFoundError"),
            ("cli_typo", "did you mean 'femubench_strategies'"),
            ("zz_cli_twin", "the name 'test-nothing' is taken"),
        ):
            assert any(f"plugin '{name}' ({name} 1.0)" in line and what in line for line in lines)

    def test_scenarios_list_and_show(self, invoke: Invoke) -> None:
        listed = invoke("scenarios", "list")
        assert listed.exit_code == 0
        assert "hframe " in listed.stdout
        shown = invoke("scenarios", "show", "hframe").stdout
        assert "modes 1 2 3 4 5 at 77.1" in shown
        assert max(len(line) for line in shown.splitlines() if "/" not in line) <= 80
        wrong = invoke("scenarios", "show", "hfrme")
        assert (wrong.exit_code, "'hframe'" in wrong.stderr) == (2, True)


def parse_duration(text: str) -> float:
    return parse_timeouts([text])[""]


def test_durations() -> None:
    for text, seconds in (("90", 90.0), ("90s", 90.0), ("10m", 600.0), ("1.5h", 5400.0)):
        assert parse_duration(text) == seconds
        assert parse_duration(say_duration(seconds)) == seconds
    for text in ("", "0", "-1", "1d", "m", "1m30s", "inf", "nan", "٣", "1e3"):
        with pytest.raises(ValueError, match="no duration > 0"):
            parse_duration(text)


def test_durations_of_single_strategies() -> None:
    wanted = {"": 600.0, "kabe": 90.0, "spring:arm=0.02": 3600.0}
    assert parse_timeouts(["10m", "kabe=90", "spring:arm=0.02=1h"]) == wanted
    for words in (("1m", "2m"), ("kabe=1m", "kabe=2m"), ("kabe=soon",)):
        with pytest.raises(ValueError, match=r"given twice|no duration"):
            parse_timeouts(words)


def test_sizes() -> None:
    for text, size in (("512M", 2**29), ("4GiB", 2**32), ("1.5gb", 3 * 2**29), ("33554432", 2**25)):
        assert parse_size(text) == size
    for text in ("", "0", "1k", "-4G", "4P", "much", "inf"):
        with pytest.raises(ValueError, match="no size >= 16M"):
            parse_size(text)


def test_files_are_replaced_in_one_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "result.json"
    write_atomically(path, "old")
    plain = tmp_path / "plain"
    plain.touch()
    assert path.stat().st_mode == plain.stat().st_mode

    def fail(self: Path, target: Path) -> None:
        raise OSError("disk is full")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OutputError, match=r"result\.json: cannot be written: disk is full"):
        write_atomically(path, "new")
    assert path.read_text() == "old\n"
    assert sorted(tmp_path.iterdir()) == [plain, path]


class Faulty:
    name = "faulty"
    suffix = ".faulty"

    def render(self, run: object) -> str:
        raise ZeroDivisionError("division by zero")


def test_a_reporter_that_raises_is_named() -> None:
    from femubench.core.errors import PluginError
    from femubench.core.library.report import render_report
    from femubench.core.schema.results import RunData

    with pytest.raises(PluginError, match="reporter 'faulty' failed: ZeroDivisionError"):
        render_report(Faulty(), RunData({}, ()))
