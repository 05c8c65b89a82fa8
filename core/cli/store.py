"""``bench store``: what is damaged in a store, the store without it, runs as plain files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.cli.registry import Verbs, plugins_for
from femubench.core.display import counted
from femubench.core.errors import InputError
from femubench.core.files import make_folder, write_atomically

if TYPE_CHECKING:
    from femubench.core.run.store import Store

_LINES, _FRAMES = "jsonl", ("csv", "parquet")


@click.group("store", cls=Verbs)
def store() -> None:
    """Check, repair or export stored runs."""


def _opened(folder: Path | None) -> Store:
    """Return the store that is meant.

    Raises:
        InputError: where there is none.
    """
    from femubench.core.library.rank import store_in

    found = store_in(folder)
    if not found.files:
        expected = "a run stored by `bench run`"
        raise InputError("no results", file=found.folder, expected=expected)
    return found


@store.command("check")
@options.store("Where the runs are.")
@click.pass_context
def check(ctx: click.Context, store: Path | None) -> None:
    """Read every record; exit with 1 if one is damaged or missing.

    A fault is one line: file, line, what is wrong.
    """
    from femubench.core.run.upkeep import faults_of, unsealed

    kept = _opened(store)
    faults = faults_of(kept)
    for fault in faults:
        click.echo(" ".join(str(fault).split()))
    if old := unsealed(kept):
        click.echo(
            f"{counted(old, 'record')} of an earlier version without checksums; "
            "`bench store repair` adds them"
        )
    runs = counted(len(kept.runs()), "run")
    click.echo(f"{kept.folder}: {runs}, {counted(len(faults), 'fault')}")
    ctx.exit(int(bool(faults)))


@store.command("repair")
@options.store("Where the runs are.")
def repair(store: Path | None) -> None:
    """Leave out what is damaged, so that `bench run --resume` computes it again.

    Damaged lines go to RUN.jsonl.damaged. Runs of an earlier version are converted.
    """
    from femubench.core.run.upkeep import repair as repaired

    kept = _opened(store)
    done = repaired(kept)
    for item in done:
        aside = "" if item.aside is None else f", damaged lines in {item.aside}"
        lost = counted(item.lost, "fault")
        click.echo(f"{item.file}: {counted(item.records, 'record')} kept, {lost}{aside}")
    if not done:
        click.echo(f"{kept.folder}: nothing to repair")


@store.command("export")
@click.argument("runs", metavar="[RUN]...", nargs=-1)
@click.option(
    "-f", "--format", "form", type=click.Choice([_LINES, *_FRAMES]), default=_LINES,
    show_default=True, help="One line of JSON a record, or a table with one row a job.",
)  # fmt: skip
@options.output_folder("Write a file for each run there. Default: here.", default=".")
@options.store("Where the runs are.")
@click.pass_context
def export(
    ctx: click.Context, runs: tuple[str, ...], form: str, output: Path, store: Path | None
) -> None:
    """Write runs as plain files.

    A RUN is a run id or its first letters; without any, all runs of the store.
    """
    from femubench.core.library.report import rendered, reporter, run_name
    from femubench.core.run.upkeep import exported

    kept = _opened(store)
    make_folder(output)
    if output.resolve() == kept.folder.resolve():
        raise InputError("is the store itself", file=output, expected="another folder")
    for run_id in [str(kept.begun(word)["run"]) for word in runs] or kept.runs():
        faults: list[InputError] = []
        if form == _LINES:
            file = output / f"{run_id}.{form}"
            with file.open("w", encoding="ascii") as stream:
                stream.writelines(f"{line}\n" for line in exported(kept, run_id, faults))
        else:
            run = kept.load(run_id)
            writer = reporter(plugins_for(ctx), form)
            file = output / f"{run_name(run)}{writer.suffix}"
            write_atomically(file, rendered(writer, run))
            for note in run.meta["notes"]:
                click.echo(f"bench: {note}", err=True)
        for fault in faults:
            click.echo(f"bench: {' '.join(str(fault).split())}: left out", err=True)
        click.echo(f"{form}: {file}")
