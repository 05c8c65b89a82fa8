"""Plugins of one's own: ``bench plugins new`` and ``bench plugins check``, ``bench init``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from femubench.core.case.example import write_example
from femubench.core.case.starting import Beginning
from femubench.core.conformance import SECONDS
from femubench.core.conformance.checking import CheckResult, findings, subjects
from femubench.core.conformance.problems import of_case
from femubench.core.library.cases import CaseLike, as_list, read_cases, usable_plugins
from femubench.core.library.new_case import begin_case
from femubench.core.library.new_package import write_package
from femubench.core.plugin.validation import check_strategy


def init_case(
    folder: str | PathLike[str],
    model: str | PathLike[str] | None = None,
    modes: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    **stated: Any,  # noqa: ANN401 - as `Beginning` has it
) -> tuple[Path, ...]:
    """Write a case folder from the files of a model and of a test, or an example; return its files.

    Arguments:
        folder: new or empty.
        model, modes: files with the model and with the measured modes or responses, or the folder
            of an identification; several are repeats. Without both a commented example is written.
        stated: ``mass``, ``dofs``, ``sensors`` and ``reference``, further files; ``model_unit``,
            ``unit``, ``tolerance``, ``origin``, ``without``, and for axes ``frame`` and
            ``directions``, as `bench init` has.

    Raises:
        InputError: when the folder holds anything or cannot be written, or for what is wrong in
            the files.

    Examples:
        >>> [path.name for path in femubench.init_case("my-structure")]
        ['case.toml', 'sensors.csv', 'modes.csv', 'modified.csv']
    """
    if model is None and modes is None and not stated:
        return write_example(Path(folder))
    files = ("mass", "dofs", "sensors", "reference")
    paths = {key: Path(stated[key]) for key in files if stated.get(key)}
    every = [modes] if isinstance(modes, str | PathLike) else modes or ()
    given = Beginning.of(model, every, **{**stated, **paths})
    begin_case(Path(folder), given, usable_plugins())
    return tuple(sorted(path for path in Path(folder).rglob("*") if path.is_file()))


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
) -> tuple[CheckResult, ...]:
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
    problems = [of_case(case) for case in read_cases(cases, plugins)] if as_list(cases) else []
    wanted = subjects(name, plugins, cases=problems, seconds=timeout)
    return tuple(finding for subject in wanted for finding in findings(subject))
