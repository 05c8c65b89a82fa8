"""What is written in pyproject.toml against the folders and what is installed."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import get_args

import pytest

import femubench
from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.markers import PROJECT
from femubench.core.schema.diagnosis import Verdict
from tests.command import call_bench

ROOT = Path(__file__).parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SETUPTOOLS = PYPROJECT["tool"]["setuptools"]


def test_version_stands_in_one_place() -> None:
    assert "version" in PYPROJECT["project"]["dynamic"]
    assert SETUPTOOLS["dynamic"]["version"] == {"attr": "femubench.core.version.__version__"}
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## {femubench.__version__}" in changelog


@pytest.mark.parametrize("group", [PROJECT, "console_scripts"])
def test_entry_points_are_installed_and_load(group: str) -> None:
    project = PYPROJECT["project"]
    listed = project["scripts"] if group == "console_scripts" else project["entry-points"][group]
    installed = {
        point.name: point
        for point in entry_points(group=group)
        if point.dist is not None and point.dist.name == PROJECT
    }
    assert {name: point.value for name, point in installed.items()} == listed
    for point in installed.values():
        assert point.load() is not None


def test_facade_gives_every_name_that_it_lists() -> None:
    for name in femubench.__all__:
        assert getattr(femubench, name) is not None
    assert set(femubench.__all__) <= set(dir(femubench))
    assert len(femubench.__all__) <= 45
    with pytest.raises(AttributeError, match="no attribute 'Stratgy'"):
        femubench.Stratgy  # noqa: B018


def test_a_case_its_diagnosis_and_all_effects_load_nothing_else() -> None:
    code = "import femubench, femubench.core.library.diagnose as _, sys; femubench.cases['frame'];"
    code += "[femubench.effects[name] for name in femubench.effects]; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    needless = {"scipy.io", "tomlkit", "femubench.core.update.entries"}
    readers = "femubench.plugins.readers."
    assert [m for m in done.stdout.split() if m in needless or m.startswith(readers)] == []


def test_no_door_more() -> None:
    """A new public name takes the place of one that nobody needs, or goes into an object."""
    pages = [path.stem for path in (ROOT / "femubench").glob("[a-z]*.py")]
    doors = {page: import_module(f"femubench.{page}").__all__ for page in pages}
    # Where pytest rewrites assertions a module has names of its own, such as `@pytest_ar`.
    count = {page: sum(map(str.isidentifier, names)) for page, names in doors.items()}
    assert sum(count.values()) + len(femubench.__all__) <= 193, count


def test_index_of_the_docs_names_every_page() -> None:
    docs = ROOT / "docs"
    index = (docs / "index.md").read_text(encoding="utf-8")
    linked = set(re.findall(r"\]\(([\w/-]+\.md)\)", index))
    pages = {page.relative_to(docs).as_posix() for page in docs.rglob("*.md")}
    assert linked | {"index.md"} == pages


def test_help_has_every_key_effect_and_verdict_of_pages_that_are_installed() -> None:
    data = SETUPTOOLS["package-data"]["femubench.docs"]
    pages = sorted((ROOT / "femubench" / "docs").iterdir())
    assert (data, [page.resolve() == ROOT / "docs" / page.name for page in pages]) == (
        ["*.md"],
        [True] * 4,
    )
    example = (ROOT / "core" / "case" / "example_files" / "case.toml").read_text(encoding="utf-8")
    keys = set(re.findall(r"^(\w+) = ", example, re.MULTILINE))
    assert len(keys) > 15
    for key in (*keys, *load_plugins().effects, *get_args(Verdict), "measurement.tolerance"):
        done = call_bench("help", key, code=None)
        assert (done.exit_code, len(done.output) > 40) == (0, True), key
    assert done.output.startswith("tolerance (measurement, docs/case-format.md)\n  how far a")
    done = call_bench("help", "tolerence", code=None)
    assert (done.exit_code, done.output) == (
        2,
        "bench: no key 'tolerence'; did you mean 'tolerance'?\n",
    )
