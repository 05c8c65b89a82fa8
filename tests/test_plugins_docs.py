"""docs/plugins.md against the code: hooks, roles, kinds, commands."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from femubench import Reader, Strategy
from femubench.core.plugin import hookspecs
from femubench.core.plugin.importing import HOOKS
from femubench.effect import Effect, Fault
from femubench.reproduction import Paper
from femubench.results import Reporter

DOCS = Path(__file__).parents[1] / "docs"
TEXT = (DOCS / "plugins.md").read_text(encoding="utf-8")
SECTIONS = {
    "femubench_strategies": "Strategies",
    "femubench_scenarios": "Scenarios",
    "femubench_effects": "Effects",
    "femubench_faults": "Faults",
    "femubench_readers": "Readers",
    "femubench_reporters": "Reporters",
    "femubench_papers": "Papers",
}
ROLES = {
    "Strategies": (Strategy, ("update",), tuple(Strategy.__annotations__)),
    "Effects": (Effect, ("places", "parameters", "extend"), ("name", "summary")),
    "Faults": (Fault, ("suspects",), ("name", "side")),
    "Readers": (Reader, ("read_matrix", "read_modes"), ("name", "suffixes")),
    "Reporters": (Reporter, ("render",), ("name", "suffix")),
    "Papers": (Paper, ("study",), ("name", "cases")),
}


def section(heading: str) -> str:
    """Return the text below a heading up to the next one."""
    (text,) = re.findall(rf"^##+ {heading}\n(.*?)(?=^##|\Z)", TEXT, re.DOTALL | re.MULTILINE)
    return str(text)


def signature(function: Callable[..., Any]) -> str:
    """Return ``name(argument, argument)`` without self."""
    names = [name for name in inspect.signature(function).parameters if name != "self"]
    return f"`{function.__name__}({', '.join(names)})`"


@pytest.mark.parametrize("hook", HOOKS)
def test_every_hook_has_a_section_with_its_arguments(hook: str) -> None:
    specification = getattr(hookspecs, hook)
    assert signature(specification) in section(SECTIONS[hook])
    assert signature(specification) in section("Hooks")


@pytest.mark.parametrize("heading", ROLES)
def test_every_member_of_a_role_is_told_with_its_arguments(heading: str) -> None:
    role, methods, attributes = ROLES[heading]
    text = section(heading)
    own = {name for name, _ in inspect.getmembers(role, inspect.isfunction) if name[0] != "_"}
    assert own - {"name"} == set(methods)
    for method in methods:
        assert f"| {signature(getattr(role, method))} |" in text
    for attribute in attributes:
        assert f"| `{attribute}` |" in text
