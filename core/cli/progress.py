"""Progress on stderr, only where someone watches."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from femubench.core.pace import Advance, OnAdvance

if TYPE_CHECKING:
    from rich.console import Console

_WIDE, _BAR = 32, 14  # characters


@contextmanager
def progress(what: str = "", *, quiet: bool = False) -> Iterator[OnAdvance | None]:
    """Give the function that takes how far something is; None where stderr is no terminal.

    A line with a bar, pieces done of how many, the time gone by and the time left, which takes
    itself away. No time is shown as left while none is known.

    Arguments:
        what: the piece is of, such as a case.
        quiet: show nothing.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console

    with show_progress(what, Console(stderr=True), time.monotonic) as on_advance:
        yield on_advance


@contextmanager
def show_progress(what: str, console: Console, clock: Callable[[], float]) -> Iterator[OnAdvance]:
    """Give the function that changes a line of a terminal; see `progress`.

    Arguments:
        clock: seconds from any time on.
    """
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
    """Return the time that is left as h:mm:ss, dashes where it is not known.

    Arguments:
        since: seconds since the advance.
    """
    if advance.left is None:
        return "-:--:--"
    seconds = round(max(advance.left - min(since, advance.current), 0.0))
    return f"{seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02}"


@contextmanager
def waiting(what: str, *, quiet: bool = False) -> Iterator[None]:
    """Show what is being done and for how long, where stderr is a terminal.

    Arguments:
        what: a clause such as ``looking for causes``.
        quiet: show nothing.
    """
    if quiet or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import Progress as Bar, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        bar.add_task(what, total=None)
        yield
