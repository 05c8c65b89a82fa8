"""Find plugins through the entry-point group ``femubench`` and collect what they offer.

What comes with femubench is imported here. Every other plugin is described by a process of its own,
and nothing of it is imported here to be listed. What is wrong with one is recorded in
`Plugins.broken` and touches no other. What a built-in offers by reference is imported when it is
used: a list of names costs none of the numerics behind them.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from femubench.core.errors import PluginError, harmless, harmless_lines
from femubench.core.plugin import apart
from femubench.core.plugin.apart import Origin
from femubench.core.plugin.foreign import Foreign, make_proxy
from femubench.core.plugin.importing import PREFIX, BrokenPlugin, Offers, Source, take
from femubench.core.plugin.markers import PROJECT
from femubench.core.plugin.validation import CHECKS, choose_names
from femubench.core.roles import Effect, Fault, Paper, Reader, Reporter, Scenario, StrategyRole
from femubench.core.source_files import stamps
from femubench.core.version import __version__

DESCRIBE = "femubench.core.plugin.describing:describe_plugin"
_LONGEST_MESSAGE = 2000  # characters
_MOST_FAULTS = 50  # of one plugin that are reported


@dataclass(frozen=True)
class LoadedPlugin:
    """A plugin in use.

    Arguments:
        plugin: name of the entry point.
        offers: the names of what it offers by kind.
        own: whether its code is imported here: it comes with femubench, or was given by hand.
    """

    plugin: str
    distribution: str
    offers: Mapping[str, tuple[str, ...]]
    own: bool = True


def show_entry(offers: Mapping[str, Any], name: str) -> Any:  # noqa: ANN401 - as the kind has it
    """Return an entry, of a third party's effect or fault what is known of it without its code."""
    entry = offers.data[name] if isinstance(offers, Offers) else None
    return entry if isinstance(entry, Foreign) else offers[name]


@dataclass(frozen=True)
class Plugins:
    """Everything that plugins offer, by name, and what is broken."""

    strategies: Mapping[str, StrategyRole] = field(default_factory=dict)
    scenarios: Mapping[str, Scenario] = field(default_factory=dict)
    effects: Mapping[str, Effect] = field(default_factory=dict)
    faults: Mapping[str, Fault] = field(default_factory=dict)
    readers: Mapping[str, Reader] = field(default_factory=dict)
    reporters: Mapping[str, Reporter] = field(default_factory=dict)
    papers: Mapping[str, Paper] = field(default_factory=dict)
    loaded: tuple[LoadedPlugin, ...] = ()
    broken: tuple[BrokenPlugin, ...] = ()


def load_plugins(
    points: Iterable[EntryPoint] | None = None,
    extra: Mapping[str, object] | None = None,
    *,
    third_parties: bool = True,
) -> Plugins:
    """Return what all plugins offer.

    Arguments:
        points: the entry points; by default all of the group ``femubench`` that are installed,
            and those of the clone that femubench is imported from where it is not installed.
        extra: further plugins by name, already imported.
        third_parties: whether plugins that did not come with femubench are described.
    """
    installed = tuple(entry_points(group=PROJECT) if points is None else points)
    sources = _installed(installed)
    if points is None and not any(source.own for source in sources):
        sources = [*_of_clone(), *sources]
    sources += [
        Source(name, "given by hand", given=plugin) for name, plugin in (extra or {}).items()
    ]
    found: dict[str, Offers] = {kind: Offers() for kind in CHECKS}
    loaded: list[LoadedPlugin] = []
    broken: list[BrokenPlugin] = []
    descriptions = _descriptions(
        [s.origin for s in sources if third_parties and s.origin is not None]
    )
    for source in sources:
        if source.origin is None:
            offers = take(source, found, broken)
            if offers is not None:
                loaded.append(LoadedPlugin(source.name, source.distribution, offers))
        elif third_parties:
            loaded += _believed(source.origin, descriptions[source.origin], found, broken)
    return Plugins(**found, loaded=tuple(loaded), broken=tuple(broken))


_known: dict[object, Any] = {}


def _descriptions(origins: Sequence[Origin]) -> dict[Origin, Any]:
    """Return what every plugin says of itself, or as text why it does not.

    A plugin is asked once, as long as its files stay as they are.
    """
    keys = {origin: (origin, tuple(sys.path), stamps(origin.top)) for origin in origins}
    new = [origin for origin, key in keys.items() if key not in _known]
    questions = [
        {"do": DESCRIBE, "origin": [one.plugin, one.value, one.distribution], "walled": True}
        for one in new
    ]
    for origin, answer in zip(new, apart.ask(questions), strict=True):
        _known[keys[origin]] = answer
    return {origin: _known[key] for origin, key in keys.items()}


def _believed(
    origin: Origin,
    description: Any,  # noqa: ANN401 - what a third party stated
    found: Mapping[str, Offers],
    broken: list[BrokenPlugin],
) -> Iterator[LoadedPlugin]:
    """Take what a third party's plugin says that it offers, where it fills its role."""
    if isinstance(description, str) or "fault" in description:
        message = (
            description
            if isinstance(description, str)
            else ": ".join(map(str, description["fault"]))
        )
        broken.append(_wrong(origin, "", message))
        return
    from femubench.core.plugin.description import read_plugin

    try:
        said = read_plugin(description)
    except PluginError as fault:
        broken.append(_wrong(origin, "", f"its description is none: {fault}"))
        return
    faults = [
        _wrong(origin, harmless(one.hook)[:80], one.message, harmless_lines(one.traceback))
        for one in said.broken
    ]
    offers = {
        kind: tuple(_described(origin, kind, said.offers.get(kind, ()), taken, faults))
        for kind, taken in found.items()
    }
    broken += faults[:_MOST_FAULTS]
    if len(faults) > _MOST_FAULTS:
        broken.append(_wrong(origin, "", f"and {len(faults) - _MOST_FAULTS} more faults"))
    if said.loaded:
        yield LoadedPlugin(origin.plugin, origin.distribution, offers, own=False)


def _described(
    origin: Origin, kind: str, offered: Iterable[Any], taken: Offers, broken: list[BrokenPlugin]
) -> Iterator[str]:
    for item in offered:
        try:
            entry = make_proxy(origin, kind, item)
            if entry.name in taken:
                raise PluginError(f"the name {entry.name!r} is taken by another of the {kind}")
        except PluginError as fault:
            broken.append(_wrong(origin, PREFIX + kind, str(fault)))
            continue
        taken[entry.name] = entry
        yield entry.name


def _wrong(origin: Origin, hook: str, message: str, trace: str = "") -> BrokenPlugin:
    clean = harmless(message)[:_LONGEST_MESSAGE]
    return BrokenPlugin(origin.plugin, origin.distribution, hook, clean, trace)


def list_effects(*plugins: str) -> tuple[Effect, ...]:
    """Return the effects that come with femubench, and all of some other plugins.

    Arguments:
        plugins: names of installed plugins, which are imported here.

    Raises:
        UnknownNameError: for another name.

    Examples:
        >>> torsion.name in [one.name for one in diagnosis.list_effects()]
        True
    """
    return tuple(_registered("effects", plugins))


def list_faults(*plugins: str) -> tuple[Fault, ...]:
    """Return the faults of data or input that come with femubench, and all of some other plugins.

    Arguments:
        plugins: names of installed plugins, which are imported here.

    Raises:
        UnknownNameError: for another name.
    """
    return tuple(_registered("faults", plugins))


@cache
def _own_plugins() -> Plugins:
    """Return what comes with femubench, loaded once."""
    return load_plugins(third_parties=False)


def _registered(kind: str, plugins: Sequence[str]) -> Iterator[Any]:
    found = load_plugins() if plugins else _own_plugins()
    choose_names("plugin", plugins, (plugin.plugin for plugin in found.loaded))
    offers: Offers = getattr(found, kind)
    for plugin in found.loaded:
        for name in plugin.offers[kind]:
            if plugin.own or plugin.plugin in plugins:
                yield offers[name]


def _installed(points: Iterable[EntryPoint]) -> list[Source]:
    """Return the entry points, the built-ins first so that no one can take their names.

    A built-in is what leads to a module of femubench, and to nothing that somebody else installed.
    """
    found = []
    for point in points:
        name, distribution = "", "no distribution"
        if point.dist is not None:
            about = point.dist.metadata  # read once: a look at the name alone reads the file too
            name = str(about["Name"])
            distribution = harmless(f"{name} {about['Version']}")
        module = EntryPoint.pattern.match(point.value)
        top = module and module["module"].partition(".")[0]
        own = top == PROJECT and name in ("", PROJECT)
        source = Source(harmless(point.name), distribution, point, own=own)
        found.append((not own, name, source))
    return [one[2] for one in sorted(found, key=lambda one: (*one[:2], one[2].name))]


def _of_clone() -> Iterator[Source]:
    """Return the built-ins as the clone's pyproject.toml lists them."""
    file = Path(__file__).parents[3] / "pyproject.toml"
    if file.is_file():
        listed = tomllib.loads(file.read_text(encoding="utf-8"))["project"]["entry-points"][PROJECT]
        for name, module in sorted(listed.items()):
            point = EntryPoint(name, module, PROJECT)
            yield Source(name, f"{PROJECT} {__version__}, not installed", point)
