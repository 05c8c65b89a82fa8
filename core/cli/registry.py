"""What the verbs share: plugins with a line for every broken one, and lines of 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

import click

from femubench.core.plugin.importing import BrokenPlugin
from femubench.core.plugin.loader import Plugins, load_plugins


class Verbs(click.Group):
    """A group that lists its verbs in the order in which they are written."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the verbs."""
        return list(self.commands)


def plugins_for(ctx: click.Context) -> Plugins:
    """Load all plugins; tell on stderr of those that are broken."""
    plugins = load_plugins()
    warn(plugins.broken, with_traceback=bool(ctx.find_root().params.get("traceback")))
    return plugins


def warn(broken: Iterable[BrokenPlugin], *, with_traceback: bool) -> None:
    """Write one line for each fault, and its traceback on request."""
    for fault in broken:
        click.echo(f"bench: {fault}", err=True)
        if with_traceback:
            click.echo(fault.traceback, err=True, nl=False)


def wrap_text(text: str, *, indent: int = 0, lead: str = "", hanging: int) -> str:
    """Return text on lines of 80 columns, names whole.

    Arguments:
        text: wrapped; blanks at its start are dropped.
        indent, hanging: of the first line and of all others.
        lead: stands before the text on the first line.
    """
    return textwrap.fill(
        text,
        80,
        initial_indent=" " * indent + lead,
        subsequent_indent=" " * hanging,
        break_on_hyphens=False,
        break_long_words=False,
    )
