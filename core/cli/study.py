"""``bench study``: how a strategy's gain depends on noise, sensors and options."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.cli.outputs import RunOutput
from femubench.core.cli.registry import plugins_for, wrap_text
from femubench.core.display import count_noun
from femubench.core.schema.run_options import RunOptions

if TYPE_CHECKING:
    from femubench.core.library.study import StudyPlan
    from femubench.core.run.store import Store


@click.command("study")
@click.argument("file", type=options.PATH)
@click.option(
    "--dry-run", is_flag=True,
    help="Check the file, say how many jobs there are and how long they take; run none.",
)  # fmt: skip
@options.of_fields(
    *(RunOptions, "overwrite"), default="failed", show_default=True,
    help="Which stored results of the same jobs are computed again: all, none, or the failures.",
)  # fmt: skip
@options.of_jobs("Write the results and the gain of every cell as JSON.")
@click.pass_context
def study(ctx: click.Context, /, file: Path, dry_run: bool, **asked: object) -> int:
    """Run strategies under conditions that vary: noise, sensors, options.

    FILE names cases, strategies with grids of options, seeds, noise and numbers of sensors left
    out (docs/studies.md). A study goes on where it stopped, and takes from the store what is
    there already.
    """
    del asked  # taken from the context
    plugins = plugins_for(ctx)
    from femubench.core.library.study import study_plan
    from femubench.core.run.executor import count_workers
    from femubench.core.study.study_file import read_study

    output, plan = RunOutput.of(ctx, plugins), study_plan(read_study(file), plugins)
    given, where = options.read_given(ctx)
    if dry_run:
        click.echo("\n".join(_forecast(plan, output.store, count_workers(where.jobs))))
        return 0
    plan = plan.limited(given)
    _, code = output.run(plan, lambda place: f"{_title(plan)}, {place}")
    return code


def _title(plan: StudyPlan) -> str:
    named = plan.axes.title or "study"
    cases = count_noun(len(plan.axes.values("case")), "case")
    seeds = count_noun(len(plan.options.all_seeds), "seed")
    over = f"{count_noun(plan.cells, 'cell')} on {cases}, {seeds}"
    return f"{named}: {over}, {count_noun(plan.jobs, 'job')}"


def _forecast(plan: StudyPlan, store: Store, workers: int) -> Iterator[str]:
    """Yield what a study is and how long it takes, a line each."""
    found, axes = plan.forecast(store), plan.axes
    yield _title(plan)
    for name in axes.names:
        values = ", ".join(map(axes.text_of, axes.values(name)))
        yield wrap_text(values, lead=f"{name}: ", indent=2, hanging=6)
    left = found.jobs - found.done
    yield f"{count_noun(found.done, 'job')} in {store.folder} already, {left} to run"
    unknown = sum(found.unknown.values())
    if left > unknown:
        least = "at least " if unknown else "about "
        yield wrap_text(
            f"{least}{_spoken(found.seconds)} of processor time, {_spoken(found.wall(workers))} on "
            f"{count_noun(workers, 'worker')}: medians of earlier results, and judging; processes "
            "take some time to start as well",
            hanging=2,
        )
    if unknown:
        pairs = ", ".join(f"{name} on {case} {n}" for (case, name), n in found.unknown.items())
        yield wrap_text(f"unknown, since no result is stored, jobs of: {pairs}", hanging=2)


def _spoken(seconds: float) -> str:
    """Return a duration with two digits that count."""
    for unit, size in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.{0 if seconds >= 9.95 * size else 1}f} {unit}"
    return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"
