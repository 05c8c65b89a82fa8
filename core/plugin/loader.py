"""Find plugins through the entry-point group ``femubench`` and collect what they offer.

Built-ins and third parties take the same way in. Every plugin is loaded, checked and called on its
own: what is wrong with one is recorded in `Plugins.broken` and touches no other. What is offered by
reference is imported when it is used: a list of names costs none of the numerics behind them.
"""

from __future__ import annotations

import inspect
import tomllib
import traceback
from collections import UserDict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import pluggy

from femubench.core.errors import PluginError
from femubench.core.plugin import hookspecs
from femubench.core.plugin.markers import PROJECT
from femubench.core.plugin.validation import CHECKS, did_you_mean
from femubench.core.roles import Effect, Fault, Reader, Reporter, Scenario, Strategy
from femubench.core.version import __version__

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


class Offers(UserDict[str, Any]):
    """What plugins offer of one kind, by name, in the order of the plugins.

    Asking for an entry that was offered by reference loads it, and raises PluginError where that
    fails or where the entry does not fill its role.
    """

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - as the kind has it
        entry = self.data[name]
        if isinstance(entry, _Reference):
            entry = self.data[name] = entry.load()
        return entry


@dataclass(frozen=True)
class Plugins:
    """Everything that plugins offer, by name, and what is broken."""

    strategies: Mapping[str, Strategy] = field(default_factory=dict)
    scenarios: Mapping[str, Scenario] = field(default_factory=dict)
    effects: Mapping[str, Effect] = field(default_factory=dict)
    faults: Mapping[str, Fault] = field(default_factory=dict)
    readers: Mapping[str, Reader] = field(default_factory=dict)
    reporters: Mapping[str, Reporter] = field(default_factory=dict)
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


@dataclass(frozen=True)
class _Reference:
    """A thing that a plugin offers as ``module:Class``, to be loaded when it is used."""

    source: _Source
    kind: str
    target: EntryPoint

    @property
    def name(self) -> str:
        return self.target.name

    def load(self) -> Any:  # noqa: ANN401 - as the kind has it
        try:
            filled = CHECKS[self.kind](self.target.load())
            if filled.name != self.name:
                named = f"is named {filled.name!r} and offered as {self.name!r}"
                raise PluginError(f"{self.target.value} {named}")
        except _FAULTS as fault:
            raise PluginError(str(_broken(self.source, fault, PREFIX + self.kind))) from fault
        return filled


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
    found: dict[str, Offers] = {kind: Offers() for kind in CHECKS}
    loaded: list[LoadedPlugin] = []
    broken: list[BrokenPlugin] = []
    for source in sources:
        try:
            manager = _register(source)
        except _FAULTS as fault:
            broken.append(_broken(source, fault))
            continue
        offers = {
            kind: tuple(_collect(source, manager, kind, taken, broken))
            for kind, taken in found.items()
        }
        loaded.append(LoadedPlugin(source.name, source.distribution, offers))
    return Plugins(**found, loaded=tuple(loaded), broken=tuple(broken))


def registered_effects() -> tuple[Effect, ...]:
    """Return every effect that plugins offer, the built-in ones first.

    Examples:
        >>> torsion.name in [one.name for one in diagnosis.registered_effects()]
        True
    """
    return tuple(load_plugins().effects.values())


def registered_faults() -> tuple[Fault, ...]:
    """Return every fault of data or input that plugins offer."""
    return tuple(load_plugins().faults.values())


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
    file = Path(__file__).parents[3] / "pyproject.toml"
    if file.is_file():
        listed = tomllib.loads(file.read_text(encoding="utf-8"))["project"]["entry-points"][PROJECT]
        for name, module in sorted(listed.items()):
            point = EntryPoint(name, module, PROJECT)
            yield _Source(name, f"{PROJECT} {__version__}, not installed", point)


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
    taken: Offers,
    broken: list[BrokenPlugin],
) -> Iterator[str]:
    """Call one hook of one plugin; what passes the checks goes into `taken`."""
    hook = PREFIX + kind
    try:
        offered = list(_call(manager, hook))
    except _FAULTS as fault:
        broken.append(_broken(source, fault, hook))
        return
    for entry in offered:
        try:
            filled = (
                _Reference(source, kind, entry)
                if isinstance(entry, EntryPoint)
                else CHECKS[kind](entry)
            )
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
        if not isinstance(answer, Mapping):
            yield from answer
            continue
        for name, value in answer.items():
            if not isinstance(value, str) or not EntryPoint.pattern.match(value):
                raise PluginError(f"{name!r} is offered as {value!r}, not as 'module:Class'")
            yield EntryPoint(name, value, hook)


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
