"""``bench run``: run strategies on cases, store the results, show the ranking."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femubench.core.cli import options
from femubench.core.cli.ending import telling
from femubench.core.cli.outputs import announce, finish, outputs_of
from femubench.core.cli.progress import progress
from femubench.core.cli.quantities import spoken, twins_of
from femubench.core.cli.registry import plugins_for, wrapped
from femubench.core.display import counted
from femubench.core.errors import InputError, PluginError
from femubench.core.library.cases import case_folders
from femubench.core.plugin.validation import chosen
from femubench.core.version import __version__

if TYPE_CHECKING:
    from femubench.core.child.sandbox import Sandbox
    from femubench.core.library.rank import Plan
    from femubench.core.plugin.loader import Plugins
    from femubench.core.run.recording import Overwrite
    from femubench.core.run.store import Store
    from femubench.core.schema.results import Run


# Words that would make a run another one.
_FIXED = (
    *("cases", "strategies", "seeds", "seed", "nominal", "twins"),
    *("timeouts", "memory", "resume", "overwrite"),
)


@click.command("run")
@click.argument("cases", metavar="[CASE]...", nargs=-1)
@click.option(
    "-s", "--strategy", "strategies", multiple=True, metavar="STRATEGY",
    help="Run this strategy, or STRATEGY:OPTION=VALUE,...; may be repeated. Default: all.",
)  # fmt: skip
@click.option(
    "--seeds", type=click.IntRange(1), metavar="N",
    help="Run N draws of measurement noise, seeds S+1 .. S+N, instead of the data as recorded.",
)  # fmt: skip
@click.option(
    "--seed", type=click.IntRange(0, 2**62), default=0, metavar="S", show_default=True,
    help="The first seed.",
)  # fmt: skip
@click.option(
    "--nominal", type=click.Choice(["drawn", "textbook", "both"]), default="both",
    show_default=True,
    help="The model that all strategies start from: as drawn, or with what handbooks give for "
    "torsion, shear and rotary inertia, from which the ranks are.",
)  # fmt: skip
@click.option(
    "--twins", callback=twins_of, metavar="N[:SEED]",
    help="Draw N twins of every case whose truth was computed, other structures under other "
    "names, and say who is good on the cases but not on them; run one job of each strategy twice.",
)  # fmt: skip
@click.option(
    "--resume", is_flag=True,
    help="Continue the last run of these jobs: run what is missing, and failed jobs again. Without "
    "CASE and -s, continue the last run in the store.",
)  # fmt: skip
@click.option(
    "--overwrite", type=click.Choice(["always", "missing", "failed"]),
    help="Which stored results of the same jobs are computed again: all, none, or the "
    "failures. Default: always; with --resume: failed.",
)  # fmt: skip
@click.option(
    "--locked", metavar="RUN",
    help="Repeat a stored run and report differences; exit 1 if a result differs.",
)  # fmt: skip
@click.option("--strict-plugins", is_flag=True, help="Stop with exit code 2 if a plugin is broken.")
@options.of_jobs("Write the results as JSON.")
@click.pass_context
def run(
    ctx: click.Context,
    /,
    cases: tuple[str, ...],
    strategies: tuple[str, ...],
    jobs: int | None,
    scheduler: str | None,
    cluster: str | None,
    sandbox: Sandbox,
    resume: bool,
    overwrite: Overwrite | None,
    locked: str | None,
    json_file: Path | None,
    csv_file: Path | None,
    store: Path | None,
    report_file: Path | None,
    quiet: bool,
    **asked: object,
) -> int:
    """Run strategies on cases and rank them.

    A CASE is a scenario (bench scenarios list), a group of them, one case of a scenario as
    SCENARIO/PART, or a folder with a case.toml. Without any, the scenarios of the default set run.
    """
    del asked  # what it is to be: `_plan` takes it from the context
    plugins = _checked(ctx, cases, strategies)
    from femubench.core.library.rank import repeated, request_of, store_in
    from femubench.core.library.report import reporter
    from femubench.core.run.executor import executor_of

    outputs = outputs_of(plugins, json_file, csv_file, report_file)
    kept = store_in(store)
    old = None if locked is None else kept.load(locked)
    plan = _plan(ctx, plugins, kept) if old is None else repeated(request_of(old), plugins)
    screen = None if quiet else reporter(plugins, "terminal")
    with (
        telling(kept, plan.jobs, screen, *_going_on(ctx)),
        executor_of(jobs, scheduler, cluster, sandbox) as executor,
    ):
        if not quiet:
            announce(_header(plan, executor.spoken), executor)
        with progress(quiet=quiet) as told:
            how: dict[str, Any] = {"overwrite": overwrite, "resume": resume, "told": told}
            outcome = plan.run(None, kept, executor, **how)
    code = finish(ctx, outcome, outputs, plugins, kept, screen, kept.exhibits)
    return code if old is None else _compare(old, outcome)


def _checked(ctx: click.Context, cases: Iterable[str], strategies: Iterable[str]) -> Plugins:
    """Return the plugins; words are known to be right before what runs them is loaded."""
    plugins = plugins_for(ctx)
    if ctx.params["strict_plugins"] and plugins.broken:
        raise PluginError(f"{counted(len(plugins.broken), 'fault')} in plugins, see above")
    chosen("strategy", (word.partition(":")[0] for word in strategies), plugins.strategies)
    case_folders(cases, plugins.scenarios)
    for name in _FIXED if ctx.params["locked"] is not None else ():
        if ctx.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT:
            raise InputError(f"--locked repeats a run as it was; {name} cannot be given beside it")
    return plugins


def _going_on(ctx: click.Context) -> tuple[Sequence[str], Sequence[str]]:
    """Return the words that make the same command go on with its run, and those that do not."""
    if ctx.params["locked"] is not None:
        return (), ()
    # `bench run --resume` alone goes on with the last run, as that was asked for.
    alone = not ctx.params["cases"] and not ctx.params["strategies"]
    return ("--resume",), (
        "--overwrite",
        *(("--seeds", "--seed", "--nominal", "--twins") if alone else ()),
    )


def _given(ctx: click.Context, name: str) -> Any:  # noqa: ANN401 - of any option
    """Return the value of an option; None where it has its default."""
    default = ctx.get_parameter_source(name) is click.core.ParameterSource.DEFAULT
    return None if default else ctx.params[name]


def _plan(ctx: click.Context, plugins: Plugins, store: Store) -> Plan:
    """Return what the words of the user stand for."""
    from femubench.core.library.rank import plan_of

    words = ctx.params
    limits = dict(words["timeouts"])
    return plan_of(
        words["cases"],
        words["strategies"],
        plugins,
        seeds=words["seeds"],
        seed=_given(ctx, "seed"),
        nominal=_given(ctx, "nominal"),
        timeout=limits.pop("", None),
        timeouts=limits,
        memory=words["memory"],
        resumed=store if words["resume"] else None,
        twins=words["twins"],
    )


def _compare(old: Run, new: Run) -> int:
    """Say what differs between a run and its repetition; return 1 where a result does."""
    from femubench.core.score.repeatability import environment_differences, result_differences

    around = environment_differences(old.meta, new.meta)
    results = result_differences(old, new)
    for title, lines in (("environment", around), ("results", results)):
        click.echo(f"{title}: {counted(len(lines), 'difference')} from run {old.meta['run']}")
        for line in lines:
            click.echo(wrapped(line, indent=2, hanging=4))
    return int(bool(results))


def _header(plan: Plan, place: str) -> str:
    """Return one line with everything that decides on the outcome."""
    request, cases, strategies = plan.request, len(plan.cases), len(plan.strategies)
    seeds = request.all_seeds
    named = f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {seeds[0]}-{seeds[-1]}"
    meaning = "data as recorded" if seeds == range(1) else "noise added"
    starts = {"drawn": "the models as drawn", "textbook": "the textbook models"}
    start = f" from {starts.get(request.nominal, 'both nominal models')}"
    own = "".join(f", {name} {spoken(limit)}" for name, limit in request.timeouts.items())
    return (
        f"femubench {__version__}: {counted(cases, 'case')}{start}, "
        f"{counted(strategies, 'strategy')}, {named} ({meaning}), {_twins(plan)}"
        f"{counted(plan.jobs, 'job')}, {place}, "
        f"timeout {spoken(request.timeout)}{own}"
    )


def _twins(plan: Plan) -> str:
    """Return how many twins of which kind there are, from which seed; nothing of none."""
    if not plan.request.twins:
        return ""
    twins = plan.beside.twins
    kinds = Counter(" and ".join(twin.families) for twin in twins)
    told = "".join(f"; {number} {kind}" for kind, number in kinds.items())
    return f"{counted(len(twins), 'twin')} (seed {plan.request.twin_seed}{told}), "
