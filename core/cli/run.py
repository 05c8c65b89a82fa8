"""``bench run``: run strategies on cases, store the results, show the ranking."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import click

import femubench
from femubench.core.case.case import Case
from femubench.core.cli.cases import read_cases
from femubench.core.cli.durations import seconds_of, spoken
from femubench.core.cli.files import check_writable, make_folder, write_atomically
from femubench.core.cli.progress import progress_bar
from femubench.core.cli.registry import chosen, counted, plugins_for, store_folder, wrapped
from femubench.core.cli.reporting import (
    exit_code,
    rendered,
    reporter,
    reporter_for,
    run_name,
)
from femubench.core.errors import InputError, PluginError
from femubench.core.harness.results import Run
from femubench.core.harness.runner import run_jobs
from femubench.core.harness.store import Store
from femubench.core.plugin.loader import Plugins
from femubench.core.plugin.roles import Reporter
from femubench.core.plugin.variants import strategy_of

FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)


@click.command("run")
@click.argument("cases", metavar="[CASE]...", nargs=-1)
@click.option(
    "-s",
    "--strategy",
    "strategies",
    multiple=True,
    metavar="STRATEGY",
    help="Run this strategy, or STRATEGY:OPTION=VALUE,...; may be repeated. Default: all.",
)
@click.option(
    "-j",
    "--jobs",
    type=click.IntRange(1),
    metavar="N",
    help="Number of worker processes. Default: one a core.",
)
@click.option(
    "--seeds",
    type=click.IntRange(1),
    metavar="N",
    help="Run N draws of measurement noise, seeds S+1 .. S+N, instead of the data as recorded.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    metavar="S",
    show_default=True,
    help="The first seed.",
)
@click.option(
    "--timeout",
    callback=seconds_of,
    default="10m",
    metavar="DURATION",
    show_default=True,
    help="Give up on a job after this time, e.g. 90s, 10m, 1h.",
)
@click.option("--json", "json_file", type=FILE, metavar="FILE", help="Write the results as JSON.")
@click.option("--csv", "csv_file", type=FILE, metavar="FILE", help="Write one line a job as CSV.")
@click.option(
    "--store",
    type=FOLDER,
    metavar="DIR",
    help="Keep results there. Default: $FEMUBENCH_STORE or femubench-results.",
)
@click.option(
    "--report",
    "report_file",
    type=FILE,
    metavar="FILE",
    help="Write the report there; its suffix tells the format. Default: DIR/RUN.md in the store.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.pass_context
def run(
    ctx: click.Context,
    cases: tuple[str, ...],
    strategies: tuple[str, ...],
    jobs: int | None,
    seeds: int | None,
    seed: int,
    timeout: float,
    json_file: Path | None,
    csv_file: Path | None,
    store: Path | None,
    report_file: Path | None,
    quiet: bool,
) -> int:
    """Run strategies on cases and rank them.

    A CASE is a scenario (bench scenarios list), one case of it such as design-change/PART, or a
    folder with a case.toml. Without any, all built-in scenarios run.
    """
    plugins = plugins_for(ctx)
    chosen("strategy", (words.partition(":")[0] for words in strategies), plugins.strategies)
    names = tuple(dict.fromkeys(strategies)) or tuple(plugins.strategies)
    if not names:
        raise InputError("there is no strategy to run", expected="a plugin that brings one")
    selected = [strategy_of(words, plugins.strategies) for words in names]
    outputs = _outputs(plugins, json_file, csv_file, report_file)
    read = read_cases(cases, plugins)
    folder = store_folder(store)
    make_folder(folder)
    workers = jobs or len(os.sched_getaffinity(0))
    # Seed 0 is the data as recorded; several runs are draws of noise and nothing else.
    all_seeds = range(seed, seed + 1) if seeds is None else range(seed + 1, seed + seeds + 1)
    if not quiet:
        click.echo(wrapped(_header(read, names, all_seeds, workers, timeout), hanging=2))
    with progress_bar(quiet=quiet) as progress:
        outcome = run_jobs(
            read,
            selected,
            seeds=tuple(all_seeds),
            jobs=workers,
            timeout=timeout,
            store=Store(folder),
            progress=progress,
            run_seed=seed,
        )
    if report_file is None:
        markdown = reporter(plugins, "markdown")
        outputs[folder / f"{run_name(outcome)}{markdown.suffix}"] = markdown
    _finish(outcome, outputs, None if quiet else reporter(plugins, "terminal"))
    return exit_code(outcome)


def _outputs(
    plugins: Plugins, json_file: Path | None, csv_file: Path | None, report_file: Path | None
) -> dict[Path, Reporter]:
    """Return who writes which file; all of them can be written to."""
    outputs: dict[Path, Reporter] = {}
    for path, name in ((json_file, "json"), (csv_file, "csv"), (report_file, None)):
        if path is None:
            continue
        if path in outputs:
            raise InputError("is to hold two outputs", file=path, expected="a file for each")
        check_writable(path)
        outputs[path] = reporter(plugins, name) if name else reporter_for(plugins, path)
    return outputs


def _header(
    cases: Sequence[Case], strategies: Sequence[str], seeds: range, workers: int, timeout: float
) -> str:
    """Return one line with everything that decides on the outcome."""
    named = f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {seeds[0]}-{seeds[-1]}"
    meaning = "data as recorded" if seeds == range(1) else "noise added"
    total = len(cases) * len(strategies) * len(seeds)
    return (
        f"femubench {femubench.__version__}: {counted(len(cases), 'case')}, "
        f"{counted(len(strategies), 'strategy')}, {named} ({meaning}), {counted(total, 'job')}, "
        f"{counted(workers, 'worker')}, timeout {spoken(timeout)}"
    )


def _finish(run: Run, outputs: dict[Path, Reporter], screen: Reporter | None) -> None:
    """Write the files, then show the ranking and where the files are."""
    written, broken = [], None
    for path, writer in outputs.items():
        try:
            write_atomically(path, rendered(writer, run))
            written.append(f"{writer.name}: {path}")
        except PluginError as fault:
            broken = fault
    if screen is not None:
        click.echo()
        click.echo("\n".join([rendered(screen, run), *written]))
    if broken is not None:
        raise broken
