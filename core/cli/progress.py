"""Progress on stderr, only where someone watches."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from femubench.core.schema.results import JobResult

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

Progress = Callable[[JobResult, int, int], None]
Counted = Callable[[int, int], None]


@contextmanager
def progress_bar(*, quiet: bool = False) -> Iterator[Progress | None]:
    """Give the function that `run_jobs` calls after each job; None where stderr is no terminal."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    with _bar() as bar:
        task = bar.add_task("jobs", total=None)

        def advance(result: JobResult, done: int, total: int) -> None:
            label = f"{result.case} {result.strategy}"[:36]
            bar.update(task, completed=done, total=total, description=f"{label:36}")

        yield advance


@contextmanager
def time_left(what: str, *, quiet: bool = False) -> Iterator[Counted | None]:
    """Give the function that says how many steps are done, of how many; None as above.

    Arguments:
        what: a clause such as ``looking for causes``.
        quiet: show nothing.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    with _bar() as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _bar() -> Bar:
    """Return a bar with a count and the time left, which takes itself away."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress as Bar,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("left"),
    )
    return Bar(*columns, console=Console(stderr=True), transient=True)


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
