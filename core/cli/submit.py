"""``bench submit``: a strategy checked, run and compared, for a leaderboard or a CI job."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.cli.compare import fail_option
from femubench.core.cli.progress import progress
from femubench.core.cli.registry import plugins_for
from femubench.core.plugin.validation import choose_names
from femubench.core.schema.run_options import RunOptions, Where

if TYPE_CHECKING:
    from femubench.core.score.comparison import Threshold


@click.command("submit")
@click.argument("cases", metavar="[CASE]...", nargs=-1)
@click.option(
    "-s", "--strategy", "strategies", multiple=True, required=True, metavar="STRATEGY",
    help="The one to submit; may be repeated.",
)  # fmt: skip
@click.option(
    "-o", "--output", type=options.OUTPUT, metavar="FILE", default="submission.json",
    show_default=True,
    help="The result file, for bench publish; next to it come the updated models, in .answers.",
)  # fmt: skip
@click.option(
    "--baseline", type=options.PATH, metavar="FILE",
    help="The result file of an earlier run; exit with 1 if this one is worse.",
)  # fmt: skip
@fail_option("What is worse, as in bench compare. Default: loss>0.01 and failures>0.")
@click.option(
    "--summary", type=options.OUTPUT, metavar="FILE", envvar="GITHUB_STEP_SUMMARY",
    help="Append what came out as Markdown. Default: $GITHUB_STEP_SUMMARY.",
)  # fmt: skip
@options.of_fields(
    *(RunOptions, "twins"), default="2", show_default=True,
    help="Twins of every case, as in bench run; a leaderboard asks for two.",
)  # fmt: skip
@options.of_fields(RunOptions, "timeouts")
@options.of_fields(Where, "sandbox", "jobs")
@options.quiet
@click.pass_context
def submit(
    ctx: click.Context,
    /,
    cases: tuple[str, ...],
    strategies: tuple[str, ...],
    output: Path,
    baseline: Path | None,
    thresholds: tuple[Threshold, ...],
    summary: Path | None,
    quiet: bool,
    **asked: object,
) -> int:
    """Check, run and compare a strategy for a leaderboard.

    Its rules are checked as by plugins check, it runs on the cases and their twins, and the result
    file is compared with a baseline. Exit with 1 if it breaks a rule, crashes, or is worse.
    """
    del asked  # taken from the context
    plugins = plugins_for(ctx)
    choose_names("strategy", (word.partition(":")[0] for word in strategies), plugins.strategies)
    from femubench.core.library.submit import submit as prepared, summary_of

    given, where = options.read_given(ctx)
    with progress(quiet=quiet) as advance:
        found = prepared(
            strategies, cases, {"twins": 2, **given}, where, output=output,
            baseline=baseline, fail=thresholds, on_advance=advance,
            tell=(lambda line: None) if quiet else click.echo,
        )  # fmt: skip
    if summary is not None:
        with summary.open("a", encoding="utf-8") as file:
            file.write(summary_of(found))
    if found.unverified and not quiet:
        click.echo(f"a leaderboard takes it as unverified alone: {found.unverified}")
    for line in found.faults:
        click.echo(f"bench: {line}", err=True)
    if not quiet:
        click.echo(f"{'not accepted' if found.faults else 'accepted'}: {os.fspath(output)}")
    return int(bool(found.faults))
