"""``bench study``: how a strategy's skill depends on noise, sensors and options."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.cli.ending import telling
from femubench.core.cli.outputs import announce, finish, outputs_of
from femubench.core.cli.progress import progress
from femubench.core.cli.registry import plugins_for, wrapped
from femubench.core.display import counted

if TYPE_CHECKING:
    from femubench.core.child.sandbox import Sandbox
    from femubench.core.library.study import StudyPlan
    from femubench.core.run.recording import Overwrite
    from femubench.core.run.store import Store


@click.command("study")
@click.argument("file", type=options.PATH)
@click.option(
    "--dry-run", is_flag=True,
    help="Check the file, say how many jobs there are and how long they take; run none.",
)  # fmt: skip
@click.option(
    "--overwrite", type=click.Choice(["always", "missing", "failed"]), default="failed",
    show_default=True,
    help="Which stored results of the same jobs are computed again: all, none, or the failures.",
)  # fmt: skip
@options.of_jobs("Write the results and the skill of every cell as JSON.")
@click.pass_context
def study(
    ctx: click.Context,
    file: Path,
    dry_run: bool,
    jobs: int | None,
    scheduler: str | None,
    cluster: str | None,
    sandbox: Sandbox,
    timeouts: dict[str, float],
    memory: int | None,
    overwrite: Overwrite,
    json_file: Path | None,
    csv_file: Path | None,
    store: Path | None,
    report_file: Path | None,
    quiet: bool,
) -> int:
    """Run strategies under conditions that vary: noise, sensors, options.

    FILE names cases, strategies with grids of options, seeds, noise and numbers of sensors left
    out (docs/studies.md). A study goes on where it stopped, and takes from the store what is
    there already.
    """
    plugins = plugins_for(ctx)
    from femubench.core.library.rank import store_in
    from femubench.core.library.report import reporter
    from femubench.core.library.study import study_plan
    from femubench.core.run.executor import executor_of, worker_count
    from femubench.core.study.study_file import read_study

    outputs = outputs_of(plugins, json_file, csv_file, report_file)
    kept, plan = store_in(store), study_plan(read_study(file), plugins)
    if dry_run:
        click.echo("\n".join(_forecast(plan, kept, worker_count(jobs))))
        return 0
    limits = dict(timeouts)
    screen = None if quiet else reporter(plugins, "terminal")
    with (
        telling(kept, plan.jobs, screen),
        executor_of(jobs, scheduler, cluster, sandbox) as executor,
    ):
        if not quiet:
            announce(f"{_title(plan)}, {executor.spoken}", executor)
        with progress(quiet=quiet) as told:
            found = plan.run(
                executor,
                kept,
                timeout=limits.pop("", None),
                timeouts=limits,
                memory=memory,
                overwrite=overwrite,
                told=told,
            )
    return finish(ctx, found, outputs, plugins, kept, screen)


def _title(plan: StudyPlan) -> str:
    named = plan.axes.title or "study"
    cases = counted(len(plan.axes.values("case")), "case")
    over = f"{counted(plan.cells, 'cell')} on {cases}, {counted(len(plan.seeds), 'seed')}"
    return f"{named}: {over}, {counted(plan.jobs, 'job')}"


def _forecast(plan: StudyPlan, store: Store, workers: int) -> Iterator[str]:
    """Yield what a study is and how long it takes, a line each."""
    found, axes = plan.forecast(store), plan.axes
    yield _title(plan)
    for name in axes.names:
        values = ", ".join(map(axes.text_of, axes.values(name)))
        yield wrapped(values, lead=f"{name}: ", indent=2, hanging=6)
    left = found.jobs - found.done
    yield f"{counted(found.done, 'job')} in {store.folder} already, {left} to run"
    unknown = sum(found.unknown.values())
    if left > unknown:
        least = "at least " if unknown else "about "
        yield wrapped(
            f"{least}{_spoken(found.seconds)} of processor time, {_spoken(found.wall(workers))} on "
            f"{counted(workers, 'worker')}: medians of earlier results, and judging; processes "
            "take some time to start besides",
            hanging=2,
        )
    if unknown:
        pairs = ", ".join(f"{name} on {case} {n}" for (case, name), n in found.unknown.items())
        yield wrapped(f"unknown, since no result is stored, jobs of: {pairs}", hanging=2)


def _spoken(seconds: float) -> str:
    """Return a duration with two digits that count."""
    for unit, size in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.{0 if seconds >= 9.95 * size else 1}f} {unit}"
    return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"
