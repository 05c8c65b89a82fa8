"""What plugins of third parties offer, known from a description and never imported to be listed.

A `ForeignStrategy` is imported where its `update` is called, which is in a worker; folders of cases
are made and reports are written in processes of their own. An effect, a fault, a paper and a reader
work on models and are imported by anyone who uses one by its name.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femubench.core.errors import PluginError, harmless
from femubench.core.plugin import apart
from femubench.core.plugin.apart import Origin
from femubench.core.plugin.distribution import select_known
from femubench.core.plugin.importing import Later, import_offer
from femubench.core.plugin.options import SIMPLE, StatedOptions, with_options
from femubench.core.plugin.validation import (
    CHECKS,
    check_name,
    check_texts,
    of_type,
)
from femubench.core.roles import CAPABILITIES, Scenario

if TYPE_CHECKING:
    from femubench.core.schema.results import Run

# What answers a question in a process of its own.
_VARY = "femubench.core.plugin.describing:describe_variant"
_FOLDER = "femubench.core.plugin.describing:folder"
_RENDER = "femubench.core.library.report:write_apart"
_MAKING = 3600.0  # s that a case or a report may take to be made
_LARGEST_REPORT = 256 * 2**20  # bytes
_LONGEST_DOC = 20_000  # characters


@dataclass(frozen=True)
class Handle:
    """One thing that a plugin offers; small, and sent to other processes instead of the thing.

    Arguments:
        origin: of the plugin.
        kind, name: of the thing.
    """

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
class Foreign(Later):
    """What is known of an effect, a fault or a paper without its code.

    Arguments:
        handle: by which it is imported.
        doc, summary, side: as it says of itself; empty where it does not.
    """

    handle: Handle
    doc: str = ""
    summary: str = ""
    side: str = ""

    @property
    def name(self) -> str:
        """Return its name."""
        return self.handle.name

    def load(self) -> Any:  # noqa: ANN401 - as the kind has it
        """Import the plugin in this process and return the thing."""
        return self.handle.load()


@dataclass(frozen=True)
class ForeignStrategy(StatedOptions):
    """A strategy of a third party: imported by the process in which `update` is called.

    Arguments:
        handle: by which it is imported.
        description: its description, plain data as JSON.
        chosen: options that are not the usual ones, likewise.
    """

    handle: Handle
    description: str
    chosen: str = "{}"

    @property
    def name(self) -> str:
        """Return its name."""
        return self.handle.name

    @property
    def citation(self) -> str:
        """Return what it says of its source."""
        return str(self._description["citation"])

    @property
    def needs(self) -> frozenset[str]:
        """Return what a case must have."""
        return frozenset(self._description["needs"])

    @property
    def promises(self) -> Any:  # noqa: ANN401 - what is no set was given as it is
        """Return what every result keeps."""
        found = self._description["promises"]
        return frozenset(found) if isinstance(found, list) else found

    @property
    def settings(self) -> tuple[str, ...]:
        """Return other values of its options, in the words of the command line."""
        return tuple(self._description["settings"])

    @property
    def baseline(self) -> bool:
        """Tell whether it leaves the model as it is."""
        return bool(self._description["baseline"])

    @property
    def cost_reference(self) -> bool:
        """Tell whether time and memory of others are compared with its own."""
        return bool(self._description["cost_reference"])

    @property
    def on_request(self) -> bool:
        """Tell whether it runs only where it is named."""
        return bool(self._description["on_request"])

    @property
    def doc(self) -> str:
        """Return what it says of itself."""
        return str(self._description["doc"])

    @property
    def about(self) -> dict[str, str]:
        """Return what its package says of it: home page, summary, authors, DOI."""
        return dict(self._description["about"])

    @property
    def options(self) -> dict[str, Any]:
        """Return the options that fit on a command line, with their present values."""
        return dict(self._description["options"])

    @property
    def open(self) -> tuple[str, ...]:
        """Return options that take further entries by name."""
        return tuple(self._description["open"])

    @property
    def usual(self) -> ForeignStrategy:
        """Return it with the options that it has by itself."""
        usual = "{}"
        if self.chosen == usual:
            return self
        return ForeignStrategy(self.handle, _varied(self.handle, usual), usual)

    @property
    def modules(self) -> tuple[str, ...]:
        """Return the packages, or lone modules, that hold its source: the plugin's, its own."""
        own = str(self._description["module"]).partition(".")[0]
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
        return ForeignStrategy(self.handle, _varied(self.handle, chosen), chosen)

    @property
    def _description(self) -> dict[str, Any]:
        return _parsed(self.description)

    def __reduce__(self) -> tuple[Any, ...]:
        # One text: the bytes of a pickle also tell which of several texts are one object.
        origin = self.handle.origin
        parts = [origin.plugin, origin.value, origin.distribution, self.name]
        return _strategy_of, (json.dumps([*parts, self.description, self.chosen]),)


def _strategy_of(text: str) -> ForeignStrategy:
    plugin, value, distribution, name, description, chosen = json.loads(text)
    handle = Handle(Origin(plugin, value, distribution), "strategies", name)
    return ForeignStrategy(handle, description, chosen)


@lru_cache(maxsize=1000)
def _parsed(description: str) -> dict[str, Any]:
    return dict(json.loads(description))


@lru_cache(maxsize=1000)
def _varied(handle: Handle, chosen: str) -> str:
    """Return the description of a strategy with other options."""
    options = json.loads(chosen)
    limits: Mapping[str, Any] = {"seconds": apart.SECONDS, "most": apart.MOST, "walled": True}
    found = handle.origin.ask(_VARY, name=handle.name, options=options, **limits)
    return strategy_of(handle, found).description


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
        return Path(of_type(asked.get("folder"), str, "the folder"))


@dataclass(frozen=True)
class _Offered:
    """A reader or a reporter of a third party.

    Arguments:
        handle: by which it is imported.
        ways: what it offers apart from the methods of every one.
        doc: what it says of itself.
    """

    handle: Handle
    ways: frozenset[str]
    doc: str

    @property
    def name(self) -> str:
        """Return its name."""
        return self.handle.name

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any of its ways
        if name.startswith("_") or name not in self.__dict__.get("ways", ()):
            raise AttributeError(name)
        return partial(self._call, name)


@dataclass(frozen=True)
class ForeignReader(_Offered):
    """A reader of a third party: imported here when a file with its suffix is to be read.

    Arguments:
        suffixes: of the files that it reads.
    """

    suffixes: tuple[str, ...]

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


@dataclass(frozen=True)
class ForeignReporter(_Offered):
    """A reporter of a third party, whose text is written in a process of its own."""

    suffix: str

    def render(self, run: Run) -> Any:  # noqa: ANN401 - checked by who asks for it
        """Return the report."""
        return self._call("render", run)

    def _call(self, way: str, run: Run, exhibits: Any = None) -> Any:  # noqa: ANN401
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
        if "bytes" in found:
            import base64

            return base64.b64decode(of_type(found["bytes"], str, "the report"))
        if not isinstance(found.get("text"), str):
            what = f"gave {str(found.get('type'))[:80]}, expected str"
            raise PluginError(harmless(f"reporter {self.name!r} {what}"))
        return found["text"]


def is_foreign(offered: object) -> bool:
    """Tell whether the code of what is offered is that of a third party and not imported here."""
    return isinstance(offered, (Foreign, ForeignStrategy, _Offered))


def import_thing(offered: Any) -> Any:  # noqa: ANN401 - as the kind has it
    """Import a thing in this process where it is a third party's; return it as it is otherwise."""
    if isinstance(offered, ForeignStrategy):
        return offered.load()
    return offered.handle.load() if is_foreign(offered) else offered


def doc_of(offered: object) -> str:
    """Return the docstring that somebody wrote for the class of what is offered."""
    if isinstance(offered, (Foreign, ForeignStrategy, _Offered)):
        return offered.doc
    return (type(offered).__doc__ or "")[:_LONGEST_DOC]


def strategy_of(handle: Handle, description: Mapping[str, Any]) -> ForeignStrategy:
    """Return a strategy as it is described.

    Raises:
        PluginError: where the description is none.
    """
    promises, options = (
        description.get("promises"),
        of_type(description.get("options"), dict, "options"),
    )
    for key, value in options.items():
        if not isinstance(value, SIMPLE):
            raise PluginError(f"option {key[:80]!r} is no plain value")
    plain = {
        "citation": harmless(of_type(description.get("citation"), str, "citation")),
        "needs": check_texts(description.get("needs"), "needs", known=CAPABILITIES),
        "promises": check_texts(promises, "promises") if isinstance(promises, list)
        else harmless(of_type(promises, str, "promises")),
        "settings": check_texts(description.get("settings"), "settings"),
        "options": options,
        "open": check_texts(description.get("open"), "open options"),
        "baseline": description.get("baseline") is True,
        "cost_reference": description.get("cost_reference") is True,
        "on_request": description.get("on_request") is True,
        "module": harmless(of_type(description.get("module"), str, "module")),
        "doc": _doc(description),
        "about": select_known(of_type(description.get("about"), dict, "what its package says")),
    }  # fmt: skip
    return ForeignStrategy(handle, json.dumps(plain))


def _doc(description: Mapping[str, Any]) -> str:
    lines = of_type(description.get("doc"), str, "the docstring")[:_LONGEST_DOC].splitlines()
    # The indentation tells paragraphs and sections apart.
    kept = [" " * (len(line) - len(line.lstrip())) + harmless(line) for line in lines]
    return "\n".join(kept)


def _scenario(handle: Handle, description: Mapping[str, Any]) -> Scenario:
    cases: dict[str, Path | Callable[[], Path]] = {}
    for name, folder in of_type(description.get("cases"), dict, "cases").items():
        cases[name] = Path(folder) if isinstance(folder, str) else _Maker(handle, name)
    title = harmless(of_type(description.get("title"), str, "title"))
    classes = tuple(check_texts(description.get("classes"), "classes"))
    return Scenario(handle.name, title, cases, classes, description.get("default") is True)


def _reader(handle: Handle, description: Mapping[str, Any]) -> ForeignReader:
    suffixes = tuple(check_texts(description.get("suffixes"), "suffixes"))
    return ForeignReader(handle, _ways(description), _doc(description), suffixes)


def _reporter(handle: Handle, description: Mapping[str, Any]) -> ForeignReporter:
    suffix = of_type(description.get("suffix"), str, "suffix")
    return ForeignReporter(handle, _ways(description), _doc(description), suffix)


def _ways(description: Mapping[str, Any]) -> frozenset[str]:
    return frozenset(check_texts(description.get("ways"), "methods"))


def _effect(handle: Handle, description: Mapping[str, Any]) -> Foreign:
    summary = harmless(of_type(description.get("summary"), str, "summary"))
    return Foreign(handle, _doc(description), summary=summary)


def _fault(handle: Handle, description: Mapping[str, Any]) -> Foreign:
    side = of_type(description.get("side"), str, "side")
    if side not in ("data", "input"):
        raise PluginError(f"side is {side[:80]!r}, neither 'data' nor 'input'")
    return Foreign(handle, _doc(description), side=side)


_MADE: Mapping[str, Callable[[Handle, Mapping[str, Any]], Any]] = {
    "strategies": strategy_of,
    "scenarios": _scenario,
    "effects": _effect,
    "faults": _fault,
    "readers": _reader,
    "reporters": _reporter,
    "papers": lambda handle, description: Foreign(handle, _doc(description)),
}


def make_proxy(origin: Origin, kind: str, description: object) -> Any:  # noqa: ANN401 - as the kind has it
    """Return what stands for a thing that a plugin describes.

    Raises:
        PluginError: where the description is none, or what it describes does not fill its role.
    """
    plain: dict[str, Any] = of_type(description, dict, f"one of the {kind}")
    handle = Handle(origin, kind, of_type(plain.get("name"), str, "name"))
    found = _MADE[kind](handle, plain)
    if isinstance(found, Foreign):
        check_name(found)
        return found
    return CHECKS[kind](found)
