"""What a plugin of a third party is asked, answered in a process in which its code may run.

Whatever it does there to the process is done to the answer on itself alone. Answers are plain data;
`foreign` makes of them what the rest of the program looks at.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

from femubench.core.plugin.apart import Origin
from femubench.core.plugin.distribution import about
from femubench.core.plugin.foreign import doc_of
from femubench.core.plugin.importing import (
    PREFIX,
    BrokenPlugin,
    Offers,
    describe_fault,
    import_offer,
    offers_of,
    source_of,
)
from femubench.core.plugin.options import options_of, with_options
from femubench.core.roles import Scenario, list_declared

_LONGEST_TRACE = 20_000  # characters
_WAYS = {
    "readers": (
        *("read_model", "read_pair", "read_remarks", "model_files", "read_nodes"),
        *("read_named_modes", "read_outline", "write_model", "write_pair", "read_responses"),
        "read_named_responses",
    ),
    "reporters": ("render_with", "render_bytes"),
}
_FLAGS = ("baseline", "cost_reference", "on_request")


def describe_plugin(origin: Origin, _: Mapping[str, Any]) -> dict[str, Any]:
    """Say what a plugin offers and what is wrong with it."""
    source = source_of(origin)
    broken: list[BrokenPlugin] = []
    offers: dict[str, list[dict[str, Any]]] = {}
    try:
        found = offers_of(source, broken)
    except BaseException as fault:  # of whatever kind: it is the plugin's own
        found = None
        broken.append(describe_fault(source, fault))
    for kind, offered in (found or {kind: Offers() for kind in _DESCRIBE}).items():
        offers[kind] = []
        for name in offered:
            try:
                offers[kind].append(_describe_offer(origin, kind, offered[name]))
            except BaseException as fault:
                broken.append(describe_fault(source, fault, PREFIX + kind))
    faults = [asdict(fault) for fault in broken]
    for item in faults:
        item["traceback"] = item["traceback"][-_LONGEST_TRACE:]
    return {"loaded": found is not None, "offers": offers, "broken": faults}


def _describe_offer(origin: Origin, kind: str, offered: Any) -> dict[str, Any]:  # noqa: ANN401 - of any role
    found = _DESCRIBE[kind](offered)
    if kind == "strategies":
        name = origin.distribution.rpartition(" ")[0]
        found["about"] = about(name, getattr(offered, "doi", ""))
    return found


def _strategy(strategy: Any) -> dict[str, Any]:  # noqa: ANN401 - with what it likes as well
    promises: object = list_declared(strategy, "promises")
    own: dict[str, object] = {}
    held: object = strategy
    if is_dataclass(held):
        own = {field.name: getattr(held, field.name) for field in fields(held)}
    mappings = [name for name, value in own.items() if isinstance(value, Mapping)]
    return {
        **_common(strategy),
        "citation": str(strategy.citation),
        "needs": sorted(list_declared(strategy, "needs")),
        "promises": sorted(promises) if isinstance(promises, frozenset) else repr(promises),
        "settings": [str(words) for words in getattr(strategy, "settings", ())],
        "options": options_of(strategy),
        "open": mappings,
        **{flag: bool(getattr(strategy, flag, False)) for flag in _FLAGS},
    }


def _scenario(scenario: Scenario) -> dict[str, Any]:
    folders = {
        str(name): str(folder.absolute()) if isinstance(folder, Path) else None
        for name, folder in scenario.cases.items()
    }
    return {
        "name": scenario.name,
        "title": str(scenario.title),
        "cases": folders,
        "classes": list(scenario.classes),
        "default": bool(scenario.default),
    }


def _reader(reader: Any) -> dict[str, Any]:  # noqa: ANN401 - a reader with what it likes as well
    ways = [name for name in _WAYS["readers"] if hasattr(reader, name)]
    return {**_common(reader), "suffixes": list(reader.suffixes), "ways": ways}


def _reporter(reporter: Any) -> dict[str, Any]:  # noqa: ANN401 - likewise
    ways = [name for name in _WAYS["reporters"] if callable(getattr(reporter, name, None))]
    return {**_common(reporter), "suffix": reporter.suffix, "ways": ways}


def _effect(effect: Any) -> dict[str, Any]:  # noqa: ANN401 - likewise
    return {**_common(effect), "summary": str(getattr(effect, "summary", "") or "")}


def _fault(fault: Any) -> dict[str, Any]:  # noqa: ANN401 - likewise
    return {**_common(fault), "side": fault.side}


def _common(offered: Any) -> dict[str, Any]:  # noqa: ANN401 - of any role
    own = type(offered)
    return {"name": str(offered.name), "doc": doc_of(offered), "module": own.__module__}


def describe_variant(origin: Origin, question: Mapping[str, Any]) -> dict[str, Any]:
    """Say what a strategy is with other options."""
    base = import_offer(origin, "strategies", question["name"])
    return _describe_offer(origin, "strategies", with_options(base, question["options"]))


def folder(origin: Origin, question: Mapping[str, Any]) -> dict[str, Any]:
    """Make the folder of a case."""
    scenario: Scenario = import_offer(origin, "scenarios", question["name"])
    return {"folder": str(scenario.folder(question["case"]).absolute())}


_DESCRIBE: Mapping[str, Callable[[Any], dict[str, Any]]] = {
    "strategies": _strategy,
    "scenarios": _scenario,
    "effects": _effect,
    "faults": _fault,
    "readers": _reader,
    "reporters": _reporter,
    "papers": _common,
}
