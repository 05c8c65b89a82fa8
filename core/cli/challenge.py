"""The verb ``bench challenge``: write blind cases, and judge answers to them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from femubench.core.cli import options
from femubench.core.cli.registry import plugins_for
from femubench.core.schema.run_options import Where

if TYPE_CHECKING:
    from femubench.core.challenge.score import Judgement

_HIDDEN = ("one", "none", "pair", "outside", "any")


def _truth(what: str) -> options.Option:
    return click.option("--truth", "sealed", type=options.PATH, help=what)


@click.group()
def challenge() -> None:
    """Write blind cases with a hidden fault, and score answers."""


@challenge.command()
@click.argument("folder", type=options.PATH)
@click.option("--seed", type=click.IntRange(min=0), required=True, help="Of all that is random.")
@click.option(
    "--kind", type=click.Choice(("A", "B", "C")), default="A", show_default=True,
    help="How good the data are: A precise shapes, B poor shapes, C frequencies alone.",
)  # fmt: skip
@click.option("--structure", default="ladder", show_default=True, help="What is measured.")
@click.option(
    "--hidden", type=click.Choice(_HIDDEN), default="any", show_default=True,
    help="One effect, none, two, one outside the catalogue, or any of these.",
)  # fmt: skip
@click.option(
    "--scatter", type=click.FloatRange(0.0, 0.05), default=0.0, show_default=True,
    help="Standard deviation of each element's stiffness and mass, relative.",
)  # fmt: skip
@click.option(
    "--truths", type=options.PATH, metavar="DIR",
    help="Pose one of the truths in this folder, drawn by the seed, in place of drawing one.",
)  # fmt: skip
@click.option(
    "--reference", is_flag=True, help="With --truths: with the healthy structure as reference."
)
@_truth("Where the sealed truth goes; FOLDER/truth.sealed by default.")
@click.pass_context
def new(
    ctx: click.Context,
    /,
    folder: Path,
    seed: int,
    sealed: Path | None,
    **given: Any,  # noqa: ANN401 - as `challenge` has it
) -> None:
    """Write a blind case into FOLDER, which must be new or empty, and a sealed truth."""
    from femubench.core.library.challenge import challenge as blind

    if given["reference"] and given["truths"] is None:
        raise click.UsageError("--reference goes with --truths")
    for name in ("kind", "structure", "hidden", "scatter") if given["truths"] is not None else ():
        if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"--{name} has no effect with --truths")
    made = blind(folder, seed, truth=sealed, **given)
    click.echo(f"wrote {folder}")
    click.echo(f"wrote {made.truth}, the sealed truth, sha256 {made.commitment}")
    click.echo(f"Now say what the model lacks: bench diagnose {folder} --json answer.json")


@challenge.command()
@click.argument("folder", type=options.PATH)
@click.argument("answer", type=options.PATH)
@_truth("The sealed truth; FOLDER/truth.sealed by default.")
@click.option("--json", "json_file", type=options.OUTPUT_PATH, help="Write the scores.")
def score(folder: Path, answer: Path, sealed: Path | None, json_file: Path | None) -> None:
    """Score ANSWER, a file written by `bench diagnose --json`, for the blind case in FOLDER."""
    from femubench.core.files import write_atomically
    from femubench.core.library.challenge import score_challenge

    scored = score_challenge(folder, answer, truth=sealed)
    if json_file is not None:
        write_atomically(json_file, scored.to_json())
    click.echo(f"hidden: {scored.truth}")
    click.echo(
        f"chi-square of what is hidden: {', '.join(f'{d:.1f}' for d in scored.delta_chi2) or '0'}"
    )
    for line in _lines(scored.judgement):
        click.echo(line)
    click.echo(f"sealed truth sha256 {scored.commitment}")


@challenge.command()
@click.argument("folder", type=options.PATH)
@click.argument("cases", nargs=-1, required=True, type=options.PATH, metavar="CASE...")
def close(folder: Path, cases: tuple[Path, ...]) -> None:
    """Write CASEs into FOLDER with their unseen data encrypted.

    Strategies run on the open halves; the key is what FEMUBENCH_CLOSED_KEY is in the environment.
    """
    from femubench.core.library.challenge import close_cases

    written = close_cases(cases, folder)
    for path, digest in written.items():
        click.echo(f"wrote {path}, sha256 of the whole case {digest}")
    click.echo(f"Now: bench submit -s STRATEGY -o FILE.json {folder}/*")


@challenge.command()
@click.argument("folder", type=options.PATH)
@click.argument("answers", nargs=-1, required=True, type=options.PATH, metavar="ANSWERS...")
@options.of_fields(Where, "jobs")
@click.option("--json", "json_file", type=options.OUTPUT_PATH, help="Write the run.")
@click.pass_context
def judge(
    ctx: click.Context,
    folder: Path,
    answers: tuple[Path, ...],
    jobs: int | None,
    json_file: Path | None,
) -> None:
    """Rank strategies by the closed halves of FOLDER, from the ANSWERS of `bench submit`."""
    from femubench.core.library.challenge import judge_closed
    from femubench.core.library.report import render_report, report, reporter

    run = judge_closed(folder, answers, jobs)
    if json_file is not None:
        report(run, json_file, style="json")
    click.echo(render_report(reporter(plugins_for(ctx), "terminal"), run))


def _lines(judgement: Judgement) -> list[str]:
    verdict = "right" if judgement.right else "wrong"
    lines = [f"{verdict}: {judgement.reason}"]
    if judgement.names is not None:
        marks = {True: "right", False: "wrong", None: "-"}
        lines.append(f"name {marks[judgement.names]}, place {marks[judgement.places]}")
    if judgement.group:
        lines.append(f"out of a group of {judgement.group}")
    for size in judgement.sizes:
        off = "" if size.deviations is None else f", {size.deviations:+.1f} standard deviations off"
        stated, true = (f"{v:.4g} {size.unit}".strip() for v in (size.stated, size.true))
        lines.append(f"{size.effect}, {size.name}: {stated}, true {true}{off}")
    return lines
