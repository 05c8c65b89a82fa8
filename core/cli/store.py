"""``bench store``: what is damaged in a store, and the store without it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.cli.registry import Verbs
from femubench.core.display import count_noun
from femubench.core.errors import InputError, harmless

if TYPE_CHECKING:
    from femubench.core.run.store import Store


@click.group("store", cls=Verbs)
def store() -> None:
    """Check or repair stored runs."""


def _open(folder: Path | None) -> Store:
    """Return the store that is meant; raises InputError where there is none."""
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

    A fault is one line: file, number of the record, what is wrong.
    """
    kept = _open(store)
    faults = kept.faults()
    for fault in faults:
        click.echo(fault)
    runs = count_noun(len(kept.runs()), "run")
    click.echo(harmless(f"{kept.folder}: {runs}, {count_noun(len(faults), 'fault')}"))
    ctx.exit(int(bool(faults)))


@store.command("repair")
@options.store("Where the runs are.")
def repair(store: Path | None) -> None:
    """Leave out what is damaged, so that `bench run --resume` computes it again.

    A damaged file is kept as RUN.sqlite.damaged. A file without any record of a run is left alone.
    """
    kept, line = _open(store), ""
    for file in kept.files:
        with kept.exclusive(file.stem):
            faults, copy = kept.repair(file.stem)
        if copy is not None:
            out = sum(fault.line is not None for fault in faults)
            found = f"{count_noun(len(faults), 'fault')}, {count_noun(out, 'record')} left out"
            line = f"{file}: {found}, as it was in {copy.name}"
        elif faults:
            line = f"{faults[0]}: no record of a run, left alone"
        else:
            continue
        click.echo(harmless(line))
    if not line:
        click.echo(harmless(f"{kept.folder}: nothing to repair"))
