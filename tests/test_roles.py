"""The protocols of `core.roles`: the data classes play them, and so does who inherits nothing."""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributions import install_module
from mypy import api

from femubench import Strategy, UpdateResult
from femubench.core import roles
from femubench.core.case.reader import read_case
from femubench.core.plugin.validation import check_strategy
from tests.command import call_bench
from tests.test_cli import put_case
from tests.toys.duck import Duck

ROOT = Path(__file__).parents[1]
DUCK = ROOT / "tests" / "toys" / "duck.py"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Give a folder with a case and an installed strategy that inherits nothing."""
    install_module(tmp_path, "duckling", DUCK.read_text(encoding="utf-8"))
    put_case(tmp_path / "rod")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    sys.modules.pop("duckling", None)


def test_roles_import_nothing_of_ours_but_the_roots() -> None:
    tree = ast.parse((ROOT / "core" / "roles.py").read_text(encoding="utf-8"))
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    ours = {name for name in modules if name and name.startswith("femubench")}
    assert ours <= {"femubench.core.errors", "femubench.core.typing"}


def test_a_result_plays_its_role(tmp_path: Path) -> None:
    case = read_case(put_case(tmp_path / "rod"))
    assert isinstance(UpdateResult(case.model), roles.Result)
    assert not isinstance(case, roles.Result)


def test_a_strategy_that_inherits_nothing_is_one() -> None:
    assert Duck.__mro__ == (Duck, object)
    found = check_strategy(Duck)
    assert isinstance(found, roles.StrategyRole)
    assert (
        roles.list_declared(found, "needs") == roles.list_declared(found, "promises") == frozenset()
    )
    assert not isinstance(object(), roles.StrategyRole)
    assert not issubclass(Duck, Strategy)


@pytest.mark.slow(5)
def test_it_is_ranked_and_shown(here: Path) -> None:
    words = ["run", "rod", "-s", "duck", "-s", "unchanged", "-q", "--json", "run.json", "-j", "1"]
    call_bench(*words)
    results = {r["strategy"]: r for r in json.loads((here / "run.json").read_text())["results"]}
    assert results["duck"]["status"] == "ok"
    errors = {name: item["used"]["rms_percent"] for name, item in results.items()}
    assert errors["duck"] < errors["unchanged"]
    shown = call_bench("plugins", "show", "duck", code=None).output
    assert "nothing but frequencies" in shown


@pytest.mark.nightly
@pytest.mark.usefixtures("here")
def test_it_passes_the_checks() -> None:
    done = call_bench("plugins", "check", "duck")
    assert ", 0 failed, 0 warnings" in done.output


@pytest.mark.nightly
def test_type_checkers_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    report, errors, code = api.run(["--strict", str(DUCK)])
    assert (code, errors) == (0, ""), report
