"""``bench plugins new`` and ``show``: packages that work as they are written, names, faults."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from distributions import install_metadata

import femubench
from femubench import InputError
from femubench.core.library import new_package
from femubench.core.library.new_package import KINDS, write_package
from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.validation import KINDS as COLLECTIONS
from tests.command import call_bench

pytestmark = pytest.mark.slow(10)

SITE = Path(str(femubench.__file__)).parents[1]
LONGEST = "a-method-that-has-got-a-rather-long-name"


def at_night(*values: str) -> Any:
    """Return what is tried by `make nightly` alone."""
    return pytest.param(*values, marks=pytest.mark.nightly)


def invoke(*words: str | Path) -> Result:
    return call_bench(*words, code=None)


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with one package of each kind, all installed."""
    folder = tmp_path_factory.mktemp("packages")
    for kind in KINDS:
        result = invoke("plugins", "new", f"my-{kind}", "--kind", kind, "--output", folder)
        assert (result.exit_code, result.stderr) == (0, "")
        installed(folder / f"my-{kind}")
    return folder


def installed(package: Path) -> None:
    """Make a package importable with its entry points, as `pip install -e` would."""
    project = tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    points, version = project["entry-points"]["femubench"], project["version"]
    install_metadata(package / "src", project["name"], points, version)


def python(
    *words: str | Path, packages: Iterable[Path], cwd: Path
) -> subprocess.CompletedProcess[str]:
    """Run Python with some packages and femubench, away from this process."""
    path = os.pathsep.join(map(str, [*(package / "src" for package in packages), SITE]))
    # pytest-benchmark takes no times in a worker of pytest-xdist, which these processes are not.
    ours = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    env = ours | {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, *map(str, words)], capture_output=True, text=True, env=env, cwd=cwd
    )


def pytest_of(package: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a package's tests; unless `words` say else, without taking times."""
    command = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", package)
    chosen = words or ("--benchmark-disable",)
    return python(*command, *chosen, package / "tests", packages=[package], cwd=package)


@pytest.fixture
def copy(packages: Path, tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """Return a copy of one package that a test may spoil."""
    return Path(shutil.copytree(packages / f"my-{request.param}", tmp_path / "copy"))


@pytest.mark.parametrize(
    "kind", ["strategy", *(at_night(kind) for kind in KINDS if kind != "strategy")]
)
def test_package_passes_its_own_tests(packages: Path, kind: str) -> None:
    result = pytest_of(packages / f"my-{kind}")
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(
    ("copy", "old", "new"),
    [
        at_night("strategy", "ratio.sum() / (ratio @ ratio)", "1.0 / ratio.mean()"),
        at_night(
            "strategy", "        ratio = ", "        model.stiffness.data *= 1.5\n        ratio = "
        ),
        at_night("effect", 'Factor("EI"', 'Factor("E"'),
        at_night("reader", "len(modes), len(points)).T", "len(points), len(modes))"),
    ],
    indirect=["copy"],
)
def test_its_tests_fail_when_the_plugin_is_wrong(copy: Path, old: str, new: str) -> None:
    (source,) = copy.glob("src/*/__init__.py")
    text = source.read_text(encoding="utf-8")
    assert text.count(old) == 1
    source.write_text(text.replace(old, new), encoding="utf-8")
    result = pytest_of(copy)
    assert result.returncode == 1, result.stdout + result.stderr


@pytest.mark.nightly
def test_strategy_is_timed_next_to_others(packages: Path) -> None:
    brief = ("--benchmark-max-time=0.05", "--benchmark-min-rounds=2", "--benchmark-only")
    result = pytest_of(packages / "my-strategy", *brief)
    assert result.returncode == 0, result.stdout + result.stderr
    table, _, multiples = result.stdout.partition("median time of an update on frame")
    rows = re.findall(r"^test_speed\[(.+?)\] ", table, re.MULTILINE)
    assert sorted(rows) == ["my-strategy", "physical", "unchanged"]
    listed = re.findall(r"^(\S+) +([\d.e-]+) ms +([\d.e+-]+)$", multiples, re.MULTILINE)
    assert [name for name, _, _ in listed] == ["my-strategy", "physical", "unchanged"]
    own = float(listed[0][1])
    for _, time, multiple in listed:
        assert float(multiple) == pytest.approx(float(time) / own, rel=0.02)


def test_any_name_gives_tidy_code(tmp_path: Path) -> None:
    for kind, name in product(KINDS, ("q", LONGEST, "strategy", "model", "none", "path")):
        (tmp_path / kind).mkdir(exist_ok=True)
        for path in write_package(name, kind, tmp_path / kind, load_plugins([])):
            text = path.read_text(encoding="utf-8")
            assert "{{" not in text
            assert text.endswith("\n")
            assert not text.endswith("\n\n")
            if path.suffix == ".py":
                nodes = list(ast.walk(ast.parse(text)))
                classes = {node.name for node in nodes if isinstance(node, ast.ClassDef)}
                assert not classes & {*dir(femubench), "None", "Path"}
    for words in (["check", "--no-cache"], ["format", "--no-cache", "--check"]):
        command = [sys.executable, "-m", "ruff", *words, str(tmp_path)]
        found = subprocess.run(command, capture_output=True, text=True)
        assert found.returncode == 0, found.stdout


class TestInstalled:
    """What `bench` says and does once a package is installed."""

    @pytest.fixture
    def bench_with(self, packages: Path, tmp_path: Path) -> Any:
        def run(kinds: Iterable[str], *words: str | Path) -> subprocess.CompletedProcess[str]:
            found = [packages / f"my-{kind}" for kind in kinds]
            return python("-m", "femubench.core.cli.main", *words, packages=found, cwd=tmp_path)

        return run

    def test_list_names_all_of_them(self, bench_with: Any) -> None:
        result = bench_with(tuple(KINDS), "plugins", "list")
        assert (result.returncode, result.stderr) == (0, "")
        for kind, offers in ((kind, COLLECTIONS[kind]) for kind in KINDS):
            assert f"my-{kind} (my-{kind} 0.1.0)\n  {offers}: my-{kind}\n" in result.stdout

    def test_strategy_is_ranked(self, bench_with: Any) -> None:
        words = ("run", "frame", "-s", "my-strategy", "-s", "unchanged", "--nominal", "drawn")
        result = bench_with(["strategy"], *words)
        assert result.returncode == 0, result.stderr
        assert re.search(r"1  my-strategy +-?0\.\d.*\n=  unchanged +-0\.667", result.stdout)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("My Method", "e.g. my-method"),
        ("../evil", "lower-case letters, digits and dashes"),
        ("2nd-method", "begins with a letter"),
        ("-method", "o such option"),
        ("", "lower-case"),
        ("x" * 41, "40 characters at most"),
        ("class", "keyword of Python"),
        ("json", "standard library"),
        ("structure", "a file of the package's own tests"),
        ("femubench", "name of this program"),
        ("numpy", "installed"),
        ("baruch", "there is a strategy of that name"),
    ],
)
def test_names_that_cannot_be(name: str, words: str, tmp_path: Path) -> None:
    result = invoke("plugins", "new", name, "--output", tmp_path)
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert words in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("kind", "taken"), [("effect", "density"), ("scenario", "frame")])
def test_name_is_taken_within_its_kind_alone(kind: str, taken: str, tmp_path: Path) -> None:
    result = invoke("plugins", "new", taken, "--kind", kind, "--output", tmp_path)
    assert (result.exit_code, list(tmp_path.iterdir())) == (2, [])
    assert f"there is a {kind} of that name" in result.stderr
    assert invoke("plugins", "new", taken, "--kind", "reader", "--output", tmp_path).exit_code == 0


def test_folders_in_the_way_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("everything", encoding="utf-8")
    (tmp_path / "file").write_text("a file", encoding="utf-8")
    (tmp_path / "link").symlink_to(tmp_path / "full")
    before = sorted(tmp_path.rglob("*"))
    for name, words in (("full", "is not empty"), ("file", "in the way"), ("link", "in the way")):
        result = invoke("plugins", "new", name, "--output", tmp_path)
        assert result.exit_code == 2
        assert words in result.stderr
    result = invoke("plugins", "new", "method", "--output", tmp_path / "nowhere")
    assert result.exit_code == 2
    assert "does not exist" in result.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_full_disk_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(folder: Path) -> None:
        (folder / "part").write_text("half", encoding="utf-8")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(new_package, "_write_case", lambda folder, name: full(folder.parent))
    with pytest.raises(InputError, match="No space left on device"):
        write_package("bridge", "scenario", tmp_path, load_plugins([]))
    assert list(tmp_path.iterdir()) == []


class TestShow:
    def test_strategy(self) -> None:
        result = invoke("plugins", "show", "spring")
        assert result.exit_code == 0
        for line in (
            "spring: strategy",
            "  from:     femubench",
            "  needs:    geometry, joints",
            "            free_stiffness = true",
            "            arm = (none)",
            "            options.damping = 1e-05",
            "            stiffness.KEY = (none)",
        ):
            assert line in result.stdout
        assert "Horton" in result.stdout
        assert "Arguments" not in result.stdout

    def test_options_shown_are_options_taken(self) -> None:
        """Every line can be given to `bench run -s` as it stands."""
        from femubench.core.plugin.variants import strategy_of

        known = load_plugins().strategies
        for name in known:
            text = invoke("plugins", "show", name).stdout
            shown = text.rpartition("\n  options: ")[2].partition("\n  run: ")[0]
            pairs = [line.split(": ")[-1].strip() for line in shown.splitlines() if " = " in line]
            for pair in pairs:
                if "(none)" not in pair:
                    strategy_of(f"{name}:{pair.replace(' ', '')}", known)

    def test_unknown_name_is_said_with_near_ones(self) -> None:
        result = invoke("plugins", "show", "barch")
        assert (result.exit_code, result.stdout) == (2, "")
        assert "did you mean 'baruch'?" in result.stderr
        assert "bench plugins list" in invoke("plugins", "show", "zzz").stderr
