"""The tables of the papers recomputed: ``bench reproduce``."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import accumulate
from os import PathLike
from pathlib import Path

from threadpoolctl import threadpool_limits

from femubench.core.files import check_can_make, make_folder, write_atomically
from femubench.core.library.cases import as_list, read_cases, usable_plugins, way_of
from femubench.core.library.report import drawings, rendering
from femubench.core.pace import Advance, OnAdvance
from femubench.core.plugin.foreign import is_foreign
from femubench.core.plugin.loader import Plugins, show_entry
from femubench.core.plugin.validation import choose_names
from femubench.core.reproduction.study import FIGURES, Study
from femubench.core.reproduction.workbench import Workbench

_STEM = "reproduce"


def reproduce(
    papers: str | Sequence[str] | None = None, *, output: str | PathLike[str] | None = None
) -> tuple[Study, ...]:
    """Return the tables of papers recomputed, cell by cell, each with a verdict.

    Arguments:
        papers: their names; all by default.
        output: folder for reproduce.md, .html, .json and the figures.

    Raises:
        InputError: for an unknown paper, or a folder that cannot be written.

    Examples:
        >>> len(femubench.reproduce())
        2
    """
    if output is not None:
        check_can_make(Path(output))
    plugins = usable_plugins()
    found = studies_of(papers_of(plugins, papers), plugins)
    if output is not None:
        write_studies(found, Path(output))
    return found


def papers_of(plugins: Plugins, papers: str | Sequence[str] | None = None) -> tuple[str, ...]:
    """Return the names of papers, all that come with femubench where None is given.

    Raises:
        InputError: for an unknown one.
    """
    own = [name for name in plugins.papers if not is_foreign(show_entry(plugins.papers, name))]
    return choose_names("paper", own if papers is None else as_list(papers), plugins.papers)


def studies_of(
    papers: Sequence[str], plugins: Plugins, on_advance: OnAdvance | None = None
) -> tuple[Study, ...]:
    """Return the studies of papers; see `reproduce`.

    Arguments:
        on_advance: called after each update with how many are computed, of how many.
    """
    found = []
    wanted = [plugins.papers[name] for name in papers]
    watched = _Updates([getattr(paper, "done", (1,)) for paper in wanted], on_advance)
    for paper in wanted:
        cases = {case.name: case for case in read_cases(paper.cases, plugins)}
        # Many small matrices: threads would only wait for each other.
        with threadpool_limits(1):
            found.append(paper.study(Workbench(plugins.strategies, cases, watched.step)))
    return tuple(found)


class _Updates:
    """Updates that are computed, and the time that the rest takes, as such re-runs have it."""

    def __init__(self, rows: Sequence[Sequence[int]], on_advance: OnAdvance | None) -> None:
        before = accumulate((row[-1] for row in rows), initial=0)
        self._after = [
            first + x for first, row in zip(before, rows, strict=False) for x in row[:-1]
        ]
        self._whole = sum(row[-1] for row in rows)
        self._on_advance, self._begin = on_advance, time.monotonic()
        self._done = 0

    def step(self) -> None:
        """Count an update."""
        self._done += 1
        if self._on_advance is None:
            return
        after = [*self._after, self._whole]
        place = min(self._done, len(self._after))
        here, following = after[place - 1], after[place]
        rate = (time.monotonic() - self._begin) / here
        left = rate * (self._whole - here), rate * (following - here)
        total = max(len(self._after), self._done)
        self._on_advance(Advance(self._done, total, "updates", *left))


def write_studies(studies: Sequence[Study], folder: Path) -> tuple[list[str], int]:
    """Write the reports and the figures; return the names of the reports, and how many figures."""
    make_folder(folder / FIGURES)
    drawn = dict(drawings(studies))
    for name, svg in drawn.items():
        write_atomically(folder / FIGURES / f"{name}.svg", svg)
    texts = {
        ".md": way_of("markdown", "render_studies")(studies, drawn),
        ".html": way_of("html", "render_studies")(studies, drawn),
        ".json": rendering(studies, "json"),
    }
    for suffix, text in texts.items():
        write_atomically(folder / f"{_STEM}{suffix}", text)
    return [f"{_STEM}{suffix}" for suffix in texts], len(drawn)
