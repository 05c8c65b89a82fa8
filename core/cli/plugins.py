"""``bench plugins``: what is installed and what is wrong with it."""

from __future__ import annotations

import click

from femubench.core.cli.registry import warn, wrapped
from femubench.core.plugin.loader import load_plugins


@click.group("plugins")
def plugins() -> None:
    """List the plugins and what is wrong with them."""


@plugins.command("list")
@click.option("--traceback", is_flag=True, help="Show where a broken plugin fails.")
@click.pass_context
def list_(ctx: click.Context, traceback: bool) -> None:
    """List all plugins and what they offer; broken ones go to stderr.

    A broken plugin does not stop bench, nor does it change the exit code.
    """
    found = load_plugins()
    for plugin in found.loaded:
        click.echo(f"{plugin.plugin} ({plugin.distribution})")
        for kind, names in plugin.offers.items():
            if names:
                click.echo(wrapped(f"{kind}: {', '.join(names)}", indent=2, hanging=4))
    wanted = traceback or bool(ctx.find_root().params.get("traceback"))
    warn(found.broken, with_traceback=wanted)
    if found.broken and not wanted:
        click.echo("bench plugins list --traceback tells where these come from", err=True)
