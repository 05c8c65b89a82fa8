"""A run that ends before its end: what there is so far, what is missing, and how to go on."""

from __future__ import annotations

import shlex
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import click

from femubench.core.errors import FemubenchError, harmless

if TYPE_CHECKING:
    from femubench.core.roles import Reporter
    from femubench.core.run.store import Store

UNFINISHED, INTERRUPTED = 3, 130  # exit codes
_WORDS = "femubench.words"


def remember(ctx: click.Context, words: Iterable[str]) -> None:
    """Keep the words that `bench` was called with."""
    ctx.meta[_WORDS] = tuple(words)


def resuming(words: Iterable[str], added: Sequence[str] = (), dropped: Sequence[str] = ()) -> str:
    """Return the command that goes on with a run.

    Arguments:
        words: of the command that began it, without ``bench``.
        added: to them, unless they are there.
        dropped: options that go with their values.
    """
    kept: list[str] = []
    given = iter(words)
    for word in given:
        if word in dropped:
            next(given, None)
        elif not word.startswith(tuple(f"{option}=" for option in dropped)):
            kept.append(word)
    return shlex.join(["bench", *kept, *(word for word in added if word not in kept)])


@contextmanager
def telling(
    store: Store,
    jobs: int,
    screen: Reporter | None,
    added: Sequence[str] = (),
    dropped: Sequence[str] = (),
) -> Iterator[None]:
    """Where the block ends a run early, show its board so far, what is missing and how to go on.

    What ends before a run has begun is as it was.

    Arguments:
        screen: shows the board; None shows none.
        added, dropped: words that make the command go on with the run, see `resuming`.

    Raises:
        click.exceptions.Exit: with the exit code, when all is printed.
    """
    try:
        yield
    except (Exception, KeyboardInterrupt) as fault:
        run = store.working_on
        if run is None or isinstance(fault, click.ClickException | click.exceptions.Exit):
            raise
        done = _shown(store, run, screen)
        stopped = isinstance(fault, KeyboardInterrupt)
        if not stopped and not isinstance(fault, FemubenchError | OSError):
            # A fault of ours, which somebody will want to report.
            click.echo("".join(traceback.format_exception(fault)).rstrip(), err=True)
        said = " ".join(str(fault).split()) or type(fault).__name__
        click.echo(f"bench: {'interrupted' if stopped else said}", err=True)
        command = resuming(click.get_current_context().meta.get(_WORDS, ()), added, dropped)
        known = "what was done is kept" if done is None else f"{done} of {jobs} jobs are done"
        click.echo(f"bench: {known}; to go on: {harmless(command)}", err=True)
        raise click.exceptions.Exit(INTERRUPTED if stopped else UNFINISHED) from fault


def _shown(store: Store, run: str, screen: Reporter | None) -> int | None:
    """Show what there is of a run; return how many of its jobs are done, None where unknown."""
    from femubench.core.library.report import render_report, text_of

    # What keeps the store from being read is in the message of what ended the run.
    with suppress(FemubenchError, OSError):
        found = store.load(run)
        if screen is not None and found.results:
            click.echo("\n" + text_of(screen, render_report(screen, found)))
        return len(found.results) + len(found.companions)
    return None
