"""``bench scenarios``: what there is to run, and what a case consists of."""

from __future__ import annotations

import click

from femubench.core.cli.registry import plugins_for, wrap_text
from femubench.core.library.cases import read_cases


@click.group("scenarios")
def scenarios() -> None:
    """List the built-in scenarios, or show one."""


@scenarios.command("list")
@click.pass_context
def list_(ctx: click.Context) -> None:
    """List the scenarios with the number of their cases and their classes.

    `bench run` without a case runs those with a star, `bench run GROUP` all that are called
    GROUP/NAME.
    """
    found = plugins_for(ctx).scenarios
    width = max((len(name) for name in found), default=0)
    for name, scenario in found.items():
        cases = "" if len(scenario.cases) == 1 else f" ({len(scenario.cases)} cases)"
        star = "*" if scenario.default else " "
        click.echo(f"{star} {name:{width}}  {scenario.title}{cases}")
        if scenario.classes:
            click.echo(wrap_text(", ".join(scenario.classes), indent=width + 4, hanging=width + 4))
    click.echo("* is run by `bench run` without a case")


@scenarios.command("show")
@click.argument("name")
@click.pass_context
def show(ctx: click.Context, name: str) -> None:
    """Show the cases of a scenario: model, sensors, modes, modifications, source.

    NAME is a scenario, a group of them, one case of a scenario, or a case folder.
    """
    plugins = plugins_for(ctx)
    if name in plugins.scenarios:
        scenario = plugins.scenarios[name]
        click.echo(f"{name}: {scenario.title}")
        if scenario.classes:
            click.echo(wrap_text(", ".join(scenario.classes), indent=2, hanging=2))
    for case in read_cases([name], plugins):
        click.echo()
        (name, _), *rows = case.rows()
        click.echo(name)
        for key, value in [("title", case.title), *rows]:
            click.echo(wrap_text(f"{key + ':':10}{' '.join(value.split())}", indent=2, hanging=12))
