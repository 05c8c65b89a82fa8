"""The files that a run is written to, and what is shown at its end."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli.registry import wrapped
from femubench.core.errors import InputError, OutputError, PluginError
from femubench.core.files import write_atomically

if TYPE_CHECKING:
    from femubench.core.plugin.loader import Plugins
    from femubench.core.roles import Reporter
    from femubench.core.run.executor import Executor
    from femubench.core.run.store import Store
    from femubench.core.schema.results import Run


def outputs_of(
    plugins: Plugins, json_file: Path | None, csv_file: Path | None, report_file: Path | None
) -> dict[Path, Reporter]:
    """Return who writes which file."""
    from femubench.core.library.report import reporter, reporter_for

    outputs: dict[Path, Reporter] = {}
    for path, name in ((json_file, "json"), (csv_file, "csv"), (report_file, None)):
        if path is None:
            continue
        if path in outputs:
            raise InputError("is to hold two outputs", file=path, expected="a file for each")
        outputs[path] = reporter(plugins, name) if name else reporter_for(plugins, path)
    return outputs


def announce(line: str, executor: Executor) -> None:
    """Show what begins, and say on standard error where a sandbox is not possible."""
    found = executor.enclosure()
    if found.sandbox == "none" and executor.sandbox != "off":
        click.echo(f"strategies run without a sandbox: {found.reason}", err=True)
    click.echo(wrapped(line, hanging=2))


def finish(
    ctx: click.Context,
    run: Run,
    outputs: dict[Path, Reporter],
    plugins: Plugins,
    store: Store,
    screen: Reporter | None,
    exhibits: object = None,
) -> int:
    """Write the files, then show the ranking and where the files are.

    A file that cannot be written keeps nobody from the ranking and the other files.
    Returns the exit code: 1 where some job has no result.

    Arguments:
        screen: shows the ranking; None shows none.

    Raises:
        OutputError: for the last such file, when all else is done.
        PluginError: for the last reporter that failed.
    """
    from femubench.core.library.report import rendered, reporter, run_name, text_of
    from femubench.core.schema.results import DONE

    files, written = dict(outputs), list[str]()
    broken: OutputError | PluginError | None = None
    if ctx.params["report_file"] is None:
        for own in (reporter(plugins, name) for name in ("html", "markdown")):
            files[store.folder / f"{run_name(run)}{own.suffix}"] = own
    for path, writer in files.items():
        try:
            write_atomically(path, rendered(writer, run, exhibits))
            written.append(f"{writer.name}: {path}")
        except (OutputError, PluginError) as fault:
            if broken is not None:
                click.echo(f"bench: {broken}", err=True)
            broken = fault
    if screen is not None:
        click.echo("\n".join(["", text_of(screen, rendered(screen, run)), *written]))
    if broken is not None:
        raise broken
    return int(any(result.status not in DONE for result in run.results))
