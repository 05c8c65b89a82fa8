"""Turn the words after ``bench run`` into cases."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from femubench.core.cli.registry import unknown
from femubench.core.errors import InputError

if TYPE_CHECKING:
    from femubench.core.case.case import Case
    from femubench.core.plugin.loader import Plugins
    from femubench.core.plugin.roles import Scenario


def read_cases(words: Sequence[str], plugins: Plugins) -> list[Case]:
    """Read and validate cases, each once.

    Arguments:
        words: names of scenarios, of one case of a scenario, or folders; none for all scenarios.
        plugins: where scenarios and readers come from.

    Raises:
        InputError: for an unknown name or a faulty case, before anything is run.
    """
    wanted = case_folders(words, plugins.scenarios)
    if not wanted:
        raise InputError("there is no case to run", expected="a case folder or a scenario plugin")
    # Words are known to be right before what reads cases is loaded.
    from femubench.core.case.reader import read_case

    readers = tuple(plugins.readers.values())
    # A name is that of a scenario, whose folder came with a plugin.
    cases = [
        read_case(folder, name, readers, installed=name is not None) for name, folder in wanted
    ]
    _check_names(cases)
    return cases


def case_folders(
    words: Sequence[str], scenarios: Mapping[str, Scenario]
) -> list[tuple[str | None, Path]]:
    """Return name and folder of every case that the words stand for, each once.

    Arguments:
        words: as in `read_cases`.
        scenarios: the known ones.

    Raises:
        InputError: for an unknown name.
    """
    # By resolved folder, so that each runs once; messages name it as it was typed.
    wanted: dict[Path, tuple[str | None, Path]] = {}
    for word in words or scenarios:
        for name, folder in _folders(word, scenarios):
            wanted.setdefault(folder.resolve(), (name, folder))
    return list(wanted.values())


def _folders(word: str, scenarios: Mapping[str, Scenario]) -> Iterable[tuple[str | None, Path]]:
    """Return name and folder of every case that a word stands for."""
    if word in scenarios:
        return list(scenarios[word].cases.items())
    parts = {
        name: folder for scenario in scenarios.values() for name, folder in scenario.cases.items()
    }
    if word in parts:
        return [(word, parts[word])]
    path = Path(word)
    if path.name == "case.toml" and path.is_file():
        path = path.parent
    if path.is_dir():
        return [(None, path)]
    if "/" in word and word.partition("/")[0] not in scenarios:
        raise InputError("folder does not exist", file=path, expected="a folder with a case.toml")
    raise InputError(unknown("case", word, [*scenarios, *parts]))


def _check_names(cases: Iterable[Case]) -> None:
    """Refuse two folders under one name: their results could not be told apart."""
    seen: dict[str, Path] = {}
    for case in cases:
        if case.name in seen:
            raise InputError(
                f"the name {case.name!r} is also that of {seen[case.name]}",
                file=case.folder / "case.toml",
                key="case.name",
                expected="a name of its own",
            )
        seen[case.name] = case.folder
