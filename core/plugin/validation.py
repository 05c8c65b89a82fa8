"""What a plugin hands over must fill its role; a message says which argument does not."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from femubench.core.errors import PluginError, UnknownNameError
from femubench.core.roles import (
    CAPABILITIES,
    Effect,
    Fault,
    Paper,
    Reader,
    Reporter,
    Scenario,
    StrategyRole,
    list_declared,
)

# Names become words on the command line and parts of file names.
_WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*")
_GROUPED = re.compile(rf"({_WORD.pattern}/)?{_WORD.pattern}")


def check_strategy(offered: object) -> StrategyRole:
    """Return an instance of a strategy class or the instance itself.

    Raises:
        PluginError: when it has no update(), name or citation, or needs the unknown.
    """
    strategy: StrategyRole = _filled(offered, "Strategy", "update")
    if not _is_text(getattr(strategy, "citation", None)):
        raise PluginError(f"{_label(offered)}: citation is missing (author, year, title, equation)")
    needs: object = list_declared(strategy, "needs")
    if not isinstance(needs, frozenset | set | tuple | list):
        raise PluginError(f"{_label(offered)}: needs is {needs!r}, not a set of capabilities")
    for need in needs:
        if need not in CAPABILITIES:
            raise PluginError(
                f"{_label(offered)}: needs {need!r}, which is none of "
                f"{', '.join(CAPABILITIES)}{did_you_mean(str(need), CAPABILITIES)}"
            )
    return strategy


def check_scenario(offered: object) -> Scenario:
    """Return a scenario whose cases carry its name.

    Raises:
        PluginError: when it is no Scenario, or its cases or classes are none.
    """
    if not isinstance(offered, Scenario):
        raise PluginError(f"{_label(offered)} is not a femubench.Scenario")
    _check_name(offered, offered, _GROUPED)
    if not isinstance(offered.cases, Mapping) or not offered.cases:
        raise PluginError(f"scenario {offered.name!r}: cases is not a mapping of names to folders")
    for name, folder in offered.cases.items():
        part = str(name).removeprefix(f"{offered.name}/")
        if name != offered.name and (part == name or not _WORD.fullmatch(part)):
            raise PluginError(
                f"scenario {offered.name!r}: case {name!r} is neither "
                f"'{offered.name}' nor '{offered.name}/PART'"
            )
        if not isinstance(folder, Path) and not callable(folder):
            raise PluginError(
                f"scenario {offered.name!r}: folder of {name!r} is not a pathlib.Path"
            )
    if not isinstance(offered.classes, tuple) or not all(map(_is_text, offered.classes)):
        raise PluginError(f"scenario {offered.name!r}: classes is no tuple of words")
    return offered


def check_reader(offered: object) -> Reader:
    """Return a reader with lower-case suffixes.

    Raises:
        PluginError: when it lacks a method, a name or a suffix.
    """
    # The name of a reader is for messages alone and may have blanks.
    reader: Reader = _filled(offered, "Reader", "read_matrix", "read_modes", pattern=None)
    suffixes = getattr(reader, "suffixes", None)
    if not isinstance(suffixes, (tuple, list)) or not suffixes:
        raise PluginError(
            f"{_label(offered)}: suffixes is {suffixes!r}, not a tuple like ('.unv',)"
        )
    for suffix in suffixes:
        if not isinstance(suffix, str) or suffix[:1] != "." or suffix != suffix.lower():
            raise PluginError(f"{_label(offered)}: suffix {suffix!r} is not like '.unv'")
    return reader


def check_reporter(offered: object) -> Reporter:
    """Return a reporter with a file suffix.

    Raises:
        PluginError: when it lacks its method, a name or a suffix.
    """
    reporter: Reporter = _filled(offered, "Reporter", "render")
    suffix = getattr(reporter, "suffix", None)
    if not isinstance(suffix, str) or not re.fullmatch(r"\.[A-Za-z0-9.]+", suffix):
        raise PluginError(f"{_label(offered)}: suffix {suffix!r} is not like '.md'")
    return reporter


def check_effect(offered: object) -> Effect:
    """Return an effect; raises PluginError when it lacks a method or a name."""
    effect: Effect = _filled(offered, "Effect", "places", "parameters", "extend")
    return effect


def check_fault(offered: object) -> Fault:
    """Return a fault of the data or of what was typed in.

    Raises:
        PluginError: when it lacks its method, a name or its side.
    """
    fault: Fault = _filled(offered, "Fault", "suspects")
    if getattr(fault, "side", None) not in ("data", "input"):
        given = getattr(fault, "side", None)
        raise PluginError(f"{_label(offered)}: side is {given!r}, neither 'data' nor 'input'")
    return fault


def check_paper(offered: object) -> Paper:
    """Return a paper; raises PluginError when it lacks its method, a name or its cases."""
    paper: Paper = _filled(offered, "Paper", "study")
    cases = getattr(paper, "cases", None)
    if not isinstance(cases, (tuple, list)) or not all(map(_is_text, cases)):
        raise PluginError(f"{_label(offered)}: cases is {cases!r}, not a tuple of names")
    return paper


CHECKS: Mapping[str, Callable[[object], Any]] = {
    "strategies": check_strategy,
    "scenarios": check_scenario,
    "effects": check_effect,
    "faults": check_fault,
    "readers": check_reader,
    "reporters": check_reporter,
    "papers": check_paper,
}


# Role: the collection of `Plugins` that holds what fills it.
KINDS = {
    "strategy": "strategies",
    "effect": "effects",
    "fault": "faults",
    "reader": "readers",
    "scenario": "scenarios",
    "reporter": "reporters",
    "paper": "papers",
}


def did_you_mean(word: str, known: Any) -> str:  # noqa: ANN401 - any iterable of names
    """Return ``; did you mean 'x'?`` for a near match, else nothing."""
    near = get_close_matches(word, list(known), n=3, cutoff=0.6)
    return f"; did you mean {' or '.join(repr(name) for name in near)}?" if near else ""


def unknown(
    kind: str, name: str, known: Iterable[str], otherwise: str | None = None
) -> UnknownNameError:
    """Return an error on an unknown name with the near matches, or else with all names."""
    known = tuple(dict.fromkeys(known))
    otherwise = otherwise or f"there are {', '.join(known) or 'none'}"
    near = did_you_mean(name, known) or f"; {otherwise}"
    return UnknownNameError(f"no {kind} {name!r}{near}")


def choose_names(kind: str, names: Iterable[str], known: Iterable[str]) -> tuple[str, ...]:
    """Return the names without repetition; raises UnknownNameError for a name that is not known."""
    known = tuple(known)
    unique = tuple(dict.fromkeys(names))
    for name in unique:
        if name not in known:
            raise unknown(kind, name, known)
    return unique


def check_name(filled: object) -> None:
    """Make sure that a name is one word; raises PluginError when it is none."""
    _check_name(filled, filled, _WORD)


def _instance(offered: object) -> object:
    """Return what was offered, made without arguments when it is a class."""
    if not inspect.isclass(offered):
        return offered
    if inspect.isabstract(offered):
        missing = ", ".join(sorted(getattr(offered, "__abstractmethods__", ())))
        raise PluginError(f"{_label(offered)} does not override {missing}()")
    try:
        return offered()
    except TypeError as fault:
        raise PluginError(f"{_label(offered)} cannot be made without arguments: {fault}") from fault


def _filled(
    offered: object, role: str, *methods: str, pattern: re.Pattern[str] | None = _WORD
) -> Any:  # noqa: ANN401
    """Return an instance that has the methods and the name of a role."""
    filled: Any = _instance(offered)
    for method in methods:
        if not callable(getattr(filled, method, None)):
            what = f"is not a femubench.{role}: {method}() is missing"
            raise PluginError(f"{_label(offered)} {what}")
    _check_name(filled, offered, pattern)
    return filled


def _check_name(filled: object, offered: object, pattern: re.Pattern[str] | None) -> None:
    name = getattr(filled, "name", None)
    if not _is_text(name):
        raise PluginError(f"{_label(offered)}: name is missing")
    if pattern is not None and not pattern.fullmatch(str(name)):
        raise PluginError(f"{_label(offered)}: name {name!r} is not one word of letters, digits, -")


def _is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _label(offered: object) -> str:
    """Return a short name of an object for messages."""
    if inspect.isclass(offered):
        return f"class {offered.__qualname__}"
    if isinstance(offered, (str, int, float, bytes, type(None))):
        return repr(offered)
    return f"a {type(offered).__qualname__}"
