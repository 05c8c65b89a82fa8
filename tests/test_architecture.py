"""The rules of the house, read off the source: who imports whom, and how long functions are."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("core", "papers", "plugins", "reports", "scenarios")
FILES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
FACADE = sorted((ROOT / "femubench").glob("*.py"))
LONGEST_FUNCTION = 60

# The rooms of `core/`: each may import those before it, and nothing after it.
ROOMS = (
    *(
        "version",
        "errors",
        "typing",
        "ties",
        "garbage",
        "files",
        "display",
        "pace",
        "roles",
        "schema",
    ),
    *("plugin", "fem", "modal", "identify", "change", "fit", "case", "twin", "update"),
    *("effect", "inference", "look", "advise"),
    *("score", "study", "drawing", "diagnosis", "plot"),
    *("run", "publish", "reproduction", "challenge", "conformance", "library", "cli"),
)


def name_of(path: Path) -> str:
    """Return the dotted name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts[:-1] if parts[-1] == "__init__" else parts
    return ".".join(parts if parts[0] == "femubench" else ("femubench", *parts))


MODULES = {name_of(path) for path in (*FILES, *FACADE)}


def imports_of(path: Path) -> Iterator[str]:
    """Return every module of ours that a file imports, wherever in the file; resolved.

    What only type checkers import counts: a reader follows it too.
    """
    own = name_of(path).split(".")
    package = own if path.name == "__init__.py" else own[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                yield inner if inner in MODULES else module


def room_of(module: str) -> int | None:
    """Return the number of the room of a module of `core/`; None outside of it."""
    parts = module.split(".")
    return ROOMS.index(parts[2]) if parts[:2] == ["femubench", "core"] and parts[2:] else None


def may_import(importer: str, imported: str) -> bool:
    """Tell whether one of our modules may import another."""

    def within(name: str, *packages: str) -> bool:
        return any(name == p or name.startswith(f"{p}.") for p in packages)

    if not within(imported, "femubench"):
        return True
    own, other = room_of(importer), room_of(imported)
    if own is not None:
        if own >= ROOMS.index("library") and not within(imported, "femubench.core"):
            return imported not in FACADE_NAMES
        return other is not None and other <= own
    if importer in FACADE_NAMES:
        return other is not None
    # Plugins, papers, reports and scenarios are written with the public names alone.
    if imported in FACADE_NAMES:
        return True
    if within(importer, "femubench.papers") and within(imported, "femubench.scenarios"):
        return True
    folder = ".".join(importer.split(".")[:2])
    return within(imported, folder)


FACADE_NAMES = {name_of(path) for path in FACADE}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_import_runs_upwards(path: Path) -> None:
    importer = name_of(path)
    strangers = sorted({name for name in imports_of(path) if not may_import(importer, name)})
    assert strangers == []


def test_every_room_is_in_the_list() -> None:
    found = {path.relative_to(ROOT / "core").parts[0] for path in (ROOT / "core").rglob("*.py")}
    assert {name.removesuffix(".py") for name in found} - {"__init__"} == set(ROOMS)


def test_no_imports_go_in_a_circle() -> None:
    graph = {name_of(path): {m for m in imports_of(path) if m in MODULES} for path in FILES}
    graph = {name: others - {name} for name, others in graph.items()}
    tuple(TopologicalSorter(graph).static_order())  # raises CycleError with the circle


def test_the_rule_itself_tells_right_from_wrong() -> None:
    assert may_import("femubench.plugins.strategies.baruch", "femubench.update")
    assert may_import("femubench.plugins.strategies.baruch", "femubench.plugins.strategies.tools")
    assert not may_import("femubench.plugins.strategies.baruch", "femubench.core.fem.model")
    assert not may_import("femubench.core.run.runner", "femubench.reports.terminal")
    assert not may_import("femubench.core.run.runner", "femubench.core.cli.main")
    assert not may_import("femubench.core.fem.model", "femubench.core.modal.eigen")
    assert not may_import("femubench.core.fem.model", "femubench")
    assert may_import("femubench.core.modal.eigen", "femubench.core.fem.model")
    assert not may_import("femubench.reports.markdown", "femubench.scenarios")
    assert not may_import("femubench.core.roles", "femubench.core.fem.model")
    assert may_import("femubench.core.cli.run", "femubench.reports")
    assert name_of(ROOT / "femubench" / "__init__.py") == "femubench"
    assert name_of(ROOT / "core" / "cli" / "run.py") == "femubench.core.cli.run"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_functions_read_in_one_piece(path: Path) -> None:
    functions = [
        node
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
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
