"""``bench scenarios``: what there is to run, and what a case consists of."""

from __future__ import annotations

import click

from femubench.core.cli.registry import plugins_for, wrapped
from femubench.core.library.cases import read_cases


@click.group("scenarios")
def scenarios() -> None:
    """List the built-in scenarios, or show one."""


@scenarios.command("list")
@click.pass_context
def list_(ctx: click.Context) -> None:
    """List the scenarios with the number of their cases."""
    found = plugins_for(ctx).scenarios
    width = max((len(name) for name in found), default=0)
    for name, scenario in found.items():
        cases = "" if len(scenario.cases) == 1 else f" ({len(scenario.cases)} cases)"
        click.echo(f"{name:{width}}  {scenario.title}{cases}")


@scenarios.command("show")
@click.argument("name")
@click.pass_context
def show(ctx: click.Context, name: str) -> None:
    """Show the cases of a scenario: model, sensors, modes, modifications, source.

    NAME is a scenario, one case of it, or a case folder.
    """
    plugins = plugins_for(ctx)
    if name in plugins.scenarios:
        click.echo(f"{name}: {plugins.scenarios[name].title}")
    for case in read_cases([name], plugins):
        click.echo()
        (name, _), *rows = case.rows()
        click.echo(name)
        for key, value in [("title", case.title), *rows]:
            click.echo(wrapped(f"{key + ':':10}{' '.join(value.split())}", indent=2, hanging=12))
