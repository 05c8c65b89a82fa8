"""What the process of a third party's plugin says of it: the form of its answers, checked here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeVar

import msgspec
from msgspec import Struct

from femubench.core.errors import PluginError, harmless
from femubench.core.plugin.distribution import select_known
from femubench.core.plugin.importing import BrokenPlugin
from femubench.core.schema.validation import say_fault

LONGEST_DOC = 20_000  # characters
_Form = TypeVar("_Form")
# Texts that are more than a line, or no words of the plugin.
_AS_THEY_ARE = ("doc", "options", "about", "cases", "suffix", "suffixes")


class PluginDescription(Struct):
    """A plugin; what it offers by kind is read one by one, so that a faulty one spoils no other."""

    broken: list[BrokenPlugin]
    offers: dict[str, list[Any]]
    loaded: bool


class Description(Struct, kw_only=True):
    """One thing that is offered."""

    name: str
    doc: str = ""
    module: str = ""


class StrategyDescription(Description):
    """A strategy; `open` are the options that take further entries by name."""

    citation: str
    needs: tuple[str, ...]
    promises: tuple[str, ...] | str
    settings: tuple[str, ...]
    options: dict[str, bool | int | float | str | None]
    open: tuple[str, ...]
    about: dict[str, str]
    baseline: bool = False
    cost_reference: bool = False
    on_request: bool = False


class ScenarioDescription(Description):
    """A scenario, its cases with their folders; None for one that is made when it is asked for."""

    title: str
    cases: dict[str, str | None]
    classes: tuple[str, ...]
    default: bool = False


class EffectDescription(Description):
    """An effect."""

    summary: str


class FaultDescription(Description):
    """A fault of the data or of what was typed in."""

    side: Literal["data", "input"]


class ReaderDescription(Description):
    """A reader; `ways` is what it offers apart from the methods of every one."""

    suffixes: tuple[str, ...]
    ways: tuple[str, ...]


class ReporterDescription(Description):
    """A reporter; likewise."""

    suffix: str
    ways: tuple[str, ...]


KINDS: Mapping[str, type[Description]] = {
    "strategies": StrategyDescription,
    "scenarios": ScenarioDescription,
    "effects": EffectDescription,
    "faults": FaultDescription,
    "readers": ReaderDescription,
    "reporters": ReporterDescription,
    "papers": Description,
}


def read_description(kind: str, data: object) -> Any:  # noqa: ANN401 - as the kind has it
    """Return what is said of one thing, in words that no terminal obeys.

    Raises:
        PluginError: naming the first field that is wrong.
    """
    found = _read(KINDS[kind], data)
    for name in found.__struct_fields__:
        if name not in _AS_THEY_ARE:
            setattr(found, name, _harmless(getattr(found, name)))
    # The indentation tells paragraphs and sections of a docstring apart.
    lines = found.doc[:LONGEST_DOC].splitlines()
    found.doc = "\n".join(" " * (len(x) - len(x.lstrip())) + harmless(x) for x in lines)
    if isinstance(found, StrategyDescription):
        found.about = select_known(found.about)
    return found


def read_plugin(data: object) -> PluginDescription:
    """Return what is said of a plugin; raises PluginError likewise."""
    return _read(PluginDescription, data)


def _read(form: type[_Form], data: object) -> _Form:
    try:
        return msgspec.convert(data, form)
    except msgspec.ValidationError as error:
        raise PluginError(say_fault(form, data, error).lstrip(".")) from None


def _harmless(value: Any) -> Any:  # noqa: ANN401 - a text, several or none
    if isinstance(value, tuple):
        return tuple(map(harmless, value))
    return harmless(value) if isinstance(value, str) else value
