"""Plugins of one's own: ``bench plugins new`` and ``bench plugins check``, ``bench init``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from femubench.core.case.example import write_example
from femubench.core.conformance import SECONDS
from femubench.core.conformance.checking import Finding, findings, subjects
from femubench.core.conformance.problems import of_case
from femubench.core.library.cases import CaseLike, listed, read_cases, usable_plugins
from femubench.core.library.new_package import write_package
from femubench.core.plugin.validation import check_strategy


def init_case(folder: str | PathLike[str]) -> tuple[Path, ...]:
    """Write a commented example case into a new or empty folder and return its files.

    Raises:
        InputError: when the folder holds anything, or cannot be written.

    Examples:
        >>> [path.name for path in femubench.init_case("my-structure")]
        ['case.toml', 'sensors.csv', 'modes.csv', 'modified.csv']
    """
    return write_example(Path(folder))


def new_plugin(
    name: str, kind: str = "strategy", output: str | PathLike[str] = "."
) -> tuple[Path, ...]:
    """Write a pip-installable package with a working plugin and return its files.

    Arguments:
        name: of lower-case letters, digits and dashes; also that of what the plugin brings.
        kind: ``strategy``, ``effect``, ``scenario`` or ``reader``.
        output: an existing folder; the package becomes a folder in it.

    Raises:
        InputError: for a name that cannot be used, or a folder that cannot be written.

    Examples:
        >>> femubench.new_plugin("my-method")[0].parts[0]
        'my-method'
    """
    return write_package(name, kind, Path(output), usable_plugins())


def check(
    plugin: Any,  # noqa: ANN401 - a name, or whatever is to be a strategy
    *,
    cases: CaseLike | Iterable[CaseLike] = (),
    timeout: float = SECONDS,
) -> tuple[Finding, ...]:
    """Check that a plugin keeps what a plugin must keep; return what was found.

    Arguments:
        plugin: the name of a strategy (with options after a colon if need be), an effect, a reader
            or a scenario; or a strategy, as a class or an instance.
        cases: try a strategy on these too.
        timeout: seconds that one trial may take.

    Raises:
        InputError: when there is nothing of that name.
        PluginError: when an object is no strategy.

    Examples:
        >>> all(finding.verdict.status == "pass" for finding in femubench.check(case.name))
        True
    """
    plugins = usable_plugins()
    name = plugin
    if not isinstance(plugin, str):
        strategy = check_strategy(plugin)
        name = strategy.name
        plugins = replace(plugins, strategies={**plugins.strategies, name: strategy})
    problems = [of_case(case) for case in read_cases(cases, plugins)] if listed(cases) else []
    wanted = subjects(name, plugins, cases=problems, seconds=timeout)
    return tuple(finding for subject in wanted for finding in findings(subject))
