"""Import one plugin and collect what it offers, apart from all others.

What is wrong with one thing that a plugin offers is recorded and touches nothing else. It runs in
this process for what comes with femubench, and in processes of their own for third-party plugins.
"""

from __future__ import annotations

import inspect
import traceback
from abc import ABC, abstractmethod
from collections import UserDict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from typing import Any

import pluggy

from femubench.core.errors import PluginError
from femubench.core.plugin import hookspecs
from femubench.core.plugin.apart import Origin
from femubench.core.plugin.markers import PROJECT
from femubench.core.plugin.validation import CHECKS, did_you_mean

PREFIX = f"{PROJECT}_"
HOOKS = tuple(PREFIX + kind for kind in CHECKS)

# A plugin that calls sys.exit() on import is as broken as one that raises; Ctrl-C is the user's.
_FAULTS = (Exception, SystemExit)


@dataclass(frozen=True)
class BrokenPlugin:
    """What is wrong with a plugin, or with one thing that it offers.

    Arguments:
        plugin: name of the entry point.
        hook: the hook concerned; empty when the plugin could not be loaded at all.
        message: one line.
    """

    plugin: str
    distribution: str
    hook: str
    message: str
    traceback: str

    def __str__(self) -> str:
        where = f" in {self.hook}" if self.hook else ""
        return f"plugin {self.plugin!r} ({self.distribution}){where}: {self.message}"


class Later(ABC):
    """Something that a plugin offers, to be imported when it is used."""

    @abstractmethod
    def load(self) -> Any:  # noqa: ANN401 - as the kind has it
        """Import and return it.

        Raises:
            PluginError: when that fails, or it does not fill its role.
        """


class Offers(UserDict[str, Any]):
    """What plugins offer of one kind, by name, in the order of the plugins.

    Asking for an entry that was offered by reference loads it, and so does asking for an effect, a
    fault or a paper of a third party, which imports its plugin here. Both raise PluginError where
    that fails or where the entry does not fill its role.
    """

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - as the kind has it
        entry = self.data[name]
        if isinstance(entry, Later):
            entry = self.data[name] = entry.load()
        return entry


@dataclass(frozen=True)
class Source:
    """Where a plugin comes from: an entry point, or an object given by hand.

    Arguments:
        own: whether its code may be imported here.
    """

    name: str
    distribution: str
    entry_point: EntryPoint | None = None
    given: object = None
    own: bool = True

    @property
    def origin(self) -> Origin | None:
        """Return the entry point of a third party; None of what comes along or is given by hand."""
        point = self.entry_point
        if point is None or self.own:
            return None
        return Origin(self.name, point.value, self.distribution)

    def load(self) -> object:
        """Return the module or the object.

        Raises:
            PluginError: where the entry point names neither.
        """
        point = self.entry_point
        if point is None:
            return self.given
        if EntryPoint.pattern.match(point.value) is None:
            raise PluginError(f"its entry point is {point.value!r}, expected 'module:object'")
        return point.load()


@dataclass(frozen=True)
class _Reference(Later):
    """A thing that a plugin offers as ``module:Class``, to be loaded when it is used."""

    source: Source
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
            raise PluginError(
                str(describe_fault(self.source, fault, PREFIX + self.kind))
            ) from fault
        return filled


def take(
    source: Source, found: Mapping[str, Offers], broken: list[BrokenPlugin]
) -> dict[str, tuple[str, ...]] | None:
    """Import a plugin here and take what it offers.

    Arguments:
        found, broken: by kind what there is already, and what is wrong; both grow.

    Returns:
        The names of what was taken by kind; None where it is no plugin.
    """
    try:
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
    except _FAULTS as fault:
        broken.append(describe_fault(source, fault))
        return None
    return {
        kind: tuple(_collect(source, manager, kind, offers, broken))
        for kind, offers in found.items()
    }


def source_of(origin: Origin) -> Source:
    """Return the source that an entry point stands for."""
    point = EntryPoint(origin.plugin, origin.value, PROJECT)
    return Source(origin.plugin, origin.distribution, point)


def offers_of(source: Source, broken: list[BrokenPlugin]) -> dict[str, Offers] | None:
    """Import one plugin here and return what it offers by kind, None where it is no plugin.

    What is wrong goes on the list.
    """
    found: dict[str, Offers] = {kind: Offers() for kind in CHECKS}
    return None if take(source, found, broken) is None else found


def import_offer(origin: Origin, kind: str, name: str) -> Any:  # noqa: ANN401 - as the kind has it
    """Import a third party's plugin here and return one thing that it offers.

    Raises:
        PluginError: when it cannot be imported or does not offer the thing.
    """
    broken: list[BrokenPlugin] = []
    offered: Mapping[str, Any] = (offers_of(source_of(origin), broken) or {}).get(kind, {})
    if name not in offered:
        plain = f"plugin {origin.plugin!r} ({origin.distribution}) does not offer {name!r}"
        raise PluginError(str(broken[0]) if broken else plain)
    return offered[name]


class _HookError(PluginError):
    """A PluginError that knows its hook."""

    def __init__(self, hook: str, message: str) -> None:
        self.hook = hook
        super().__init__(message)


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
    source: Source,
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
        broken.append(describe_fault(source, fault, hook))
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
            broken.append(describe_fault(source, fault, hook))
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


def describe_fault(source: Source, fault: BaseException, hook: str = "") -> BrokenPlugin:
    """Return what is wrong with a plugin, or with what it offers under a hook."""
    try:
        text = " ".join(str(fault).split())
    except Exception:
        text = ""
    kind = type(fault).__name__
    message = text if isinstance(fault, PluginError) else f"{kind}: {text}" if text else kind
    return BrokenPlugin(
        source.name,
        source.distribution,
        fault.hook if isinstance(fault, _HookError) else hook,
        message,
        "".join(traceback.format_exception(fault)),
    )
