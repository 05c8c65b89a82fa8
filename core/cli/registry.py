"""What the verbs share: plugins with a line for every broken one, and names looked up kindly."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterable
from pathlib import Path

import click

from femubench.core.errors import InputError
from femubench.core.plugin.loader import BrokenPlugin, Plugins, load_plugins
from femubench.core.plugin.validation import did_you_mean

DEFAULT_STORE = "femubench-results"


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


def chosen(kind: str, names: Iterable[str], known: Iterable[str]) -> tuple[str, ...]:
    """Return the names without repetition.

    Raises:
        InputError: for a name that is not known, with the near matches.
    """
    known = tuple(known)
    unique = tuple(dict.fromkeys(names))
    for name in unique:
        if name not in known:
            raise InputError(unknown(kind, name, known))
    return unique


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """Return a message on an unknown name with the near matches, or with all names."""
    known = tuple(dict.fromkeys(known))
    near = did_you_mean(name, known) or f"; there are {', '.join(known) or 'none'}"
    return f"no {kind} {name!r}{near}"


def store_folder(folder: Path | None) -> Path:
    """Return the folder of the results: given, from FEMUBENCH_STORE, or the default here."""
    return folder or Path(os.environ.get("FEMUBENCH_STORE") or DEFAULT_STORE)


def counted(number: int, noun: str) -> str:
    """Return ``1 case``, ``3 cases``, ``2 strategies``."""
    if number == 1:
        return f"1 {noun}"
    stem, ending = (noun[:-1], "ies") if noun.endswith("y") else (noun, "s")
    return f"{number} {stem}{'es' if noun.endswith('s') else ending}"


def wrapped(text: str, *, indent: int = 0, hanging: int) -> str:
    """Return text on lines of 80 columns, names whole; `hanging` indents all but the first."""
    return textwrap.fill(
        text,
        80,
        initial_indent=" " * indent,
        subsequent_indent=" " * hanging,
        break_on_hyphens=False,
        break_long_words=False,
    )
