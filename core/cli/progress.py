"""Progress on stderr: a line that changes where someone watches, else one every ten seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from threading import Event, Thread
from typing import TYPE_CHECKING

import click

from femubench.core.pace import Advance, OnAdvance

if TYPE_CHECKING:
    from rich.console import Console

_WIDE, _BAR = 32, 14  # characters
EVERY = 10.0  # s between two lines where nobody watches


@contextmanager
def progress(what: str = "", *, quiet: bool = False) -> Iterator[OnAdvance | None]:
    """Give the function that takes how far something is; None where nothing is to be shown.

    On a terminal a line with a bar, pieces done of how many, the time gone by and the time left,
    which takes itself away; elsewhere a line of it every ten seconds. No time is shown as left
    while none is known.

    Arguments:
        what: the piece is of, such as a case.
    """
    if quiet:
        yield None
        return
    if not sys.stderr.isatty():
        with say_progress(what, partial(click.echo, err=True), time.monotonic) as on_advance:
            yield on_advance
        return
    from rich.console import Console

    with show_progress(what, Console(stderr=True), time.monotonic) as on_advance:
        yield on_advance


@contextmanager
def say_progress(
    what: str, write: Callable[[str], None], clock: Callable[[], float], every: float | None = None
) -> Iterator[OnAdvance]:
    """Give the function that takes what a line says, of which one is written every ten seconds.

    Arguments:
        every: so many seconds, `EVERY` by default, in a thread: one piece may be long.
    """
    begin = last = clock()
    latest, ended = Advance(0, 0), Event()

    def tell(advance: Advance) -> None:
        nonlocal latest, last
        latest, last = advance, clock()

    def say() -> None:
        while not ended.wait(EVERY if every is None else every):
            now, share = clock(), f"{latest.done}/{latest.total}, " if latest.total else ""
            gone = format_time_left(Advance(0, 0, left=now - begin), 0.0)
            stage = ": ".join(filter(None, [what, latest.what or "at work"]))
            write(f"{stage}, {share}{gone} gone, {format_time_left(latest, now - last)} left")

    thread = Thread(target=say, daemon=True)
    thread.start()
    try:
        yield tell
    finally:
        ended.set()
        thread.join()


@contextmanager
def show_progress(what: str, console: Console, clock: Callable[[], float]) -> Iterator[OnAdvance]:
    """Give the function that changes a line of a terminal; see `progress`."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
    )
    from rich.text import Text

    lead = f"{what}: " if what else ""
    last = clock()
    latest = Advance(0, 0)

    class Left(ProgressColumn):
        def render(self, task: Task) -> Text:
            text = format_time_left(latest, clock() - last)
            return Text(f"{text} left", style="progress.remaining")

    columns = (
        TextColumn("{task.fields[what]}", markup=False),
        BarColumn(bar_width=_BAR),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        Left(),
    )
    with Progress(*columns, console=console, transient=True, get_time=clock) as bar:
        task = bar.add_task("", total=None, what=f"{what[:_WIDE]:{_WIDE}}")

        def tell(advance: Advance) -> None:
            nonlocal latest, last
            latest, last = advance, clock()
            line = f"{lead}{advance.what}"[:_WIDE]
            bar.update(
                task, completed=advance.done, total=advance.total or None, what=f"{line:{_WIDE}}"
            )

        yield tell


def format_time_left(advance: Advance, since: float) -> str:
    """Return the time that is left as h:mm:ss, dashes where it is not known."""
    if advance.left is None:
        return "-:--:--"
    seconds = round(max(advance.left - min(since, advance.current), 0.0))
    return f"{seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02}"
