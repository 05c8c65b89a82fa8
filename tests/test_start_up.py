"""What a start loads and what an install brings: no clock, but the imports that cost."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.validation import CHECKS
from tests.command import run_python

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
ROOMS = ("core", "papers", "plugins", "reports", "scenarios", "femubench")
FILES = sorted({path.resolve() for room in ROOMS for path in (ROOT / room).rglob("*.py")})
# What a list of names has no use for.
HEAVY = {
    *("scipy", "pandas", "matplotlib", "pydantic", "pydantic_core", "rich", "jinja2", "psutil"),
    *("tabulate", "threadpoolctl", "tomlkit", "pyuff", "pyarrow"),
}
# Imported under a name of its own, as the package that brings it documents.
PART_OF = {"pydantic_core": "pydantic", "markupsafe": "jinja2", "pyoma2": "pyoma_2"} | {
    "ansys": "ansys_mapdl_reader",
    "sksparse": "scikit_sparse",
    "dask": "distributed",
    "skfem": "scikit_fem",
}
RUN = """
import sys
from femubench.core.cli.main import bench
try:
    bench(sys.argv[1:])
except SystemExit as end:
    print("\\n" + " ".join(sys.modules))
    raise
"""

# As on Windows, whose Python has no such modules; other packages have ways of their own there.
AS_ON_WINDOWS = """
import builtins
real = builtins.__import__
def refusing(name, globals=None, *more, **words):
    mine = str((globals or {}).get("__name__")).startswith("femubench")
    if mine and name in ("fcntl", "resource"):
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return real(name, globals, *more, **words)
builtins.__import__ = refusing
"""


def started(words: str) -> tuple[int, str, set[str]]:
    """Return exit code, stderr and modules of ``bench`` in a fresh interpreter."""
    done = run_python("-c", RUN, *words.split(), code=None)
    return done.returncode, done.stderr, set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("plugins list", ""),
        ("run --help", ""),
        ("run -s barcuh", "no strategy 'barcuh'; did you mean 'baruch'"),
        ("diagnose frame --effects desnity", "no effect 'desnity'; did you mean 'density'"),
        ("report -f htlm", "no report format 'htlm'; did you mean 'html'"),
        ("plugins check barcuh", "'barcuh'; did you mean 'baruch'"),
    ],
)
def test_names_are_looked_up_without_the_numerics(words: str, says: str) -> None:
    code, stderr, modules = started(words)
    assert code == (2 if says else 0), stderr
    assert says in stderr
    assert "femubench.core.plugin.loader" in modules
    assert not {module.partition(".")[0] for module in modules} & HEAVY
    own = re.compile(r"femubench\.(plugins\.\w+|reports|scenarios)\.\w+")
    assert not [module for module in modules if own.fullmatch(module)]


def test_every_builtin_loads_under_the_name_it_is_offered_by() -> None:
    plugins = load_plugins()
    for kind in CHECKS:
        offered = getattr(plugins, kind)
        assert len(offered) > 0
        assert [offer.name for offer in offered.values()] == list(offered)


def third_party(path: Path) -> Iterator[tuple[str, bool]]:
    """Return the packages of others that a file imports, and whether as soon as it is loaded."""
    open_: list[tuple[ast.AST, bool]] = [(ast.parse(path.read_text(encoding="utf-8")), True)]
    while open_:
        node, at_once = open_.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        modules += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        for name in (module.partition(".")[0] for module in modules):
            if name not in sys.stdlib_module_names and name != "femubench":
                yield PART_OF.get(name, name), at_once
        at_once = at_once and not isinstance(node, ast.FunctionDef)
        if not isinstance(node, ast.expr):
            open_ += [(inner, at_once) for inner in ast.iter_child_nodes(node)]


def names(requirements: list[str]) -> set[str]:
    """Return the packages that requirements name."""
    return {re.split(r"[^\w-]", text)[0].lower().replace("-", "_") for text in requirements}


@pytest.mark.slow(10)
def test_dependencies_are_what_is_imported() -> None:
    found = {entry for path in FILES for entry in third_party(path)}
    extras = PROJECT["optional-dependencies"]
    needed = names(PROJECT["dependencies"])
    others = {"docs", "opensees", "test", "truths"}
    optional = names([text for extra in extras.keys() - others for text in extras[extra]])
    # pytest loads the plugin for pytest itself.
    assert {name for name, _ in found} == needed | optional | {"pytest"}
    assert not {name for name, at_once in found if at_once} & optional


@pytest.mark.slow(10)
def test_without_modules_of_unix_all_but_runs_works_and_that_is_one_line(tmp_path: Path) -> None:
    found, store = str(tmp_path / "found.json"), str(tmp_path / "store")
    effects = ("--effects", "torsion-constant", "--no-pairs")
    for words, code in (
        (("--help",), 0),
        (("plugins", "list"), 0),
        (("diagnose", "frame", *effects, "-q", "--json", found), 0),
        (("report", found, "-f", "md"), 0),
        (("run", "frame", "-s", "unchanged", "--store", store), 2),
    ):
        done = run_python("-c", AS_ON_WINDOWS + RUN, *words, code=code)
        assert len(done.stderr.splitlines()) == (code > 0), done.stderr
        assert code == 0 or "takes Linux or macOS (on Windows WSL)" in done.stderr


def test_a_run_and_a_diagnosis_load_no_statistics() -> None:
    code = "import sys, femubench.core.run.runner, femubench.core.diagnosis.diagnose\n"
    code += "sys.exit('scipy.stats' in sys.modules)"
    run_python("-c", code)
