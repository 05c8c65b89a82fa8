"""Cases by name, by folder or as they are, and what plugins offer by name."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar

from femubench.core.case.drawn import DRAWN, drawing_of
from femubench.core.display import clip_text
from femubench.core.errors import InputError
from femubench.core.plugin.loader import Plugins, load_plugins
from femubench.core.plugin.validation import choose_names, unknown
from femubench.core.plugin.variants import Variant
from femubench.core.roles import Effect, Reader, Scenario

if TYPE_CHECKING:
    from femubench.core.case.case import Case

CaseLike: TypeAlias = "str | PathLike[str] | Case"
Thing = TypeVar("Thing")
LEFT_OUT = "left out: "


def usable_plugins() -> Plugins:
    """Return what plugins offer; warn of those that are broken."""
    plugins = load_plugins()
    for fault in plugins.broken:
        warnings.warn(str(fault), stacklevel=2)
    return plugins


def way_of(style: str, way: str) -> Callable[..., Any]:
    """Return the method by which a report format of femubench shows something else than a run.

    Raises:
        InputError: when there is no such format, or it does not show that.
    """
    formats = load_plugins(third_parties=False).reporters
    found = getattr(formats.get(style), way, None)
    if callable(found):
        return found  # type: ignore[no-any-return]
    having = ", ".join(name for name in formats if callable(getattr(formats[name], way, None)))
    raise InputError(f"there is no style {style!r}", expected=f"one of {having}")


def render_diagnosis(data: Mapping[str, Any], style: str) -> str:
    """Return a diagnosis as plain data in a style; nothing that a run needs is loaded."""
    if style == "json":
        return json.dumps(data, indent=1, allow_nan=False)
    return str(way_of(style, "render_diagnosis")(data))


class InstalledReaders(Sequence[Reader]):
    """The readers of all plugins; nothing is loaded before a file asks for one."""

    @cached_property
    def _found(self) -> tuple[Reader, ...]:
        return tuple(usable_plugins().readers.values())

    def __getitem__(self, index: Any) -> Any:  # noqa: ANN401 - one, or a part of them
        return self._found[index]

    def __len__(self) -> int:
        return len(self._found)


def read_case(
    folder: str | PathLike[str], name: str | None = None, readers: Sequence[Reader] | None = None
) -> Case:
    """Read a case folder.

    Arguments:
        folder: a folder with a `case.toml`.
        name: the name to give to the case; None takes its own.
        readers: reader plugins for files other than CSV and Matrix Market; None for those that
            are installed.

    Raises:
        InputError: for anything wrong in the folder.

    Examples:
        >>> femubench.read_case(case.folder).used
        (1, 2, 3)
    """
    from femubench.core.case.reader import read_case as read

    return read(folder, name, InstalledReaders() if readers is None else readers)


class Catalogue(Mapping[str, Thing], Generic[Thing]):
    """Everything of one kind that plugins offer, by name, loaded when it is asked for."""

    def __init__(
        self,
        kind: str,
        names: Callable[[Plugins], Iterable[str]],
        make: Callable[[Plugins, str], Thing],
    ) -> None:
        self._kind, self._names, self._make = kind, names, make

    def __getitem__(self, name: str) -> Thing:
        """Return what has a name.

        Raises:
            UnknownNameError: an InputError and a KeyError, with the near matches.
        """
        plugins = usable_plugins()
        choose_names(self._kind, [name], self._names(plugins))
        return self._make(plugins, name)

    def _known(self) -> tuple[str, ...]:
        return tuple(self._names(usable_plugins()))

    def __iter__(self) -> Iterator[str]:
        return iter(self._known())

    def __len__(self) -> int:
        return len(self._known())

    def __contains__(self, name: object) -> bool:
        return name in self._known()

    def __repr__(self) -> str:
        return clip_text(f"{self._kind}: {', '.join(self._known())}")


def scenarios_of(scenarios: Mapping[str, Scenario]) -> dict[str, Scenario]:
    """Return the scenario of every case by the case's name; the first keeps a name."""
    found: dict[str, Scenario] = {}
    for scenario in scenarios.values():
        for case in scenario.cases:
            found.setdefault(case, scenario)
    return found


def _groups(scenarios: Mapping[str, Scenario]) -> dict[str, list[str]]:
    """Return the scenarios called ``group/name`` by ``group`` and by ``group:class``."""
    found: dict[str, list[str]] = {}
    for name, scenario in scenarios.items():
        group, slash, _ = name.partition("/")
        for word in (group, *(f"{group}:{kind}" for kind in scenario.classes)) if slash else ():
            found.setdefault(word, []).append(name)
    return found


def _case(plugins: Plugins, name: str) -> Case:
    from femubench.core.case.reader import read_case

    folder = scenarios_of(plugins.scenarios)[name].folder(name)
    return read_case(folder, name, plugins.readers.values(), installed=True)


cases: Catalogue[Case] = Catalogue("case", lambda p: scenarios_of(p.scenarios), _case)
strategies: Catalogue[Variant] = Catalogue(
    "strategy", lambda p: p.strategies, lambda p, name: Variant(p.strategies[name], name)
)
effects: Catalogue[Effect] = Catalogue(
    "effect", lambda p: p.effects, lambda p, name: p.effects[name]
)


def as_list(given: Any) -> list[Any]:  # noqa: ANN401 - one of anything, or several
    """Return one thing as a list of one, several as a list."""
    if isinstance(given, Iterable) and not isinstance(given, (str, PathLike)):
        return list(given)
    return [given]


def read_cases(
    given: CaseLike | Iterable[CaseLike], plugins: Plugins, drawing: str = ""
) -> list[Case]:
    """Read and validate cases, each once.

    Arguments:
        given: names of scenarios, of a group of them (`group`, or `group:class` for those of a
            class), of one case of a scenario, folders, or cases; none for the default set.
        drawing: whose model is taken in place of that of `case.toml`.

    Raises:
        InputError: for an unknown name or a faulty case, before anything is run.
    """
    wanted = case_folders(given, plugins.scenarios, drawing)
    # Words are known to be right before what reads cases is loaded.
    from femubench.core.case.reader import read_case

    readers = plugins.readers.values()  # each is loaded where a file asks for it
    # A name is that of a scenario, whose folder came with a plugin.
    found = [
        read_case(item[1], item[0], readers, installed=item[0] is not None)
        if isinstance(item, tuple)
        else item
        for item in wanted
    ]
    # Results of two folders under one name could not be distinguished.
    seen: dict[str, Path] = {}
    for case in found:
        if case.name in seen:
            what = f"the name {case.name!r} is also that of {seen[case.name]}"
            file, expected = case.folder / "case.toml", "a name of its own"
            raise InputError(what, file=file, key="case.name", expected=expected)
        seen[case.name] = case.folder
    return found


def case_folders(
    given: CaseLike | Iterable[CaseLike], scenarios: Mapping[str, Scenario], drawing: str = ""
) -> list[tuple[str | None, Path] | Case]:
    """Return name and folder of every case that words stand for, and cases as they are, each once.

    Arguments:
        given: as in `read_cases`.
        drawing: as in `read_cases`; of several cases, those without it are left out.

    Raises:
        InputError: for an unknown name, and for a drawing that none has.
    """
    # By resolved folder, so that each runs once; messages name it as it was typed.
    wanted: dict[object, tuple[str | None, Path] | Case] = {}
    for word in as_list(given) or _default_set(scenarios):
        if not isinstance(word, (str, PathLike)):
            wanted.setdefault(id(word), word)
            continue
        found = list(_folders(str(word), scenarios))
        lone = bool(as_list(given)) and len(found) == 1
        for name, folder in _drawn(found, drawing, lone) if drawing else found:
            wanted.setdefault(folder.resolve(), (name, folder))
    if not wanted:
        raise InputError("there is no case to run", expected="a case folder or a scenario plugin")
    return list(wanted.values())


def _drawn(
    found: Sequence[tuple[str | None, Path]], drawing: str, lone: bool = True
) -> Iterator[tuple[str | None, Path]]:
    """Yield name and file of a drawing of cases; warn of one that lacks it, refuse a lone one."""
    for name, folder in found:
        if drawing_of(folder) is not None and folder.stem == drawing:
            yield name, folder
            continue
        file = folder / f"{drawing}.toml"
        if re.fullmatch(r"[\w-]+", drawing) and drawing_of(file) is not None and file.is_file():
            yield None if name is None else f"{name}{DRAWN}{drawing}", file
            continue
        case = name or str(folder)
        if not lone:
            warnings.warn(f"{LEFT_OUT}{case}, it has no drawing {drawing!r}", stacklevel=2)
            continue
        files = sorted(file.stem for file in folder.glob("*.toml") if drawing_of(file) is not None)
        expected = f"one of {', '.join(files)}" if files else "a case that has it"
        raise InputError(f"{case} has no drawing {drawing!r}", expected=expected)


def one_case(given: CaseLike, plugins: Plugins, drawing: str = "") -> Case:
    """Return the only case that a word stands for; see `read_cases`.

    Raises:
        InputError: when it stands for several.
    """
    found = read_cases(given, plugins, drawing)
    if len(found) > 1:
        names = ", ".join(case.name for case in found)
        raise InputError(f"{given!r} stands for {len(found)} cases", expected=f"one of {names}")
    return found[0]


def case_words(words: Iterable[str], plugins: Plugins) -> tuple[str, ...]:
    """Return words for cases that mean the same from any working directory."""
    known = {*case_names(plugins.scenarios)}
    given = tuple(words) or _default_set(plugins.scenarios)
    return tuple(word if word in known else str(Path(word).absolute()) for word in given)


def _default_set(scenarios: Mapping[str, Scenario]) -> tuple[str, ...]:
    return tuple(name for name, scenario in scenarios.items() if scenario.default)


def case_names(scenarios: Mapping[str, Scenario]) -> list[str]:
    """Return every word that stands for cases of scenarios."""
    return [*scenarios, *_groups(scenarios), *scenarios_of(scenarios)]


def _at_hand(scenario: Scenario) -> list[tuple[str, Path]]:
    """Return name and folder of its cases; warn of a scenario whose files are not there."""
    try:
        return [(case, scenario.folder(case)) for case in scenario.cases]
    except InputError as fault:
        warnings.warn(f"{LEFT_OUT}{scenario.name}, {fault}", stacklevel=2)
        return []


def _folders(word: str, scenarios: Mapping[str, Scenario]) -> Iterable[tuple[str | None, Path]]:
    """Return name and folder of every case that a word stands for."""
    groups, owners = _groups(scenarios), scenarios_of(scenarios)
    if word in scenarios:
        return [(case, scenarios[word].folder(case)) for case in scenarios[word].cases]
    if word in groups:
        return [found for name in groups[word] for found in _at_hand(scenarios[name])]
    if word in owners:
        return [(word, owners[word].folder(word))]
    path, (name, mark, drawing) = Path(word), word.rpartition(DRAWN)
    if mark and name in owners:
        return _drawn([(name, owners[name].folder(name))], drawing)
    if drawing_of(path) is not None and path.is_file():
        return [(None, path)]
    if path.name == "case.toml" and path.is_file():
        path = path.parent
    if path.is_dir():
        return [(None, path)]
    if "/" in word and word.partition("/")[0] not in {*scenarios, *groups}:
        raise InputError("folder does not exist", file=path, expected="a folder with a case.toml")
    # All classes of all groups would drown the names.
    known = [name for name in case_names(scenarios) if ":" in word or ":" not in name]
    listed = "a folder with a case.toml (`bench init` writes one) or a name of `bench scenarios`"
    raise unknown("case", word, known, f"expected {listed}")
