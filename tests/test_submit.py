"""`bench submit` and the CI action around it: a good, a worse and a crashing strategy."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

import femubench
from tests.command import call_bench

pytestmark = pytest.mark.slow(20)

SITE = Path(str(femubench.__file__)).parents[1]
ACTION = Path(__file__).parents[1] / ".github" / "actions" / "submit" / "action.yml"
CASE = "suite/bracket"
FACTOR = "factor = float(ratio.sum() / (ratio @ ratio))"
METADATA = """Metadata-Version: 2.1
Name: fitted
Version: {version}
Summary: One factor for all
Author-email: Ada <ada@example.org>
Project-URL: Source, javascript:alert(1)
Project-URL: Homepage, https://example.org/fitted
"""
Data = dict[str, Any]


class Repository:
    """A repository with the package of a strategy, and its CI job."""

    def __init__(self, folder: Path) -> None:
        words = ["plugins", "new", "fitted", "--output", str(folder)]
        call_bench(*words)
        self.folder, self.source = folder / "fitted", folder / "fitted/src/fitted/__init__.py"
        text = self.source.read_text(encoding="utf-8")
        assert text.count(FACTOR) == 1
        self._text = text.replace("needs = ", 'doi = "10.1000/fitted"\n    needs = ')
        self.becomes(FACTOR)

    def becomes(self, line: str, version: str = "0.1.0") -> None:
        """Let the strategy compute its factor otherwise, as a commit would."""
        self.source.write_text(self._text.replace(FACTOR, line), encoding="utf-8")
        toml = tomllib.loads((self.folder / "pyproject.toml").read_text(encoding="utf-8"))
        info = self.folder / "src" / "fitted.dist-info"
        info.mkdir(exist_ok=True)
        (info / "METADATA").write_text(METADATA.format(version=version), encoding="utf-8")
        points = toml["project"]["entry-points"]["femubench"]
        lines = ["[femubench]", *(f"{name} = {module}" for name, module in points.items())]
        (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")

    def act(self, **inputs: str) -> tuple[int, str, str]:
        """Run the steps of the action as a runner does; return exit code, output and summary."""
        action = yaml.safe_load(ACTION.read_text(encoding="utf-8"))
        assert set(inputs) <= set(action["inputs"])
        given = {name: entry.get("default", "") for name, entry in action["inputs"].items()}
        given |= {"install": "", "cases": CASE, "strategy": "fitted", **inputs}
        summary, failed, stated = self.folder / "summary.md", 0, ""
        summary.unlink(missing_ok=True)
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        ours = {key: text for key, text in os.environ.items() if not key.startswith("PYTEST")}
        ours |= {"PATH": path, "PYTHONDONTWRITEBYTECODE": "1", "GITHUB_STEP_SUMMARY": str(summary)}
        ours["PYTHONPATH"] = os.pathsep.join([str(self.folder / "src"), str(SITE)])
        for step in action["runs"]["steps"]:
            condition = step.get("if", "success()")
            if "run" not in step or (condition == "inputs.tests != ''" and not given["tests"]):
                continue
            if failed and condition != "always()":
                continue
            env = {
                key: re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda found: given[found[1]], text)
                for key, text in step.get("env", {}).items()
            }
            script = ["bash", "--noprofile", "--norc", "-e", "-o", "pipefail", "-c", step["run"]]
            done = subprocess.run(
                script, env=ours | env, cwd=self.folder, capture_output=True, text=True, timeout=300
            )
            failed, stated = failed or done.returncode, stated + done.stdout + done.stderr
        text = summary.read_text(encoding="utf-8") if summary.exists() else ""
        return failed, stated, text


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Repository:
    """Return a repository whose first run is committed as ``baseline.json``."""
    made = Repository(tmp_path_factory.mktemp("repository"))
    code, stated, summary = made.act(output="baseline.json")
    assert code == 0, stated
    assert "accepted: baseline.json" in stated.splitlines()
    assert summary.startswith("# Submission: accepted\n")
    assert "no baseline: commit the result file" in summary
    assert "| fitted |" in summary
    return made


def result_of(repository: Repository, name: str = "submission.json") -> Data:
    data: Data = json.loads((repository.folder / name).read_text(encoding="utf-8"))
    return data


def test_the_result_file_goes_onto_a_leaderboard(repository: Repository, tmp_path: Path) -> None:
    file, site = repository.folder / "baseline.json", tmp_path / "site"
    data = result_of(repository, "baseline.json")
    assert data["meta"]["twins"]["number"] == 2
    words = ["publish", str(site), str(file)]
    enclosed = data["meta"]["sandbox"] == "namespaces"
    call_bench(*words if enclosed else [*words, "--unverified"])
    index = json.loads((site / "index.json").read_text(encoding="utf-8"))
    assert [run["proof"] for run in index["runs"]] == ["recomputed" if enclosed else "unverified"]
    (item,) = index["strategies"]
    assert item["about"] == {
        "homepage": "https://example.org/fitted", "summary": "One factor for all",
        "author": "Ada <ada@example.org>", "doi": "10.1000/fitted",
    }  # fmt: skip
    page = (site / item["page"]).read_text(encoding="utf-8")
    assert 'href="https://example.org/fitted"' in page
    assert "javascript:" not in page


@pytest.mark.nightly
def test_as_good_as_before_is_accepted(repository: Repository) -> None:
    repository.becomes(f"{FACTOR} * (1.0 + 1e-6)", "0.1.1")
    code, stated, summary = repository.act(baseline="baseline.json")
    assert code == 0, stated
    assert "# B is not worse than A" in summary
    assert result_of(repository)["results"][0]["provenance"]["strategy"].startswith("0.1.1+")


def test_a_regression_fails_with_one_line_and_keeps_the_file(repository: Repository) -> None:
    repository.becomes("factor = 4.0 * float(ratio.sum() / (ratio @ ratio))", "0.2.0")
    code, stated, summary = repository.act(baseline="baseline.json", output="worse.json")
    assert code == 1
    (line,) = [line for line in stated.splitlines() if "worse than the baseline" in line]
    assert re.fullmatch(
        r"bench: fitted is worse than the baseline: loss of gain: \S+, allowed 0.01", line
    )
    assert "not accepted: worse.json" in stated.splitlines()
    assert summary.startswith("# Submission: not accepted\n- fitted is worse than the baseline")
    assert "# B is worse than A" in summary
    assert len(result_of(repository, "worse.json")["results"]) == 1


@pytest.mark.nightly
def test_a_crash_fails_and_is_named(repository: Repository) -> None:
    repository.becomes('__import__("os").abort()', "0.3.0")
    code, stated, summary = repository.act(baseline="baseline.json")
    assert code == 1
    assert f"bench: fitted crashed on {CASE}" in stated
    assert "bench: fitted breaks the rule " in stated
    assert f"- fitted crashed on {CASE}" in summary
    assert result_of(repository)["results"][0]["status"] == "crashed"


@pytest.mark.nightly
def test_failing_tests_of_the_repository_fail_the_job(repository: Repository) -> None:
    repository.becomes(FACTOR)
    own = repository.folder / "own_test.py"
    own.write_text("def test_own():\n    assert False, 'a test of the repository'\n")
    code, stated, _ = repository.act(tests="own_test.py -p no:cacheprovider")
    assert code == 1
    assert "a test of the repository" in stated
    # The result file is made all the same. How far it is, a slow machine reports in between.
    lines = [line for line in stated.splitlines() if not line.endswith(" left")]
    assert lines[-1] == "accepted: submission.json"


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["*", "sr?"])
def test_names_are_no_patterns_of_files(repository: Repository, name: str) -> None:
    assert sorted(repository.folder.glob(name))
    code, stated, _ = repository.act(strategy=f"{name}\nother", tests=f"--co -q {name}")
    assert code != 0
    assert f"no strategy {name!r}" in stated, stated
    assert f"file or directory not found: {name}\n" in stated, stated


def test_what_is_wrong_before_the_run_is_one_line(repository: Repository) -> None:
    code, stated, summary = repository.act(baseline="none.json")
    assert code == 2
    assert "none.json" in stated
    assert "Traceback" not in stated
    assert summary == ""
