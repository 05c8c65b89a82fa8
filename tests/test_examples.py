"""Every public function has an example in its docstring, and does what the example says.

So do the methods of the objects that stand for many functions.
"""

from __future__ import annotations

import doctest
import importlib
import inspect
import io
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import femubench
from tests.toys import reproduction_toys

MODULES = (
    "femubench",
    *(
        f"femubench.{found.name}"
        for found in pkgutil.iter_modules(femubench.__path__)
        if not found.ispkg and not found.name.startswith("_")
    ),
)
# Names of public functions without an example; there is no reason to add one.
WITHOUT: frozenset[str] = frozenset()


def public_functions() -> dict[str, Callable[..., Any]]:
    """Return the functions that the public modules list, by name, each once."""
    found: dict[Callable[..., Any], str] = {}
    for module_name in MODULES:
        module = importlib.import_module(module_name)
        for name in module.__all__:
            value = getattr(module, name)
            if inspect.isfunction(value):
                found.setdefault(value, f"{module_name}.{name}")
            elif inspect.isclass(value):
                for method, held in vars(value).items():
                    kinds = ("fget", "func", "__func__", "__wrapped__")
                    own = next((getattr(held, k) for k in kinds if hasattr(held, k)), held)
                    if inspect.isfunction(own) and ">>> " in (own.__doc__ or ""):
                        found.setdefault(own, f"{module_name}.{name}.{method}")
    return {name: function for function, name in found.items()}


FUNCTIONS = public_functions()


def examples_of(thing: object, name: str, names: dict[str, Any]) -> doctest.DocTest:
    (test,) = doctest.DocTestFinder(recurse=False, exclude_empty=False).find(
        thing, name, globs=names
    )
    return test


def run(test: doctest.DocTest) -> None:
    """Run the examples of one docstring; what they assign stays in the names of the test."""
    stated = io.StringIO()
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    failed, _ = runner.run(test, out=stated.write, clear_globs=False)
    assert failed == 0, stated.getvalue()


@pytest.fixture(scope="module")
def common(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return the names that examples use: those of the lines in the docstring of `femubench`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("common"))
        patch.delenv("FEMUBENCH_STORE", raising=False)
        test = examples_of(femubench, "femubench", {})
        run(test)
    return test.globs


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_example_of(
    name: str, common: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("FEMUBENCH_STORE", raising=False)
    if name == "femubench.reproduce":
        # A paper takes half a minute; test_papers_*.py work through both of them.
        monkeypatch.setattr(
            "femubench.papers.study", lambda paper, _: reproduction_toys.study(paper)
        )
    test = examples_of(FUNCTIONS[name], name, dict(common))
    assert bool(test.examples) is (name not in WITHOUT), f"{name} has no example"
    run(test)


def test_examples_name_their_function() -> None:
    for name, function in FUNCTIONS.items():
        _, _, lines = (function.__doc__ or "").partition("    Examples:\n")
        # An object of a class may be at hand already, or be given by another call.
        own = name.removeprefix("femubench.") if "." not in function.__qualname__ else ""
        assert own in lines, name
        assert function.__name__ in lines, name


def test_public_modules_are_found() -> None:
    assert {"femubench", "femubench.fem", "femubench.modal", "femubench.plot"} <= set(MODULES)
    assert len(FUNCTIONS) > 100
