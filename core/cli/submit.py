"""``bench submit``: a strategy checked, run and compared, for a leaderboard or a CI job."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.cli.compare import thresholds_of
from femubench.core.cli.progress import progress
from femubench.core.cli.quantities import twins_of
from femubench.core.cli.registry import plugins_for
from femubench.core.plugin.validation import chosen

if TYPE_CHECKING:
    from femubench.core.child.sandbox import Sandbox
    from femubench.core.library.rank import Twins
    from femubench.core.score.comparison import Threshold


@click.command("submit")
@click.argument("cases", metavar="[CASE]...", nargs=-1)
@click.option(
    "-s", "--strategy", "strategies", multiple=True, required=True, metavar="STRATEGY",
    help="The one to submit; may be repeated.",
)  # fmt: skip
@click.option(
    "-o", "--output", type=options.OUTPUT, metavar="FILE", default="submission.json",
    show_default=True, help="The result file, for bench publish.",
)  # fmt: skip
@click.option(
    "--baseline", type=options.PATH, metavar="FILE",
    help="The result file of an earlier run; exit with 1 if this one is worse.",
)  # fmt: skip
@click.option(
    "--fail", "thresholds", multiple=True, metavar="METRIC>X", callback=thresholds_of,
    help="What is worse, as in bench compare. Default: unseen>1.01 and failures>0.",
)  # fmt: skip
@click.option(
    "--summary", type=options.OUTPUT, metavar="FILE", envvar="GITHUB_STEP_SUMMARY",
    help="Append what came out as Markdown. Default: $GITHUB_STEP_SUMMARY.",
)  # fmt: skip
@click.option(
    "--twins", callback=twins_of, metavar="N[:SEED]", default="2", show_default=True,
    help="Twins of every case, as in bench run; a leaderboard asks for two.",
)  # fmt: skip
@options.timeouts
@options.sandbox
@options.jobs
@options.quiet
@click.pass_context
def submit(
    ctx: click.Context,
    cases: tuple[str, ...],
    strategies: tuple[str, ...],
    output: Path,
    baseline: Path | None,
    thresholds: tuple[Threshold, ...],
    summary: Path | None,
    twins: Twins,
    timeouts: dict[str, float],
    sandbox: Sandbox,
    jobs: int | None,
    quiet: bool,
) -> int:
    """Check, run and compare a strategy for a leaderboard.

    Its rules are checked as by plugins check, it runs on the cases and their twins, and the result
    file is compared with a baseline. Exit with 1 if it breaks a rule, crashes, or is worse.
    """
    plugins = plugins_for(ctx)
    chosen("strategy", (word.partition(":")[0] for word in strategies), plugins.strategies)
    from femubench.core.library.submit import submit as prepared, summary_of

    with progress(quiet=quiet) as told:
        found = prepared(
            strategies, cases, output=output, baseline=baseline, fail=thresholds, twins=twins,
            sandbox=sandbox, jobs=jobs, timeouts=timeouts, told=told,
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
