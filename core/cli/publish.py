"""``bench publish``: result files of several machines as a static site."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from femubench.core.cli import options
from femubench.core.display import count_noun


@click.command("publish")
@click.argument("folder", metavar="DIR", type=options.PATH)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=options.PATH)
@click.option(
    "--unverified", is_flag=True,
    help="Take also what cannot be checked, and say so on the site: runs without sandbox or "
    "twins, of cases that are not installed here, or whose figures do not agree.",
)  # fmt: skip
@click.option(
    "--address", metavar="URL",
    help="Where the site will be found: its feeds then have whole links, and there is one in JSON. "
    "A later call need not tell it again.",
)  # fmt: skip
@click.option(
    "--rerun", type=click.IntRange(0), metavar="N", default=3, show_default=True,
    help="Run N jobs of each run that comes with its updated models again, drawn by chance, where "
    "the strategy is installed in the same version.",
)  # fmt: skip
@options.quiet
def publish(folder: Path, files: tuple[Path, ...], quiet: bool, **given: Any) -> None:  # noqa: ANN401
    """Merge result files into a static site in DIR.

    A FILE is written by submit or run --json, here or on another machine, with its updated models
    next to it in .answers. DIR is new, empty, or written by an earlier publish, and then the files
    are added. If one file is invalid, or is no complete run in a sandbox and with twins whose
    figures agree with the cases and with its models, nothing is written.
    """
    from femubench.core.library.publish import publish as merge

    done = merge(folder, files, **given, tell=(lambda line: None) if quiet else click.echo)
    if quiet:
        return
    runs, index = len(done.index["runs"]), folder / "index.html"
    click.echo(
        f"{count_noun(len(done.added), 'new run')}, {count_noun(runs, 'run')} and "
        f"{count_noun(len(done.index['strategies']), 'strategy')} in all: {index}"
    )
    if done.index["conflicts"]:
        click.echo(
            f"bench: {count_noun(len(done.index['conflicts']), 'job')} with results that "
            "contradict each other; they are flagged",
            err=True,
        )
