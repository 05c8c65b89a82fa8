"""The documentation as a site: builds without a warning, loads nothing, and leaves nothing out."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest

import femubench

ROOT = Path(__file__).parents[1]
# What a page loads without a click: scripts, style sheets, images, fonts, frames.
LOADED = re.compile(
    r"<(?:script|img|iframe|source|link)\b[^>]*?\b(?:src|href)=[\"']?(?:https?:)?//[^>]*>"
    r"|url\([\"']?(?:https?:)?//|@import\s"
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site as `make docs` does: warnings, broken links and anchors are errors."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-E", "-W", "--keep-going", "-c", "docs", "-b"]
    done = subprocess.run(
        [*command, "html", ".", str(folder)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.nightly
def test_every_page_is_there(site: Path) -> None:
    texts = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("scenarios/*/README.md")]
    for text in texts:
        assert (site / text.relative_to(ROOT)).with_suffix(".html").is_file()
    assert 'url=docs/index.html"' in (site / "index.html").read_text(encoding="utf-8")


@pytest.mark.nightly
def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    assert LOADED.search('<script async src="https://cdn.example/x.js">')
    files = [*site.rglob("*.html"), *site.rglob("*.css")]
    assert len(files) > 40
    for file in files:
        assert LOADED.findall(file.read_text(encoding="utf-8")) == [], file


@pytest.mark.nightly
def test_reference_names_every_public_name(site: Path) -> None:
    for info in [None, *iter_modules(femubench.__path__)]:
        if info is not None and (info.ispkg or info.name.startswith("_")):
            continue
        name = "femubench" if info is None else f"femubench.{info.name}"
        page = (site / "docs" / "api" / f"{name}.html").read_text(encoding="utf-8")
        # Types keep the names that the source gives them.
        assert "ndarray[tuple" not in page
        assert "ForwardRef" not in page
        for public in getattr(import_module(name), "__all__", ()):
            assert "@" in public or f'id="{name}.{public}"' in page  # an @ is of pytest's own


def _asked_for() -> set[str]:
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = pyproject["project"]
    extras = project["optional-dependencies"].values()
    lists = [pyproject["build-system"]["requires"], project["dependencies"], *extras]
    found = {re.match(r"[\w.-]+", line) for lines in lists for line in lines}
    return {match[0].lower() for match in found if match} - {"femubench"}


def test_every_dependency_has_its_line() -> None:
    text = (ROOT / "docs" / "development" / "dependencies.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([\w.\[\], -]+?) \|", text, flags=re.MULTILINE)
    described = [name for row in rows for name in row.split(", ") if name != "package"]
    assert sorted(described) == sorted(_asked_for())


def test_the_page_of_scenarios_links_to_every_case() -> None:
    """Of these links the site is made: a page without one fails its build."""
    text = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")
    linked = {(ROOT / "docs" / link).resolve() for link in re.findall(r"\]\(([^)#]+\.md)\)", text)}
    pages = {page.resolve() for page in (ROOT / "scenarios").rglob("README.md")}
    assert len(pages) > 70
    assert pages <= linked
