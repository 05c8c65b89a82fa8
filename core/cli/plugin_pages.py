"""What ``bench plugins show`` tells of a plugin, kind by kind."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path

from femubench.core.cli.registry import wrap_text
from femubench.core.plugin.foreign import Foreign, doc_of
from femubench.core.plugin.loader import Plugins, show_entry
from femubench.core.plugin.options import StatedOptions, options_of
from femubench.core.plugin.validation import CHECKS, KINDS
from femubench.core.roles import (
    Effect,
    Fault,
    Paper,
    Reader,
    Reporter,
    Scenario,
    StrategyRole,
    list_declared,
)

Row = tuple[str, str]

_ROLES = {kind: role for role, kind in KINDS.items()}
# Headings of docstrings: what follows is for programmers.
_SECTIONS = ("Arguments:", "Attributes:", "Raises:", "Returns:", "Source:", "Args:", "Parameters")
_PARAGRAPHS = 3


def pages_of(name: str, plugins: Plugins) -> Iterator[str]:
    """Return a page for everything that is offered by that name, else on the plugin as a whole.

    Arguments:
        name: of what a plugin offers, or of the plugin.
    """
    found = False
    for kind in CHECKS:
        offers = getattr(plugins, kind)
        if name in offers:
            found, offered = True, show_entry(offers, name)
            origin = next(one for one in plugins.loaded if name in one.offers.get(kind, ()))
            source = "from", f"{origin.distribution}, plugin {origin.plugin}"
            yield _page(f"{name}: {_ROLES[kind]}", _about(offered), [source, *_ROWS[kind](offered)])
    for plugin in plugins.loaded:
        if plugin.plugin == name and not found:
            offers = [(kind, ", ".join(names)) for kind, names in plugin.offers.items() if names]
            yield _page(f"{name}: plugin", (), [("from", plugin.distribution), *offers])


def _page(heading: str, paragraphs: Iterable[str], rows: Iterable[Row]) -> str:
    listed = list(rows)
    width = max(len(key) for key, _ in listed) + 2
    lines = [heading]
    for paragraph in paragraphs:
        lines += [wrap_text(paragraph, indent=2, hanging=2), ""]
    for key, value in listed:
        first = f"{key + ':':{width}}" if key else " " * width
        lines.append(wrap_text(value, indent=2, lead=first, hanging=width + 2))
    return "\n".join(lines)


def _about(offered: object) -> Iterator[str]:
    """Return the first paragraphs of a class's own docstring, up to its sections."""
    if isinstance(offered, Scenario):
        return
    text = doc_of(offered)
    for number, paragraph in enumerate(inspect.cleandoc(text).split("\n\n")):
        if number == _PARAGRAPHS or paragraph.lstrip().startswith(_SECTIONS):
            return
        if paragraph.strip():
            yield " ".join(paragraph.split())


def _strategy(strategy: StrategyRole) -> Iterator[Row]:
    yield "citation", strategy.citation
    yield "needs", ", ".join(sorted(list_declared(strategy, "needs"))) or "nothing but frequencies"
    if promises := list_declared(strategy, "promises"):
        yield "promises", ", ".join(sorted(promises))
    options = [f"{name} = {_value(value)}" for name, value in options_of(strategy).items()]
    options += [f"{name}.KEY = (none)" for name in _open_mappings(strategy)]
    for number, line in enumerate(options or ["none"]):
        yield "" if number else "options", line
    example = f":{options[0].replace(' ', '')}" if options and "(none)" not in options[0] else ""
    yield "run", f"bench run -s {strategy.name}{example}"


def _open_mappings(strategy: object) -> Iterator[str]:
    """Return options that take further entries by name, such as ``stiffness.ry=1e4``."""
    if isinstance(strategy, StatedOptions):
        yield from strategy.open
    elif is_dataclass(strategy):
        for field in fields(strategy):
            if isinstance(getattr(strategy, field.name), Mapping):
                yield field.name


def _value(value: object) -> str:
    """Return a value as the command line takes it."""
    if value is None:
        return "(none)"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _scenario(scenario: Scenario) -> Iterator[Row]:
    yield "title", scenario.title
    if scenario.classes:
        yield "classes", ", ".join(scenario.classes)
    for number, (name, folder) in enumerate(scenario.cases.items()):
        where = f" in {folder}" if isinstance(folder, Path) else ", made when it is asked for"
        yield "" if number else "cases", f"{name}{where}"
    yield "run", f"bench run {scenario.name}"


def _effect(effect: Effect) -> Iterator[Row]:
    yield "means", str(getattr(effect, "summary", "") or "not stated")
    yield "run", f"bench diagnose CASE --effects {effect.name}"


def _fault(fault: Fault) -> Iterator[Row]:
    yield "wrong", {"data": "what was measured", "input": "what was typed in"}[fault.side]
    yield "run", "bench diagnose CASE"


def _reader(reader: Reader) -> Iterator[Row]:
    yield "suffixes", ", ".join(reader.suffixes)
    yield (
        "run",
        f"name such a file in a case.toml, e.g. measurement.modes = modes{reader.suffixes[0]}",
    )


def _reporter(reporter: Reporter) -> Iterator[Row]:
    yield "suffix", reporter.suffix
    yield "run", f"bench report --format {reporter.name}"


def _paper(paper: Paper | Foreign) -> Iterator[Row]:
    if isinstance(paper, Paper):
        yield "cases", ", ".join(paper.cases)
    yield "run", f"bench reproduce {paper.name}"


_ROWS: dict[str, Callable[..., Iterator[Row]]] = {
    "strategies": _strategy,
    "scenarios": _scenario,
    "effects": _effect,
    "faults": _fault,
    "readers": _reader,
    "reporters": _reporter,
    "papers": _paper,
}
