"""What a start loads and what an install brings: no clock, but the imports that cost."""

from __future__ import annotations

import ast
import json
import os
import re
import sys
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.validation import CHECKS
from tests.command import run_python

ROOT = Path(__file__).parents[1]
AS_ON_WINDOWS, TOYS = ROOT / "tests" / "as_on_windows", ROOT / "tests" / "toys"
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
ENDINGS = """
import json, sys
from pathlib import Path
import harness_toys as toys
from children import hoard, shout
from running import run_jobs
from femubench.core.child.limits import Limits
from femubench.core.child.workers import run_apart

parent = Path(sys.argv[1])
strategies = [toys.Softer(), toys.Looping(), toys.Exiting(3), toys.Parent(str(parent))]
run = run_jobs([toys.tiny_case()], strategies, jobs=2, timeout=3.0, sandbox="auto")
found = [[result.status, result.reason] for result in run.results]
most = {"memory": 2**28, "output": 2**20, "answer": 2**20}
tasks = {"memory": (hoard, 600 * 2**20), "output": (shout, 2**21), "answer": (bytes, 2**21)}
light = "femubench.core.child.limits"
ended = run_apart(tasks, Limits(60.0, **most), 3, light)
print(json.dumps([found, parent.read_text(), {key: e.how for key, e in ended.items()}]))
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
def test_every_page_of_the_package_is_there_without_an_import_of_its_own() -> None:
    pages = sorted(file.stem for file in (ROOT / "femubench").glob("[!_]*.py"))
    code = f"import femubench as f; print([getattr(f, p).__name__ for p in {pages}])"
    assert run_python("-c", code).stdout.strip() == str([f"femubench.{page}" for page in pages])


def test_dependencies_are_what_is_imported() -> None:
    found = {entry for path in FILES for entry in third_party(path)}
    extras = PROJECT["optional-dependencies"]
    needed = names(PROJECT["dependencies"])
    others = {"docs", "opensees", "test", "truths"}
    optional = names([text for extra in extras.keys() - others for text in extras[extra]])
    # pytest loads the plugin for pytest itself.
    assert {name for name, _ in found} == needed | optional | {"pytest"}
    assert not {name for name, at_once in found if at_once} & optional


@pytest.mark.slow(30)
def test_every_verb_works_as_on_windows_with_the_same_figures(tmp_path: Path) -> None:
    found, store, board = (str(tmp_path / name) for name in ("found.json", "store", "board.json"))
    effects = ("--effects", "torsion-constant", "--no-pairs")
    run = ("run", "frame", "-s", "berman", "--store", store, "--json")
    for words in (
        ("--help",),
        ("plugins", "list"),
        ("diagnose", "frame", *effects, "-q", "--json", found),
        ("report", found, "-f", "md"),
        (*run, board),
        ("store", "check", "--store", store),
    ):
        done = run_python("-c", RUN, *words, path=AS_ON_WINDOWS)
        says = "strategies run without a sandbox: namespaces are of Linux"
        assert done.stderr.startswith(says) if words[0] == "run" else not done.stderr
    usual = tmp_path / "usual.json"
    run_python("-c", RUN, *run, usual)
    errors = [json.loads(Path(file).read_bytes())["results"] for file in (board, usual)]
    kept = [[{**result, "seconds": 0, "provenance": 0} for result in side] for side in errors]
    assert kept[0] == kept[1]
    assert kept[0][0]["status"] == "ok"


@pytest.mark.slow(30)
def test_as_on_windows_what_takes_more_than_its_limits_is_ended(tmp_path: Path) -> None:
    places = os.pathsep.join(map(str, (AS_ON_WINDOWS, TOYS, ROOT, *filter(None, sys.path))))
    done = run_python(
        "-c", ENDINGS, tmp_path / "parent", env={**os.environ, "PYTHONPATH": places}, cwd=tmp_path
    )
    results, process, endings = json.loads(done.stdout.splitlines()[-1])
    assert results == [
        ["ok", ""],
        ["timeout", "no result within 3 s"],
        ["crashed", "the worker process ended with exit code 3"],
        ["timeout", "no result within 3 s"],
    ]
    with suppress(psutil.NoSuchProcess):  # else its new parent clears it away in a moment
        psutil.Process(int(process)).wait(30.0)
    assert endings == {"memory": "memory", "output": "output", "answer": "answer-size"}


def test_a_run_and_a_diagnosis_load_no_statistics() -> None:
    code = "import sys, femubench.core.run.runner, femubench.core.diagnosis.diagnose\n"
    code += "sys.exit('scipy.stats' in sys.modules)"
    run_python("-c", code)
