"""The verb ``bench init``: write a case folder to start from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femubench.core.cli import options
from femubench.core.cli.registry import plugins_for, wrap_text
from femubench.core.display import count_noun
from femubench.core.errors import ModelError

if TYPE_CHECKING:
    from femubench.core.case.case import Case

_UNITS = click.Choice(("m", "cm", "mm", "in", "ft"))


def _parse_origin(text: str) -> str:
    """Return three numbers as TOML has them."""
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        raise ValueError(f"{text!r} is no X,Y,Z in m") from None
    return f"{x}, {y}, {z}"


@click.command()
@click.argument("folder", type=options.PATH)
@click.option(
    "--model", type=options.PATH, metavar="FILE", help="The model, or its stiffness alone."
)
@click.option("--mass", type=options.PATH, metavar="FILE", help="Its mass, where that is apart.")
@click.option(
    "--dofs", type=options.PATH, metavar="FILE",
    help="Labels or places of the rows, where the matrices have none.",
)  # fmt: skip
@click.option(
    "--modes", type=options.PATH, metavar="FILE", multiple=True,
    help="The measured modes: a file of modes or of responses, or the folder that "
    "`bench identify` wrote. Several are repeats of one test.",
)  # fmt: skip
@click.option(
    "--reference", type=options.PATH, metavar="FILE",
    help="The structure as it was, like --modes: `bench diagnose` then seeks what differs.",
)  # fmt: skip
@click.option(
    "--sensors", type=options.PATH, metavar="FILE",
    help="Where the sensors are, if the file of modes does not say.",
)  # fmt: skip
@click.option("--unit", type=_UNITS, help="Of the sensors' places. Default: seen from their size.")
@click.option("--model-unit", type=_UNITS, help="Of the model's lengths. Default: m.")
@click.option(
    "--frame", metavar="AXES",
    help="The axes of the model in those of the test, e.g. x,z,-y. Default: x,y,z.",
)  # fmt: skip
@click.option(
    "--directions", metavar="AXES", help="The same of the sensors' directions alone.",
)  # fmt: skip
@click.option(
    "--tolerance", type=float, metavar="X",
    help="How far a sensor may be from the structure, of its size. Default: 0.01.",
)  # fmt: skip
@click.option(
    "--origin", callback=options.read_with(_parse_origin), metavar="X,Y,Z",
    help="Where the origin of the test is on the model, in m.",
)  # fmt: skip
@click.option("--without", metavar="LABELS", help="Sensors that are left out, by comma.")
@click.pass_context
def init(
    ctx: click.Context,
    /,
    folder: Path,
    model: Path | None,
    modes: tuple[Path, ...],
    **stated: Any,  # noqa: ANN401 - as `Beginning` has it
) -> None:
    """Write a case folder into FOLDER, which must be new or empty.

    With the files of a model and of a test, these are copied, the sensors matched with the model,
    and a case is written that runs; without any, a commented example.
    """
    if model is None and not modes and all(other is None for other in stated.values()):
        from femubench.core.library.plugins import init_case

        for path in init_case(folder):
            click.echo(f"wrote {path}")
        click.echo(f"Now change it to your structure, and run: bench run {folder}")
        return
    from femubench.core.case.starting import Beginning
    from femubench.core.library.new_case import begin_case

    given = Beginning.of(model, modes, **stated)
    case = begin_case(folder, given, plugins_for(ctx))
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        click.echo(f"wrote {path}")
    _show_match(case)
    click.echo(f"Next, once {folder / 'case.toml'} says what you know: bench diagnose {folder}")


def _show_match(case: Case) -> None:
    """Print how well model and test go together, and which modes are held out."""
    from femubench.core.case.starting import sizes_of
    from femubench.core.score.scoring import predict_block

    click.echo(wrap_text(f"The model {sizes_of(case.whole or case.model)}.", hanging=2))
    for note in case.notes:
        click.echo(wrap_text(f"Note: {note}", hanging=2))
    if case.matches:
        far = max(case.matches, key=lambda match: match.distance)
        text = f"{count_noun(len(case.matches), 'sensor')} matched; furthest from its place is "
        text += f"{far.sensor}, {far.distance:.3g} m from {far.place}."
        click.echo(wrap_text(text, hanging=2))
    try:
        pairs = predict_block(case.model, case.measurement, None)
    except ModelError as error:
        click.echo(wrap_text(f"Note: the model cannot be solved: {error}", hanging=2))
        return
    click.echo(f"{'mode':>4} {'measured':>11} {'model':>11} {'MAC':>6}")
    for pair in pairs:
        hertz = "-" if pair.predicted_hz is None else f"{pair.predicted_hz:.5g} Hz"
        likeness = "-" if pair.mac is None else f"{pair.mac:.3f}"
        held = "  held out" if pair.number in case.held_out else ""
        measured = f"{pair.measured_hz:.5g} Hz"
        click.echo(f"{pair.number:>4} {measured:>11} {hertz:>11} {likeness:>6}{held}")
