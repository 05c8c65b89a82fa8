"""The verb ``bench init``: write a case folder to start from."""

from __future__ import annotations

from pathlib import Path

import click

from femubench.core.cli import options


@click.command()
@click.argument("folder", type=options.PATH)
def init(folder: Path) -> None:
    """Write a commented example case into FOLDER, which must be new or empty."""
    from femubench.core.library.plugins import init_case

    for path in init_case(folder):
        click.echo(f"wrote {path}")
    click.echo(f"Now change it to your structure, and run: bench run {folder}")
