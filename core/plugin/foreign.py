"""What plugins of third parties offer, known from a description and never imported to be listed.

A `ForeignStrategy` is imported where its `update` is called, which is in a worker; folders of cases
are made and reports are written in processes of their own. An effect, a fault, a paper and a reader
work on models and are imported by anyone who uses one by its name.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femubench.core.errors import PluginError, harmless
from femubench.core.plugin import apart
from femubench.core.plugin.apart import Origin
from femubench.core.plugin.importing import Later, import_offer
from femubench.core.plugin.options import StatedOptions, with_options
from femubench.core.plugin.validation import CHECKS, check_name
from femubench.core.roles import Scenario

if TYPE_CHECKING:
    from femubench.core.schema.results import RunData

# What answers a question in a process of its own.
_VARY = "femubench.core.plugin.describing:describe_variant"
_FOLDER = "femubench.core.plugin.describing:folder"
_RENDER = "femubench.core.library.report:write_apart"
_MAKING = 3600.0  # s that a case or a report may take to be made
_LARGEST_REPORT = 256 * 2**20  # bytes


@dataclass(frozen=True)
class Handle:
    """One thing that a plugin offers; small, and sent to other processes instead of the thing."""

    origin: Origin
    kind: str
    name: str

    def load(self) -> Any:  # noqa: ANN401 - as the kind has it
        """Import the plugin in this process and return the thing.

        Raises:
            PluginError: when it cannot be imported or does not offer the thing.
        """
        return import_offer(self.origin, self.kind, self.name)


@dataclass(frozen=True)
class Described:
    """What is known of a thing without its code: whatever its description says is an attribute."""

    handle: Handle
    said: Any

    @property
    def name(self) -> str:
        """Return its name."""
        return self.handle.name

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - as the description has it
        if name.startswith("_") or "said" not in self.__dict__:
            raise AttributeError(name)
        return getattr(self.said, name)

    def load(self) -> Any:  # noqa: ANN401 - as the kind has it
        """Import the plugin in this process and return the thing."""
        return self.handle.load()


class Foreign(Described, Later):
    """An effect, a fault or a paper of a third party."""


@dataclass(frozen=True)
class ForeignStrategy(Described, StatedOptions):
    """A strategy of a third party: imported by the process in which `update` is called.

    Arguments:
        chosen: options that are not the usual ones, as JSON.
    """

    chosen: str = "{}"

    @property
    def citation(self) -> str:
        """Return what it says of its source."""
        return str(self.said.citation)

    @property
    def needs(self) -> frozenset[str]:
        """Return what a case must have."""
        return frozenset(self.said.needs)

    @property
    def promises(self) -> Any:  # noqa: ANN401 - what is no set was given as it is
        """Return what every result keeps."""
        found = self.said.promises
        return found if isinstance(found, str) else frozenset(found)

    @property
    def usual(self) -> ForeignStrategy:
        """Return it with the options that it has by itself."""
        return self if self.chosen == "{}" else _varied(self.handle, "{}")

    @property
    def modules(self) -> tuple[str, ...]:
        """Return the packages, or lone modules, that hold its source: the plugin's, its own."""
        own = str(self.said.module).partition(".")[0]
        return tuple(dict.fromkeys((self.handle.origin.top, own)))

    def update(self, model: Any, measurement: Any, rng: Any) -> Any:  # noqa: ANN401 - see the roles
        """Import the strategy here and return what it returns."""
        return self.load().update(model, measurement, rng)

    def load(self) -> Any:  # noqa: ANN401 - somebody's class
        """Import the strategy in this process and return it with its options."""
        return with_options(self.handle.load(), json.loads(self.chosen))

    def with_options(self, options: Mapping[str, object]) -> ForeignStrategy:
        """Return it with other options, as its own code sees them.

        Raises:
            InputError: for a value that it refuses.
        """
        chosen = json.dumps({**json.loads(self.chosen), **options}, sort_keys=True)
        return _varied(self.handle, chosen)

    def __reduce__(self) -> tuple[Any, ...]:
        from msgspec.structs import asdict

        # One text: the bytes of a pickle also tell which of several texts are one object.
        origin = self.handle.origin
        parts = [origin.plugin, origin.value, origin.distribution, self.name]
        return _strategy_of, (json.dumps([*parts, asdict(self.said), self.chosen]),)


def _strategy_of(text: str) -> ForeignStrategy:
    from femubench.core.plugin.description import read_description

    plugin, value, distribution, name, said, chosen = json.loads(text)
    handle = Handle(Origin(plugin, value, distribution), "strategies", name)
    return ForeignStrategy(handle, read_description("strategies", said), chosen)


@lru_cache(maxsize=1000)
def _varied(handle: Handle, chosen: str) -> ForeignStrategy:
    """Return a strategy with other options."""
    from femubench.core.plugin.description import read_description

    options = json.loads(chosen)
    limits: Mapping[str, Any] = {"seconds": apart.SECONDS, "most": apart.MOST, "walled": True}
    found = handle.origin.ask(_VARY, name=handle.name, options=options, **limits)
    return ForeignStrategy(handle, read_description("strategies", found), chosen)


@dataclass(frozen=True)
class _Maker:
    """Makes the folder of a case in a process of its own."""

    handle: Handle
    case: str

    def __call__(self) -> Path:
        """Return the folder.

        Raises:
            InputError: as the plugin raised it.
            PluginError: for every other fault.
        """
        limits: Mapping[str, Any] = {"seconds": _MAKING, "most": 2**16}
        asked = self.handle.origin.ask(_FOLDER, name=self.handle.name, case=self.case, **limits)
        if not isinstance(folder := asked.get("folder"), str):
            raise PluginError(f"the folder of {self.case!r} was given as {type(folder).__name__}")
        return Path(folder)


class _Offered(Described):
    """A reader or a reporter of a third party; its ways are methods that it has beyond its role."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any of its ways
        if name in super().__getattr__("ways"):
            return partial(self._call, name)
        return super().__getattr__(name)

    def _call(self, way: str, *args: Any) -> Any:  # noqa: ANN401 - as the way has it
        raise NotImplementedError


class ForeignReader(_Offered):
    """A reader of a third party: imported here when a file with its suffix is to be read."""

    def read_matrix(self, path: Path) -> Any:  # noqa: ANN401 - checked by who asks for it
        """Import the reader here and return what it reads."""
        return self._call("read_matrix", path)

    def read_modes(self, path: Path) -> Any:  # noqa: ANN401 - likewise
        """Import the reader here and return what it reads."""
        return self._call("read_modes", path)

    def _call(self, way: str, *args: Any) -> Any:  # noqa: ANN401
        return getattr(_loaded(self.handle), way)(*args)


@lru_cache(maxsize=100)
def _loaded(handle: Handle) -> Any:  # noqa: ANN401 - as the kind has it
    return handle.load()


class ForeignReporter(_Offered):
    """A reporter of a third party, whose text is written in a process of its own."""

    def render(self, run: RunData) -> Any:  # noqa: ANN401 - checked by who asks for it
        """Return the report."""
        return self._call("render", run)

    def _call(self, way: str, run: RunData, exhibits: Any = None) -> Any:  # noqa: ANN401
        from femubench.core.schema.records import run_to_json

        store = None if exhibits is None else str(exhibits.store.absolute())
        found = self.handle.origin.ask(
            _RENDER,
            seconds=_MAKING,
            most=_LARGEST_REPORT,
            name=self.name,
            way=way,
            run=run_to_json(run),
            store=store,
            doing=f"reporter {self.name!r} failed",
        )
        if isinstance(content := found.get("bytes"), str):
            import base64

            return base64.b64decode(content)
        if not isinstance(found.get("text"), str):
            what = f"gave {str(found.get('type'))[:80]}, expected str"
            raise PluginError(harmless(f"reporter {self.name!r} {what}"))
        return found["text"]


def is_foreign(offered: object) -> bool:
    """Tell whether the code of what is offered is that of a third party and not imported here."""
    return isinstance(offered, Described)


def import_thing(offered: Any) -> Any:  # noqa: ANN401 - as the kind has it
    """Import a thing in this process where it is a third party's; return it as it is otherwise."""
    return offered.load() if is_foreign(offered) else offered


def doc_of(offered: object) -> str:
    """Return the docstring that somebody wrote for the class of what is offered."""
    return str(offered.doc) if isinstance(offered, Described) else type(offered).__doc__ or ""


def make_proxy(origin: Origin, kind: str, description: object) -> Any:  # noqa: ANN401 - as the kind has it
    """Return what stands for a thing that a plugin describes.

    Raises:
        PluginError: where the description is none, or what it describes does not fill its role.
    """
    from femubench.core.plugin.description import read_description

    said = read_description(kind, description)
    handle = Handle(origin, kind, said.name)
    if kind == "scenarios":
        folders = {
            name: _Maker(handle, name) if folder is None else Path(folder)
            for name, folder in said.cases.items()
        }
        scenario = Scenario(said.name, said.title, folders, said.classes, said.default)
        return CHECKS[kind](scenario)
    if kind in _PROXIES:
        return CHECKS[kind](_PROXIES[kind](handle, said))
    found = Foreign(handle, said)
    check_name(found)
    return found


_PROXIES = {
    "strategies": ForeignStrategy, "readers": ForeignReader, "reporters": ForeignReporter
}  # fmt: skip
