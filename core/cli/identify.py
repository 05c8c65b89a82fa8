"""``bench identify``: modes of measured responses, as the tables of a case and a page."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.cli.progress import progress
from femubench.core.cli.registry import plugins_for
from femubench.core.files import check_new
from femubench.core.library.cases import way_of

if TYPE_CHECKING:
    from femubench.core.identify.averaging import Estimator, Excitation


def _parse_band(text: str) -> tuple[float, float]:
    """Return two numbers of a text."""
    try:
        low, high = map(float, text.split(","))
    except ValueError:
        low = high = 0.0
    if not 0.0 <= low < high < float("inf"):
        raise ValueError(f"{text!r} is no LOW,HIGH in Hz with LOW < HIGH")
    return low, high


def _parse_variables(text: str) -> dict[str, str]:
    """Return from keys to names."""
    pairs = [word.partition("=") for word in text.split(",")]
    if not all(key.strip() and name.strip() for key, _, name in pairs):
        raise ValueError(f"{text!r} is no KEY=NAME,...")
    return {key.strip(): name.strip() for key, _, name in pairs}


@click.command("identify")
@click.argument("files", type=options.PATH, nargs=-1, required=True, metavar="FILE...")
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
@click.option(
    "--variables", callback=options.read_with(_parse_variables), metavar="KEY=NAME,...",
    help="What the variables of FILE are called: time or rate, motion, force, responses and "
    "references (labels); or frequencies, values. Default: by common names.",
)  # fmt: skip
@click.option(
    "--excitation", type=click.Choice(("hits", "random", "decay", "ambient")),
    help="How motions over time came about. Default: seen from force and motion.",
)  # fmt: skip
@click.option(
    "--estimator", type=click.Choice(("h1", "h2")), default="h1", show_default=True,
    help="h1 where the motions have the noise, h2 where the force has it.",
)  # fmt: skip
@options.quiet
@click.pass_context
def identify(
    ctx: click.Context,
    files: tuple[Path, ...],
    output: Path | None,
    band: tuple[float, float] | None,
    order: int | None,
    sensors: Path | None,
    variables: dict[str, str] | None,
    excitation: Excitation | None,
    estimator: Estimator,
    quiet: bool,
) -> None:
    """Find modes in measured responses, without a click.

    FILE holds frequency responses, or motions over time with or without the force (a universal
    file, .csv, .mat, .npz, .h5, .lvm); several are records of one state, or hold a part of its
    responses each. Ambient motions take femubench[identify].
    """
    if output is not None:
        check_new(output)
    from femubench.core.library.identify import identification_of, write_identification

    source = ", ".join(file.name for file in files)
    asked = (band, order, sensors, variables, excitation, estimator)
    with progress(source, quiet=quiet) as on_advance:
        found = identification_of(files, plugins_for(ctx), *asked, on_advance)
    if not quiet:
        click.echo(way_of("terminal", "render_modes")(found))
    if output is not None:
        write_identification(found, output, source=source)
        if not quiet:
            click.echo(f"\nwrote modes.csv, sensors.csv and identification.html to {output}")
            if not found.located:
                click.echo("The file has no coordinates: fill in x, y and z of sensors.csv.")
    if not quiet:
        read = output or (files[0] if len(files) == 1 else "FOLDER")
        and_so = ", with --output FOLDER here" if read == "FOLDER" else ""
        click.echo(f"Next: bench init CASE --model MODEL --modes {shlex.quote(str(read))}{and_so}")
