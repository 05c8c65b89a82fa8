"""``bench compare``: two runs side by side, and an exit code for anyone who guards a strategy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.files import write_atomically

if TYPE_CHECKING:
    from femubench.core.score.comparison import Threshold


def fail_option(what: str) -> options.Option:
    """Return the option for what counts as worse."""

    def parse(texts: tuple[str, ...]) -> tuple[Threshold, ...]:
        if not texts:
            return ()
        from femubench.core.library.compare import threshold_of

        return tuple(map(threshold_of, texts))

    return click.option(
        "--fail", "thresholds", multiple=True, metavar="METRIC>X",
        callback=options.read_with(parse), help=what,
    )  # fmt: skip


@click.command("compare")
@click.argument("before", metavar="A")
@click.argument("after", metavar="[B]", required=False)
@click.option(
    "--of", "first", metavar="X", help="Compare strategy X of A, and none else, B being optional."
)
@click.option(
    "--with", "second", metavar="Y", help="With strategy Y of B, or of A where there is no B."
)
@click.option(
    "-s", "--strategy", "strategies", multiple=True, metavar="STRATEGY",
    help="This one only; repeat.",
)  # fmt: skip
@fail_option(
    "Exit with 1 if X is exceeded by the loss of gain, a ratio B/A (used, higher, modified, "
    "seconds) or the number of lost results: failures. May be repeated. Default: loss>0.01 and "
    "failures>0."
)
@options.style(
    "terminal", "markdown", "html", "json", dest="form", what="What is printed or written."
)
@click.option(
    "-o", "--output", type=options.OUTPUT_PATH, metavar="FILE",
    help="Write there instead of the screen.",
)  # fmt: skip
@options.store("Where the runs are.")
@options.quiet
@click.pass_context
def compare(
    ctx: click.Context,
    before: str,
    after: str | None,
    first: str | None,
    second: str | None,
    strategies: tuple[str, ...],
    thresholds: tuple[Threshold, ...],
    form: str,
    output: Path | None,
    store: Path | None,
    quiet: bool,
) -> None:
    """Compare run B with run A; exit with 1 if B is worse.

    A and B are run ids in the store, their first letters, or files that run --json wrote. With
    --of X --with Y strategy Y of B is compared with strategy X of A, or both are taken from A.
    """
    from femubench.core.library.compare import compare as side_by_side
    from femubench.core.library.report import rendering

    if (first is None) != (second is None) or (strategies and first is not None):
        raise click.UsageError("--of and --with belong together, without --strategy", ctx)
    if after is None and first is None:
        raise click.UsageError("one run alone (expected A B, or A --of X --with Y)", ctx)
    found = side_by_side(
        before,
        after,
        strategies=strategies,
        against=None if first is None or second is None else (first, second),
        fail=thresholds,
        store=store,
    )
    if output is not None:
        write_atomically(output, rendering(found, form))
    elif not quiet:
        click.echo(rendering(found, form))
    if output is not None and not quiet:
        click.echo(f"{form}: {output}")
    ctx.exit(int(found.worse))
