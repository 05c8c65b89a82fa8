"""``bench identify``: modes of measured responses, as the tables of a case and a page."""

from __future__ import annotations

from pathlib import Path

import click

from femubench.core.cli import options
from femubench.core.cli.progress import waiting
from femubench.core.cli.registry import plugins_for
from femubench.core.files import check_new
from femubench.core.library.cases import way_of


def _parse_band(text: str) -> tuple[float, float]:
    """Return two numbers of a text."""
    try:
        low, high = map(float, text.split(","))
    except ValueError:
        low = high = 0.0
    if not 0.0 <= low < high < float("inf"):
        raise ValueError(f"{text!r} is no LOW,HIGH in Hz with LOW < HIGH")
    return low, high


@click.command("identify")
@click.argument("file", type=options.PATH)
@options.output_folder(
    "Write modes.csv and sensors.csv of a case, and a page, which needs femubench[plot]. FOLDER "
    "must be new or empty.",
    metavar="FOLDER",
)
@click.option(
    "--band", callback=options.read_with(_parse_band), metavar="LOW,HIGH",
    help="Frequencies in Hz between which modes are sought. Default: all.",
)  # fmt: skip
@click.option(
    "--order", type=click.IntRange(4, 400), metavar="N",
    help="Poles of the largest model. Default: 120, of motions over time 60.",
)  # fmt: skip
@click.option(
    "--sensors", type=options.PATH, metavar="FILE",
    help="A table label,x,y,z,direction with the places of the sensors, if FILE has none.",
)  # fmt: skip
@options.quiet
@click.pass_context
def identify(
    ctx: click.Context,
    file: Path,
    output: Path | None,
    band: tuple[float, float] | None,
    order: int | None,
    sensors: Path | None,
    quiet: bool,
) -> None:
    """Find modes in measured responses, without a click.

    FILE holds frequency responses (a universal file, .csv, .npz), or motions over time that
    no force was measured for, which takes femubench[identify].
    """
    if output is not None:
        check_new(output)
    from femubench.core.library.identify import identification_of, write_identification

    with waiting(f"looking for modes in {file.name}", quiet=quiet):
        found = identification_of(file, plugins_for(ctx), band, order, sensors)
    if not quiet:
        click.echo(way_of("terminal", "render_modes")(found))
    if output is not None:
        write_identification(found, output, source=file.name)
        if not quiet:
            click.echo(f"\nwrote modes.csv, sensors.csv and identification.html to {output}")
            if not found.located:
                click.echo("The file has no coordinates: fill in x, y and z of sensors.csv.")
