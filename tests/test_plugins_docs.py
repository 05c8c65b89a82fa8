"""docs/plugins.md against the code: hooks, roles, kinds, commands."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from femubench import Reader, Scenario, Strategy, UpdateResult
from femubench.core.cli.plugins import plugins
from femubench.core.library.new_package import KINDS, write_package
from femubench.core.plugin import hookspecs
from femubench.core.plugin.importing import HOOKS
from femubench.core.plugin.loader import load_plugins
from femubench.core.roles import CAPABILITIES
from femubench.effect import Effect, Fault, FrameEffect, Suspect
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


def test_what_goes_in_and_out_is_told() -> None:
    assert signature(FrameEffect.frame) in section("Effects")
    assert all(f"`{need}`" in section("Strategies") for need in CAPABILITIES)
    for made, heading in (
        (UpdateResult, "Strategies"),
        (Scenario, "Scenarios"),
        (Suspect, "Faults"),
    ):
        names = ", ".join(field.name for field in fields(made))
        assert f"{made.__name__}({names})`" in section(heading)


def test_every_kind_and_command_is_told() -> None:
    start = section("Start with a package")
    assert re.findall(r"^\| `(\w+)`", start, re.MULTILINE) == list(KINDS)
    for name in plugins.list_commands(None):  # type: ignore[arg-type]
        assert f"| `bench plugins {name}" in TEXT
        assert f"bench plugins {name}" in (DOCS / "commands.md").read_text(encoding="utf-8")


def test_timing_is_shown_as_the_template_has_it(tmp_path: Path) -> None:
    write_package("my-method", "strategy", tmp_path, load_plugins([]))
    written = (tmp_path / "my-method" / "tests" / "test_speed.py").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```python\n(.*?)```", section("How long it takes"), re.DOTALL)
    assert written.endswith(shown)


def test_links_lead_somewhere() -> None:
    for page in ("plugins.md", "tutorial.md"):
        text = (DOCS / page).read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([\w./-]+)(?:#[\w-]+)?\)", text):
            assert (DOCS / target).is_file(), f"{page} links to {target}"
