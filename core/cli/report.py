"""``bench report``: a stored run in any format; runs nothing."""

from __future__ import annotations

import os
from pathlib import Path

import click

from femubench.core.cli.files import make_folder, write_atomically
from femubench.core.cli.registry import chosen, plugins_for, store_folder
from femubench.core.cli.reporting import rendered, run_name
from femubench.core.harness.results import Run
from femubench.core.harness.serial import read_run
from femubench.core.harness.store import Store

FOLDER = click.Path(path_type=Path, file_okay=False)


@click.command("report")
@click.argument("run", required=False)
@click.option(
    "-f",
    "--format",
    "formats",
    multiple=True,
    metavar="FORMAT",
    help="terminal, markdown, csv, json or a plugin's; may be repeated. Default: terminal.",
)
@click.option(
    "-o", "--output", type=FOLDER, metavar="DIR", help="Write a file there instead of the screen."
)
@click.option(
    "--store",
    type=FOLDER,
    metavar="DIR",
    help="Where the results are. Default: $FEMUBENCH_STORE or femubench-results.",
)
@click.pass_context
def report(
    ctx: click.Context,
    run: str | None,
    formats: tuple[str, ...],
    output: Path | None,
    store: Path | None,
) -> None:
    """Write a report on a stored run.

    RUN is a run id in the store, its first letters, or a file that run --json wrote. Without it,
    the last run of the store.
    """
    plugins = plugins_for(ctx)
    names = chosen("report format", formats, plugins.reporters) or ("terminal",)
    found = _find(run, store_folder(store))
    if output is not None:
        make_folder(output)
    for name in names:
        writer = plugins.reporters[name]
        text = rendered(writer, found)
        if output is None:
            click.echo(text)
            continue
        path = output / f"{run_name(found)}{writer.suffix}"
        write_atomically(path, text)
        click.echo(f"{name}: {path}")


def _find(word: str | None, folder: Path) -> Run:
    """Return a run from a file or from the store."""
    if word is not None and os.path.exists(word) and not os.path.isdir(word):
        return read_run(Path(word))
    return Store(folder).load(word)
