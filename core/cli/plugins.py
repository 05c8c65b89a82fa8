"""``bench plugins``: what is installed, what is wrong with it, and a start for one's own."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import click

from femubench.core.cli import options
from femubench.core.cli.registry import plugins_for, warn, wrapped
from femubench.core.errors import InputError
from femubench.core.plugin.loader import Plugins, load_plugins
from femubench.core.plugin.validation import CHECKS, did_you_mean

# What `new` writes, as in `KINDS` of the module that does it.
_KINDS = ("strategy", "effect", "scenario", "reader")
_NEXT = {
    "strategy": "{trial}",
    "effect": "bench init portal && bench diagnose portal --effects {name}",
    "scenario": "bench run {name}",
    "reader": "bench run {folder}/tests/case",
}


class _Verbs(click.Group):
    """A group whose verb `check` is imported when it is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the verbs in the order in which one needs them."""
        return ["list", "show", "new", "check"]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return one verb."""
        if cmd_name != "check":
            return super().get_command(ctx, cmd_name)
        command = import_module("femubench.core.cli.plugins_check").check
        assert isinstance(command, click.Command)
        return command


@click.group("plugins", cls=_Verbs)
def plugins() -> None:
    """List, show and check plugins, or write a new one."""


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


@plugins.command("show")
@click.argument("name")
@click.pass_context
def show(ctx: click.Context, name: str) -> None:
    """Show what NAME is, where it comes from, what it needs, and its options.

    NAME is a strategy, scenario, effect, reader or reporter, or a plugin of `bench plugins list`.
    """
    from femubench.core.cli.plugin_pages import pages_of

    found = plugins_for(ctx)
    pages = list(pages_of(name, found))
    if not pages:
        hint = did_you_mean(name, _names(found)) or "; bench plugins list names all there are"
        raise InputError(f"no plugin offers {name!r}{hint}")
    click.echo("\n\n".join(pages))


@plugins.command("new")
@click.argument("name")
@click.option(
    "--kind", type=click.Choice(_KINDS), default="strategy", show_default=True,
    help="What the package brings.",
)  # fmt: skip
@options.output_folder("Write the folder NAME there. Default: here.", default=".")
@click.pass_context
def new(ctx: click.Context, name: str, kind: str, output: Path) -> None:
    """Write a pip-installable package with a working plugin in the new folder NAME.

    NAME, of lower-case letters, digits and dashes, is also the name of what the plugin brings.
    """
    from femubench.core.library.new_package import trial_of, write_package

    found = plugins_for(ctx)
    for path in write_package(name, kind, output, found):
        click.echo(f"wrote {path}")
    folder = output / name
    click.echo(f"Install it: pip install -e {folder}")
    click.echo(
        f"then run:   {_NEXT[kind].format(name=name, folder=folder, trial=trial_of(name, found))}"
    )


def _names(found: Plugins) -> list[str]:
    """Return every name that `show` takes."""
    offered = [name for kind in CHECKS for name in getattr(found, kind)]
    return list(dict.fromkeys([*offered, *(plugin.plugin for plugin in found.loaded)]))
