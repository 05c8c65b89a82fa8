"""femubench as third parties get it: clone, wheel, sdist, install by link, clone without links.

Environments are virtual ones with links to the installed dependencies, so that nothing is fetched.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import sys
import tarfile
import tomllib
import venv
from collections.abc import Mapping
from pathlib import Path
from zipfile import ZipFile

import pytest

pytestmark = pytest.mark.slow(20)

ROOT = Path(__file__).parents[1]
ROOMS = ("core", "papers", "plugins", "reports", "scenarios")
FILES = ("LICENSE", "Makefile", "README.md", "pyproject.toml", "setup.py", ".gitignore")
CACHES = shutil.ignore_patterns("__pycache__")
NO_LINKS = "femubench/core is no link to the folder core: clone once more with"


def done(
    *words: str | Path, cwd: Path, env: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command with an environment in which nothing leads to this checkout."""
    ours = ("PYTHON", "PYTEST", "VIRTUAL_ENV", "COV", "GIT", "MAKE", "COLUMNS", "FORCE_COLOR")
    clean = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    clean |= {"PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1", **(env or {})}
    return subprocess.run(list(map(str, words)), cwd=cwd, env=clean, capture_output=True, text=True)


def succeeded(*words: str | Path, cwd: Path) -> str:
    """Return what a command prints."""
    result = done(*words, cwd=cwd)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def environment(folder: Path) -> Path:
    """Return Python of a virtual environment with all that is installed but femubench."""
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    for path in map(Path, sys.path):
        if path.name in ("site-packages", "dist-packages") and path.is_dir():
            for entry in path.iterdir():
                link = site / entry.name
                if "femubench" not in entry.name and entry.suffix != ".pth" and not link.exists():
                    link.symlink_to(entry)
    return folder / "bin" / "python"


@pytest.fixture(scope="module")
def origin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a repository with the files of this checkout."""
    folder = tmp_path_factory.mktemp("install") / "origin"
    folder.mkdir()
    for name in ("femubench", "tests", *ROOMS):
        shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=CACHES)
    (folder / "docs").mkdir()
    for page in (ROOT / "femubench" / "docs").iterdir():
        shutil.copy(page, folder / "docs")
    for name in FILES:
        shutil.copy(ROOT / name, folder)
    who = ("-c", "user.name=test", "-c", "user.email=test@localhost")
    succeeded("git", "init", "--quiet", cwd=folder)
    succeeded("git", "add", "--all", cwd=folder)
    succeeded("git", *who, "commit", "--quiet", "--message=all", cwd=folder)
    return folder


@pytest.fixture(scope="module")
def clone(origin: Path) -> Path:
    """Return a clone, for tests that leave it as it is."""
    succeeded("git", "clone", "--quiet", origin, "clone", cwd=origin.parent)
    return origin.parent / "clone"


@pytest.fixture(scope="module")
def without_links(origin: Path) -> Path:
    """Return a clone as a file system without links has it."""
    words = ("git", "clone", "--quiet", "-c", "core.symlinks=false", origin, "without-links")
    succeeded(*words, cwd=origin.parent)
    return origin.parent / "without-links"


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return Python of an environment into which nothing is installed."""
    return environment(tmp_path_factory.mktemp("bare"))


def built(kind: str, source: Path, output: Path, python: Path) -> Path:
    """Build a "wheel" or an "sdist" from a source folder."""
    code = f"import sys; from setuptools import build_meta as b; b.build_{kind}(sys.argv[1])"
    output.mkdir()
    succeeded(python, "-c", code, output, cwd=source)
    (file,) = output.iterdir()
    return file


@pytest.fixture(scope="module")
def archives(clone: Path, python: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return a wheel of the clone, and the source that it was built of."""
    folder = tmp_path_factory.mktemp("built")
    source = Path(shutil.copytree(clone, folder / "source", symlinks=True))
    (source / "femubench-results").mkdir(exist_ok=True)  # of a run; no package
    return [built("wheel", source, folder / "wheel", python), source]


def contents(wheel: Path) -> dict[str, bytes]:
    """Return the files of a wheel, of which each must be a plain one and stand there once."""
    with ZipFile(wheel) as archive:
        entries = [entry for entry in archive.infolist() if not entry.is_dir()]
        assert not [entry for entry in entries if stat.S_ISLNK(entry.external_attr >> 16)]
        assert len({entry.filename for entry in entries}) == len(entries)
        return {entry.filename: archive.read(entry) for entry in entries}


def test_clone_finds_its_own_plugins(clone: Path, python: Path) -> None:
    listed = done(python, "-m", "femubench", "plugins", "list", cwd=clone)
    assert (listed.returncode, listed.stderr) == (0, "")
    points = tomllib.loads((clone / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"]
    found = re.findall(r"^(\w+) \(femubench [\d.]+, not installed\)$", listed.stdout, re.MULTILINE)
    assert found == sorted(points["femubench"])
    run = ("run", "frame", "-s", "unchanged")
    assert "unchanged  0.000" in succeeded(python, "-m", "femubench", *run, cwd=clone)


def test_wheel_holds_every_file_once(clone: Path, archives: list[Path]) -> None:
    tree = clone / "femubench"
    links = [link.name for link in tree.iterdir() if link.is_symlink()]
    assert sorted(links) == sorted(ROOMS)
    folders = [tree, *(clone / room for room in ROOMS)]
    expected = {
        f"femubench/{path.relative_to(tree if folder == tree else clone)}": path.read_bytes()
        for folder in folders
        for path in folder.rglob("*")
        if path.is_file()
    }
    wheel = contents(archives[0])
    assert {name: wheel[name] for name in wheel if ".dist-info/" not in name} == expected


@pytest.mark.nightly
def test_sdist_builds_the_same_wheel(archives: list[Path], python: Path, tmp_path: Path) -> None:
    wheel, source = archives
    sdist = built("sdist", source, tmp_path / "sdist", python)
    with tarfile.open(sdist) as archive:
        assert not [member.name for member in archive if member.issym() or member.islnk()]
    succeeded(python, "-m", "tarfile", "-e", sdist, tmp_path / "extracted", cwd=tmp_path)
    (extracted,) = (tmp_path / "extracted").iterdir()
    again = built("wheel", extracted, tmp_path / "again", python)
    assert contents(again) == contents(wheel)


def test_wheel_works_where_it_is_installed(archives: list[Path], tmp_path: Path) -> None:
    python = environment(tmp_path / "venv")
    pip = (python, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps")
    succeeded(*pip, archives[0], cwd=tmp_path)
    where = succeeded(python, "-c", "import femubench; print(femubench.__file__)", cwd=tmp_path)
    assert Path(where.strip()).is_relative_to(tmp_path / "venv")
    listed = done(python.with_name("bench"), "plugins", "list", cwd=tmp_path)
    assert (listed.returncode, listed.stderr) == (0, "")
    assert "not installed" not in listed.stdout
    shown = succeeded(python.with_name("bench"), "scenarios", "show", "frame", cwd=tmp_path)
    assert "frame" in shown
    assert "docs/effects.md" in succeeded(
        python.with_name("bench"), "help", "density", cwd=tmp_path
    )


@pytest.mark.nightly
def test_install_by_link_leads_to_the_clone(clone: Path, tmp_path: Path) -> None:
    python = environment(tmp_path / "venv")
    pip = (python, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps")
    succeeded(*pip, "--no-build-isolation", "--editable", clone, cwd=tmp_path)
    code = "import femubench.core.cli.main as m; print(m.__file__)"
    where = Path(succeeded(python, "-c", code, cwd=tmp_path).strip())
    assert where.resolve() == (clone / "core" / "cli" / "main.py").resolve()
    listed = done(python.with_name("bench"), "plugins", "list", cwd=tmp_path)
    assert (listed.returncode, listed.stderr) == (0, "")
    assert "not installed" not in listed.stdout


def test_without_links_the_import_says_so(without_links: Path, python: Path) -> None:
    for words in (("-c", "import femubench"), ("-m", "femubench", "--version")):
        result = done(python, *words, cwd=without_links)
        assert result.returncode == 1
        assert f"ImportError: {NO_LINKS}" in result.stderr.splitlines()[-1]


def test_without_links_make_says_so(without_links: Path) -> None:
    result = done("make", "run", cwd=without_links)
    assert (result.returncode, result.stdout) == (2, "")
    (line,) = result.stderr.splitlines()
    assert NO_LINKS in line
