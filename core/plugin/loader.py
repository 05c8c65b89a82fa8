"""Find plugins through the entry-point group ``femubench`` and collect what they offer.

Built-ins and third parties take the same way in. Every plugin is loaded, checked and called on its
own: what is wrong with one is recorded in `Plugins.broken` and touches no other.
"""

from __future__ import annotations

import inspect
import tomllib
import traceback
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import pluggy

import femubench
from femubench.core.errors import PluginError
from femubench.core.plugin import hookspecs
from femubench.core.plugin.markers import PROJECT
from femubench.core.plugin.roles import Effect, Reader, Reporter, Scenario
from femubench.core.plugin.validation import CHECKS, did_you_mean
from femubench.core.update.strategy import Strategy

PREFIX = f"{PROJECT}_"
HOOKS = tuple(PREFIX + kind for kind in CHECKS)

# A plugin that calls sys.exit() on import is as broken as one that raises; Ctrl-C is the user's.
_FAULTS = (Exception, SystemExit)


@dataclass(frozen=True)
class BrokenPlugin:
    """What is wrong with a plugin, or with one thing that it offers.

    Arguments:
        plugin: name of the entry point.
        distribution: what was installed, with its version.
        hook: the hook concerned; empty when the plugin could not be loaded at all.
        message: one line.
        traceback: for whoever asks for it.
    """

    plugin: str
    distribution: str
    hook: str
    message: str
    traceback: str

    def __str__(self) -> str:
        where = f" in {self.hook}" if self.hook else ""
        return f"plugin {self.plugin!r} ({self.distribution}){where}: {self.message}"


@dataclass(frozen=True)
class LoadedPlugin:
    """A plugin in use and the names of what it offers by kind."""

    plugin: str
    distribution: str
    offers: Mapping[str, tuple[str, ...]]


@dataclass(frozen=True)
class Plugins:
    """Everything that plugins offer, by name, and what is broken."""

    strategies: dict[str, Strategy] = field(default_factory=dict)
    scenarios: dict[str, Scenario] = field(default_factory=dict)
    effects: dict[str, Effect] = field(default_factory=dict)
    readers: dict[str, Reader] = field(default_factory=dict)
    reporters: dict[str, Reporter] = field(default_factory=dict)
    loaded: tuple[LoadedPlugin, ...] = ()
    broken: tuple[BrokenPlugin, ...] = ()


@dataclass(frozen=True)
class _Source:
    """Where a plugin comes from: an entry point, or an object given by hand."""

    name: str
    distribution: str
    entry_point: EntryPoint | None = None
    given: object = None

    def load(self) -> object:
        return self.given if self.entry_point is None else self.entry_point.load()


def load_plugins(
    points: Iterable[EntryPoint] | None = None, extra: Mapping[str, object] | None = None
) -> Plugins:
    """Return what all plugins offer.

    Arguments:
        points: the entry points; by default all of the group ``femubench`` that are installed,
            and those of the clone that femubench is imported from where it is not installed.
        extra: further plugins by name, already imported.
    """
    installed = tuple(entry_points(group=PROJECT) if points is None else points)
    sources = list(_installed(installed))
    if points is None and not any(_package(point) == PROJECT for point in installed):
        sources = [*_of_clone(), *sources]
    sources += [
        _Source(name, "given by hand", given=plugin) for name, plugin in (extra or {}).items()
    ]
    plugins = Plugins()
    loaded: list[LoadedPlugin] = []
    broken: list[BrokenPlugin] = []
    for source in sources:
        try:
            manager = _register(source)
        except _FAULTS as fault:
            broken.append(_broken(source, fault))
            continue
        offers = {kind: tuple(_collect(source, manager, kind, plugins, broken)) for kind in CHECKS}
        loaded.append(LoadedPlugin(source.name, source.distribution, offers))
    return Plugins(
        plugins.strategies,
        plugins.scenarios,
        plugins.effects,
        plugins.readers,
        plugins.reporters,
        tuple(loaded),
        tuple(broken),
    )


def registered_effects() -> tuple[Effect, ...]:
    """Return every effect that plugins offer, the built-in ones first."""
    return tuple(load_plugins().effects.values())


class _HookError(PluginError):
    """A PluginError that knows its hook."""

    def __init__(self, hook: str, message: str) -> None:
        self.hook = hook
        super().__init__(message)


def _installed(points: Iterable[EntryPoint]) -> Iterator[_Source]:
    """Return the entry points, the built-ins first so that no one can take their names."""

    def order(point: EntryPoint) -> tuple[bool, str, str]:
        name = _package(point)
        return name != PROJECT, name, point.name

    for point in sorted(points, key=order):
        dist = point.dist
        distribution = "no distribution" if dist is None else f"{dist.name} {dist.version}"
        yield _Source(point.name, distribution, point)


def _package(point: EntryPoint) -> str:
    return "" if point.dist is None else point.dist.name


def _of_clone() -> Iterator[_Source]:
    """Return the built-ins as the clone's pyproject.toml lists them."""
    file = Path(femubench.__file__).parents[1] / "pyproject.toml"
    if file.is_file():
        listed = tomllib.loads(file.read_text(encoding="utf-8"))["project"]["entry-points"][PROJECT]
        for name, module in sorted(listed.items()):
            point = EntryPoint(name, module, PROJECT)
            yield _Source(name, f"{PROJECT} {femubench.__version__}, not installed", point)


def _register(source: _Source) -> pluggy.PluginManager:
    """Return a manager of this one plugin, so that a fault of another cannot reach it.

    Raises:
        PluginError: when a hook is misspelt, unmarked or has arguments that it cannot get.
    """
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(hookspecs)
    plugin = source.load()
    _check_spelling(plugin, manager)
    try:
        manager.register(plugin, source.name)
        manager.check_pending()
    except pluggy.PluginValidationError as fault:
        text = " ".join(str(fault).split())
        hook = next((name for name in HOOKS if repr(name) in text), "")
        raise _HookError(hook, text.removeprefix(f"Plugin {source.name!r} ")) from fault
    return manager


def _check_spelling(plugin: object, manager: pluggy.PluginManager) -> None:
    """Find functions that look like hooks or are marked as hooks and are none.

    pluggy's `check_pending` sees the marked ones only and cannot say what was meant.
    """
    for name in dir(plugin):
        options = manager.parse_hookimpl_opts(plugin, name)
        if options is not None:
            hook = options["specname"] or name
            if hook not in HOOKS and not options["optionalhook"]:
                raise _HookError(name, f"unknown hook {hook!r}{_or_known(hook)}")
            continue
        if not name.startswith(PREFIX):
            continue
        # A plugin may well import a module femubench_something: only functions count.
        if inspect.isroutine(inspect.getattr_static(plugin, name, None)):
            lacks = f"{name}() lacks the decorator @femubench.hookimpl"
            unknown = f"unknown hook {name!r}{_or_known(name)}"
            raise _HookError(name, lacks if name in HOOKS else unknown)


def _or_known(name: str) -> str:
    return did_you_mean(name, HOOKS) or f"; the hooks are {', '.join(HOOKS)}"


def _collect(
    source: _Source,
    manager: pluggy.PluginManager,
    kind: str,
    plugins: Plugins,
    broken: list[BrokenPlugin],
) -> Iterator[str]:
    """Call one hook of one plugin; what passes the checks goes into `plugins`."""
    hook = PREFIX + kind
    taken: dict[str, Any] = getattr(plugins, kind)
    try:
        offered = list(_call(manager, hook))
    except _FAULTS as fault:
        broken.append(_broken(source, fault, hook))
        return
    for entry in offered:
        try:
            filled = CHECKS[kind](entry)
            if filled.name in taken:
                raise PluginError(f"the name {filled.name!r} is taken by another of the {kind}")
        except _FAULTS as fault:
            broken.append(_broken(source, fault, hook))
            continue
        taken[filled.name] = filled
        yield filled.name


def _call(manager: pluggy.PluginManager, hook: str) -> Iterator[object]:
    """Call a hook and return one flat series of what its implementations gave."""
    caller = getattr(manager.hook, hook)
    answers = caller()
    # pluggy drops None, which is what a forgotten `return` gives.
    if len(answers) < len(caller.get_hookimpls()):
        raise PluginError("returned None instead of a list")
    for answer in answers:
        if isinstance(answer, (str, bytes)) or not isinstance(answer, Iterable):
            raise PluginError(f"returned {answer!r} instead of a list")
        yield from answer


def _broken(source: _Source, fault: BaseException, hook: str = "") -> BrokenPlugin:
    text = " ".join(str(fault).split())
    kind = type(fault).__name__
    message = text if isinstance(fault, PluginError) else f"{kind}: {text}" if text else kind
    return BrokenPlugin(
        source.name,
        source.distribution,
        fault.hook if isinstance(fault, _HookError) else hook,
        message,
        "".join(traceback.format_exception(fault)),
    )
