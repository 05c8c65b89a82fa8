"""``bench compare``: two runs side by side, and an exit code for whoever guards a strategy."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from femubench.core.cli.files import check_writable, write_atomically
from femubench.core.cli.registry import chosen, store_folder
from femubench.core.run.store import Store
from femubench.core.schema.records import finite, read_run
from femubench.core.schema.results import Run
from femubench.core.score.comparison import (
    DEFAULT_THRESHOLDS,
    METRICS,
    Against,
    Comparison,
    Threshold,
    compare_runs,
)

FORMATS = ("terminal", "markdown", "html", "json")
_THRESHOLD = re.compile(r"\s*(\w+)\s*>\s*([0-9][0-9.eE+-]*)\s*")


def thresholds_of(
    ctx: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> tuple[Threshold, ...]:
    """Return what ``--fail`` says, the default where it is not given.

    Raises:
        BadParameter: for anything but METRIC>NUMBER.
    """
    return tuple(_threshold(text, ctx, parameter) for text in texts) or DEFAULT_THRESHOLDS


def _threshold(text: str, ctx: click.Context, parameter: click.Parameter) -> Threshold:
    found = _THRESHOLD.fullmatch(text)
    if found is not None:
        for metric in METRICS:
            if metric == found[1]:
                try:
                    most = float(found[2])
                except ValueError:
                    break
                if math.isfinite(most):
                    return Threshold(metric, most)
    message = (
        f"{text!r} is no threshold (expected METRIC>NUMBER, METRIC one of {', '.join(METRICS)})"
    )
    raise click.BadParameter(message, ctx, parameter)


@click.command("compare")
@click.argument("before", metavar="A")
@click.argument("after", metavar="[B]", required=False)
@click.option(
    "-s",
    "--strategy",
    "strategies",
    multiple=True,
    metavar="STRATEGY",
    help="Compare this strategy only; may be repeated.",
)
@click.option(
    "--of",
    "first",
    metavar="X",
    help="Compare strategy X of A, and none else, B being optional.",
)
@click.option(
    "--with", "second", metavar="Y", help="With strategy Y of B, or of A where there is no B."
)
@click.option(
    "--fail",
    "thresholds",
    multiple=True,
    metavar="METRIC>X",
    callback=thresholds_of,
    help="Exit with 1 if a ratio B/A exceeds X: skill, used, higher, modified, seconds; or the "
    "number of lost results: failures. May be repeated. Default: skill>1.01 and failures>0.",
)
@click.option(
    "-f",
    "--format",
    "form",
    type=click.Choice(FORMATS),
    default="terminal",
    show_default=True,
    help="What is printed or written.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write there instead of the screen.",
)
@click.option(
    "--store",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Where the runs are. Default: $FEMUBENCH_STORE or femubench-results.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.pass_context
def compare(
    ctx: click.Context,
    before: str,
    after: str | None,
    strategies: tuple[str, ...],
    first: str | None,
    second: str | None,
    thresholds: tuple[Threshold, ...],
    form: str,
    output: Path | None,
    store: Path | None,
    quiet: bool,
) -> None:
    """Compare run B with run A; exit with 1 if B is worse.

    A and B are run ids in the store, their first letters, or files that run --json wrote. With
    --of X --with Y strategy Y of B is set beside strategy X of A, or both are taken from A.
    """
    if (first is None) != (second is None) or (strategies and first is not None):
        raise click.UsageError("--of and --with belong together, without --strategy", ctx)
    if after is None and first is None:
        raise click.UsageError("one run alone (expected A B, or A --of X --with Y)", ctx)
    if output is not None:
        check_writable(output)
    folder = store_folder(store)
    one = _find(before, folder)
    other = one if after is None else _find(after, folder)
    known = [[result.strategy for result in run.results] for run in (one, other)]
    against = None
    if first is not None and second is not None:
        chosen("strategy", (first,), known[0])
        chosen("strategy", (second,), known[1])
        against = Against(first, second)
    wanted = chosen("strategy", strategies, (*known[0], *known[1]))
    found = compare_runs(one, other, thresholds=thresholds, strategies=wanted, against=against)
    if output is not None or not quiet:
        text = _writer(form)(found)
        if output is not None:
            write_atomically(output, text)
        else:
            click.echo(text)
    if output is not None and not quiet:
        click.echo(f"{form}: {output}")
    ctx.exit(int(found.worse))


def _writer(form: str) -> Callable[[Comparison], str]:
    from femubench.reports import compare_page

    if form == "json":
        return lambda found: json.dumps(_data(found), indent=1, allow_nan=False)
    writers: dict[str, Callable[[dict[str, Any]], str]] = {
        "terminal": compare_page.comparison_text,
        "markdown": compare_page.comparison_markdown,
        "html": compare_page.comparison_html,
    }
    return lambda found: writers[form](_data(found))


def _data(found: Comparison) -> dict[str, Any]:
    data: dict[str, Any] = finite(found.to_json())
    return data


def _find(word: str, folder: Path) -> Run:
    """Return a run from a file or from the store."""
    if os.path.exists(word) and not os.path.isdir(word):
        return read_run(Path(word))
    return Store(folder).load(word)
