"""The rules of the house, read off the source: who imports whom, and how long things are."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("core", "papers", "plugins", "reports", "scenarios")
FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
PUBLIC = [f"femubench.{path.stem}" for path in (ROOT / "femubench").glob("[!_]*.py")]
LONGEST_FILE, LONGEST_FUNCTION = 500, 60


def name_of(path: Path) -> str:
    """Return the dotted name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(("femubench", *(parts[:-1] if parts[-1] == "__init__" else parts)))


def imports_of(path: Path) -> Iterator[str]:
    """Return every module of ours that a file imports, wherever in the file; resolved."""
    own = name_of(path).split(".")
    package = own if path.name == "__init__.py" else own[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            yield ".".join([*base, *([node.module] if node.module else [])])


def may_import(importer: str, imported: str) -> bool:
    """Tell whether one of our modules may import another."""

    def within(name: str, *packages: str) -> bool:
        return any(name == p or name.startswith(f"{p}.") for p in packages)

    public = imported in ("femubench", *PUBLIC)
    if public or not within(imported, "femubench"):
        return not (public and imported != "femubench" and within(importer, "femubench.core"))
    if within(importer, "femubench.core.cli"):
        return True
    if within(importer, "femubench.plugins"):
        return within(imported, "femubench.plugins")
    if within(importer, "femubench.papers"):
        return within(imported, "femubench.papers", "femubench.scenarios")
    if within(importer, "femubench.scenarios"):
        return within(imported, "femubench.scenarios")
    if within(importer, "femubench.reports"):
        return within(imported, "femubench.reports", "femubench.core.schema.results")
    # core and the facade
    return within(imported, "femubench.core") and not within(imported, "femubench.core.cli")


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_keep_to_the_rooms(path: Path) -> None:
    strangers = [name for name in imports_of(path) if not may_import(name_of(path), name)]
    assert strangers == []


def test_the_rule_itself_tells_right_from_wrong() -> None:
    assert may_import("femubench.plugins.strategies.baruch", "femubench")
    assert may_import("femubench.plugins.strategies.baruch", "femubench.plugins.strategies.tools")
    assert not may_import("femubench.plugins.strategies.baruch", "femubench.core.fem.model")
    assert not may_import("femubench.core.run.runner", "femubench.reports.terminal")
    assert not may_import("femubench.core.run.runner", "femubench.core.cli.main")
    assert not may_import("femubench.reports.markdown", "femubench.scenarios")
    assert not may_import("femubench.core.fem.model", "femubench.plugins")
    assert may_import("femubench.core.cli.run", "femubench.reports")
    assert may_import("femubench.reports.diagnosis_page", "femubench.plot")
    assert not may_import("femubench.core.diagnosis.serial", "femubench.plot")
    assert name_of(ROOT / "core" / "cli" / "run.py") == "femubench.core.cli.run"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_lengths(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < LONGEST_FILE
    functions = [
        node
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    long = [
        node.name
        for node in functions
        if (node.end_lineno or node.lineno) - node.lineno + 1 >= LONGEST_FUNCTION
    ]
    assert long == []


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_nothing_prints(path: Path) -> None:
    """Text for the user comes from the command line; a library that prints breaks its output."""
    if path.is_relative_to(ROOT / "core" / "cli") or path.is_relative_to(ROOT / "reports"):
        return
    printed = [
        node.lineno
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
    ]
    assert printed == []
