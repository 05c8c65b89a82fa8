"""The verb ``bench update``: write the model of a case as a strategy updates it."""

from __future__ import annotations

from pathlib import Path

import click

from femubench.core.cli import options
from femubench.core.cli.registry import plugins_for
from femubench.core.errors import InputError


@click.command()
@click.argument("case")
@click.option(
    "-s", "--strategy", required=True, metavar="STRATEGY",
    help="The strategy that updates the model: NAME, or NAME:OPTION=VALUE,...",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True,
              help="Seed of its random numbers.")  # fmt: skip
@click.option(
    "-o", "--output", type=options.FOLDER, required=True, metavar="FOLDER",
    help="Where the files go, which keep their names; for a frame a new case folder.",
)  # fmt: skip
@click.pass_context
def update(ctx: click.Context, case: str, strategy: str, seed: int, output: Path) -> None:
    """Write the updated model of CASE in the format that it came in."""
    from femubench.core.files import check_new
    from femubench.core.library.models import update_case, write_updated

    check_new(output)
    plugins = plugins_for(ctx)
    read, model, parameters = update_case(case, strategy, seed, plugins)
    try:
        write_updated(read, model, output, plugins)
    except InputError as fault:
        name, _, asked = strategy.partition(":")
        more = getattr(plugins.strategies[name], "writable", "")
        if not more or more in asked:
            raise
        expected = f"{fault.expected}; {name}:{more} changes parameters alone"
        raise InputError(fault.what, file=fault.file, expected=expected) from None
    for p in parameters:
        spread = "" if p.std is None else f" ± {p.std:.2g}"
        click.echo(f"{p.name}: {p.before:.4g} → {p.after:.4g}{spread} {p.unit}".rstrip())
    for path in sorted(output.rglob("*")):
        if path.is_file():
            click.echo(f"wrote {path}")
