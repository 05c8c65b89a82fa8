"""``bench advise``: measure what is advised, round by round, of a case that holds modes back."""

from __future__ import annotations

import json
from pathlib import Path

import click

from femubench.core.cli import options
from femubench.core.cli.registry import plugins_for
from femubench.core.files import write_atomically

_ROW = "{:>5}  {:>4}  {:13}  {:>6}  {:>7}  {:>8}  {:>9}  {}"
_HEAD = "round", "mode", "verdict", "unseen", "drawing", "extended", "predicted", "causes"


@click.command("advise")
@click.argument("case")
@click.option(
    "--rounds", type=click.IntRange(min=1), metavar="N",
    help="Measure N modes at most. Default: until a name stands alone or no mode would say more.",
)  # fmt: skip
@options.json_file("Write the rounds as JSON; - prints it.", options.OUTPUT_OR_SCREEN)
@options.quiet
@click.pass_context
def advise(
    ctx: click.Context, case: str, rounds: int | None, json_file: Path | None, quiet: bool
) -> None:
    """Measure the modes that are advised, with held-out ones as the laboratory.

    CASE is as for bench diagnose. In every round the held-out mode that says most of all of them,
    by the budget of the drawing, is used too. Errors of those still held out are rms, in %.
    """
    from dataclasses import asdict

    from femubench.core.library.advise import play_advice

    silent = quiet or json_file == options.SCREEN
    rows, measured = [], ""
    for number, row in enumerate(play_advice(case, plugins_for(ctx), rounds)):
        if not number and not silent:
            click.echo(_ROW.format(*_HEAD))
        figures = (row.drawing_percent, row.left_percent, row.std_percent)
        words = ("-" if figure is None else f"{figure:.2f}" for figure in figures)
        if not silent:
            causes = ", ".join(row.causes)
            click.echo(_ROW.format(number, measured, row.verdict, row.unseen, *words, causes))
        rows.append(asdict(row))
        measured = str(row.next_mode)
    if json_file is not None:
        text = json.dumps({"case": case, "rounds": rows}, indent=1)
        if json_file == options.SCREEN:
            click.echo(text)
        else:
            write_atomically(json_file, text)
