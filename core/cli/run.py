"""``bench run``: run strategies on cases, store the results, show the ranking."""

from __future__ import annotations

import shlex
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.cli.outputs import RunOutput
from femubench.core.cli.registry import plugins_for, wrap_text
from femubench.core.display import count_noun
from femubench.core.errors import InputError
from femubench.core.library.cases import LEFT_OUT, case_folders
from femubench.core.plugin.validation import choose_names
from femubench.core.schema.quantities import say_duration
from femubench.core.schema.run_options import DEFAULT_TIMEOUT, RunOptions
from femubench.core.version import __version__

if TYPE_CHECKING:
    from femubench.core.plugin.loader import Plugins
    from femubench.core.run.runner import Plan
    from femubench.core.schema.results import RunData


# Words that would make a run another one.
_FIXED = (
    *("cases", "strategies", "seeds", "nominal", "drawing", "twins"),
    *("timeouts", "memory", "resume", "overwrite"),
)


@click.command("run")
@click.argument("cases", metavar="[CASE]...", nargs=-1)
@click.option(
    "-s", "--strategy", "strategies", multiple=True, metavar="STRATEGY",
    help="Run this strategy, or STRATEGY:OPTION=VALUE,...; may be repeated. Default: all.",
)  # fmt: skip
@options.of_fields(RunOptions, "seeds", "nominal", "drawing", "twins", "resume", "overwrite")
@click.option(
    "--locked", metavar="RUN",
    help="Repeat a stored run and report differences; exit 1 if a result differs.",
)  # fmt: skip
@options.of_jobs("Write the results as JSON.")
@click.pass_context
def run(
    ctx: click.Context,
    /,
    cases: tuple[str, ...],
    strategies: tuple[str, ...],
    locked: str | None,
    **asked: object,
) -> int:
    """Run strategies on cases and rank them.

    A CASE is a scenario (bench scenarios list), a group of them, one case of a scenario as
    SCENARIO/PART, or a folder with a case.toml. Without any, the scenarios of the default set run.
    """
    del asked  # taken from the context
    plugins = _checked(ctx, cases, strategies)
    from femubench.core.library.rank import plan_again, plan_run, request_of
    from femubench.core.score.leaderboard import list_rows

    output = RunOutput.of(ctx, plugins)
    old = None if locked is None else output.store.load(locked)
    given, _ = options.read_given(ctx)
    plan = (
        plan_run(cases, strategies, plugins, given, output.store)
        if old is None
        else plan_again(request_of(old), plugins)
    )
    outcome, code = output.run(plan, partial(_header, plan), output.store.exhibits, *_going_on(ctx))
    if len(cases) == 1 and Path(cases[0]).is_dir() and not ctx.params["quiet"]:
        rows = list_rows(outcome)
        if lead := next((r["strategy"] for r in rows if r["rank"] == 1 and r["gain"] > 0.0), None):
            options_of = getattr(plugins.strategies.get(lead), "writable", "")
            lead = shlex.quote(f"{lead}:{options_of}" if options_of else lead)
            click.echo(f"Next: bench update {cases[0]} -s {lead} -o updated")
    return code if old is None else _compare(old, outcome)


def _checked(ctx: click.Context, cases: Iterable[str], strategies: Iterable[str]) -> Plugins:
    """Return the plugins; words are known to be right before what runs them is loaded."""
    plugins = plugins_for(ctx)
    choose_names("strategy", (word.partition(":")[0] for word in strategies), plugins.strategies)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        case_folders(cases, plugins.scenarios, ctx.params["drawing"])
    for note in said:
        click.echo(f"bench: {note.message}", err=True)
    warnings.filterwarnings("ignore", LEFT_OUT)  # said above
    for name in _FIXED if ctx.params["locked"] is not None else ():
        if options.is_given(ctx, name):
            raise InputError(f"--locked repeats a run as it was; {name} cannot be given with it")
    return plugins


def _going_on(ctx: click.Context) -> tuple[Sequence[str], Sequence[str]]:
    """Return the words that make the same command go on with its run, and those that do not."""
    if ctx.params["locked"] is not None:
        return (), ()
    # `bench run --resume` alone goes on with the last run, as that was asked for.
    alone = not ctx.params["cases"] and not ctx.params["strategies"]
    return ("--resume",), (
        "--overwrite",
        *(("--seeds", "--nominal", "--drawing", "--twins") if alone else ()),
    )


def _compare(old: RunData, new: RunData) -> int:
    """Say what differs between a run and its repetition; return 1 where a result does."""
    from femubench.core.score.repeatability import environment_differences, result_differences

    around = environment_differences(old.meta, new.meta)
    results = result_differences(old, new)
    for title, lines in (("environment", around), ("results", results)):
        click.echo(f"{title}: {count_noun(len(lines), 'difference')} from run {old.meta['run']}")
        for line in lines:
            click.echo(wrap_text(line, indent=2, hanging=4))
    return int(bool(results))


def _header(plan: Plan, place: str) -> str:
    """Return one line with everything that decides on the outcome."""
    asked, cases, strategies = plan.options, len(plan.cases), len(plan.strategies)
    seeds = asked.all_seeds
    named = f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {seeds[0]}-{seeds[-1]}"
    meaning = "data as recorded" if seeds == range(1) else "noise added"
    starts = {"drawn": "the models as drawn", "textbook": "the textbook models"}
    start = f" from {starts.get(asked.nominal, 'both nominal models')}"
    limits = {"": asked.timeout or DEFAULT_TIMEOUT, **asked.timeouts}
    spoken = ", ".join(f"{name} {say_duration(limit)}".strip() for name, limit in limits.items())
    return (
        f"femubench {__version__}: {count_noun(cases, 'case')}{start}, "
        f"{count_noun(strategies, 'strategy')}, {named} ({meaning}), {_twins(plan)}"
        f"{count_noun(plan.jobs, 'job')}, {place}, timeout {spoken}"
    )


def _twins(plan: Plan) -> str:
    """Return how many twins of which kind there are, from which seed; nothing of none."""
    twins = plan.starts.companions.twins
    if not plan.options.twins:
        return ""
    kinds = Counter(" and ".join(twin.families) for twin in twins)
    text = "".join(f"; {number} {kind}" for kind, number in kinds.items())
    return f"{count_noun(len(twins), 'twin')} (seed {plan.options.twin_seed}{text}), "
