"""The rules of the house, read off the source: who imports whom, what is there once, how much."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from benchmarks import line_budget

ROOT = Path(__file__).parents[1]
FOLDERS = ("core", "papers", "plugins", "reports", "scenarios")
FILES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
FACADE = sorted((ROOT / "femubench").glob("*.py"))
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
        "schema",
        "roles",
        "source_files",
        "child",
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


@cache
def nodes_of(path: Path) -> list[ast.AST]:
    """Return what the rules look at in the source of a file."""
    kinds = (ast.Import, ast.ImportFrom, ast.Call, ast.ClassDef, ast.Constant)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, kinds)]


def imports_of(path: Path) -> Iterator[str]:
    """Return every module of ours that a file imports, wherever in the file; resolved.

    What only type checkers import counts: a reader follows it too.
    """
    own = name_of(path).split(".")
    package = own if path.name == "__init__.py" else own[:-1]
    for node in nodes_of(path):
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


def test_no_import_runs_upwards() -> None:
    wrong = {
        (name_of(path), name)
        for path in FILES
        for name in imports_of(path)
        if not may_import(name_of(path), name)
    }
    assert sorted(wrong) == []


@pytest.mark.parametrize("folder", ["reports", "papers", "plugins", "scenarios"])
def test_core_meets_what_comes_along_as_plugins_alone(folder: str) -> None:
    """No import of it stands in `core/`, not even a late one or one by its name."""
    named = f"femubench.{folder}"
    named_in = {
        str(path.relative_to(ROOT))
        for path in (ROOT / "core").rglob("*.py")
        if any(name == named or name.startswith(f"{named}.") for name in imports_of(path))
        or any(
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and node.value.startswith(named)
            for node in nodes_of(path)
        )
    }
    assert named_in == set()
    assert not may_import("femubench.core.cli.run", named)
    assert not may_import("femubench.core.library.report", f"{named}.anything")


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
    assert may_import("femubench.core.cli.run", "femubench.core.library.report")
    assert not may_import("femubench.core.cli.run", "femubench")
    assert name_of(ROOT / "femubench" / "__init__.py") == "femubench"
    assert name_of(ROOT / "core" / "cli" / "run.py") == "femubench.core.cli.run"


def test_nothing_prints() -> None:
    """Text for the user comes from the command line; a library that prints breaks its output."""
    speaking = (ROOT / "core" / "cli", ROOT / "reports")
    printed = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in FILES
        if not any(path.is_relative_to(folder) for folder in speaking)
        for node in nodes_of(path)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
    ]
    assert printed == []


def test_a_class_name_stands_once() -> None:
    """Else two things are called the same, or one thing is there twice."""
    names = Counter(
        node.name
        for path in FILES
        if path.relative_to(ROOT).parts[0] != "scenarios"
        for node in nodes_of(path)
        if isinstance(node, ast.ClassDef)
    )
    more = {name: times for name, times in names.items() if times > 1}
    assert more == {}, "a class of that name is there already: use it, or find a better name"


def made_tree(root: Path) -> Path:
    """Write ten lines into `core/fem`, three into `core/` and `tests/`, and a link to them."""
    for name, count in (("core/fem/a.py", 10), ("core/b.py", 3), ("tests/c.py", 3)):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("x = 1\n" * count, encoding="utf-8")
    (root / "core" / "fem" / "table.csv").write_text("1\n" * 99, encoding="utf-8")
    (root / "femubench").mkdir()
    (root / "femubench" / "core").symlink_to(root / "core")
    (root / "core" / "fem" / "again.py").symlink_to(root / "core" / "b.py")
    return root


def test_lines_are_counted_by_room_and_once(tmp_path: Path) -> None:
    lines = line_budget.lines_by_room(made_tree(tmp_path))
    assert {room: count for room, count in lines.items() if count} == {
        line_budget.ALL: 13, "core": 3, "core/fem": 10, "tests": 3,
    }  # fmt: skip
    assert set(line_budget.lines_by_room(ROOT)) == set(line_budget.BUDGETS)


def test_a_room_over_its_budget_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tree, whole = made_tree(tmp_path), {"package": 13, "core": 3, "core/fem": 10, "tests": 3}
    assert line_budget.main(tree, whole) == 0
    assert " lines, " not in capsys.readouterr().out
    assert line_budget.main(tree, {**whole, "core/fem": 9}) == 1
    says = "core/fem has 10 lines, 1 more than its budget of 9: shorten"
    assert says in capsys.readouterr().out


def test_a_room_without_a_budget_has_none(tmp_path: Path) -> None:
    made_tree(tmp_path)
    (tmp_path / "core" / "new").mkdir()
    (tmp_path / "core" / "new" / "d.py").write_text("x = 1\n", encoding="utf-8")
    lines = line_budget.lines_by_room(tmp_path)
    (found,) = line_budget.excesses(lines, line_budget.BUDGETS)
    assert found.startswith("core/new has 1 lines, 1 more than its budget of 0")
