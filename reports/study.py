"""A study as a report of any form: gain against two axes, every cell, what failed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from markupsafe import Markup

import femubench
from femubench import InputError
from femubench.reports.blocks import Block, Column, Drawing, Items, Passage, Table
from femubench.reports.cells import NOTHING, format_fixed, interval, plain
from femubench.reports.summary import failures, header, lead, notes_of, troubles
from femubench.results import RunData, StudyAxes

_MOST_ON_SCREEN = 60  # cells
_MOST_COLUMNS = 9
_SHORT = {"sensors_left_out": "left out"}
_COUNTED = (
    "A cell is a leaderboard of its own: every structure counts once, a job that failed or is "
    "missing counts as the model that was given, and with several seeds gain is the mean over "
    "them. !: a model lost rigid-body modes or has negative eigenvalues."
)
_PICTURE = (
    "White: 0, as the textbook model, which uses no measurement; blue: better, red: worse. "
    "Hatched: jobs failed or are missing. Grey: not applicable."
)


def study_html(run: RunData) -> str:
    """Return a study as one HTML document that needs no other file."""
    from femubench.reports.html import to_html

    title = title_of(run)
    sections = [*sections_of(run, _drawing(run)), about_axes(run)]
    return to_html(sections, title=f"femubench: {title}", heading=title)


def title_of(run: RunData) -> str:
    """Return the title of a study."""
    return plain(StudyAxes.of(run).title) or f"Study {plain(run.meta.get('run', ''))}"


def sections_of(run: RunData, *drawing: Block) -> Iterator[Passage]:
    """Yield what every form of the report has; `drawing` where there is one."""
    known = StudyAxes.of(run)
    x, y = known.pictured
    yield Passage("", [lead(run)], area="first")
    yield Passage(f"Gain by {x} and {y}", [*drawing, _grid(run, known, x, y)])
    cells = femubench.Run.of(run).gain_by().to_dict("records")
    yield Passage(f"Cells ({len(cells)})", [*_cells(cells), _COUNTED])
    if failed := failures(troubles(run.results)):
        yield Passage("Failures", failed)
    if notes := [("Note", note) for note in notes_of(run)]:
        yield Passage("Notes", [Items(notes)])


def about_axes(run: RunData) -> Passage:
    """Return the axes with their values, and how the study was run."""
    known = StudyAxes.of(run)
    axes = [(name, ", ".join(map(StudyAxes.text_of, known.values(name)))) for name in known.names]
    return Passage("Study", [Items([*axes, *header(run)])])


def _drawing(run: RunData) -> Block:
    from femubench.plot import heat_map, svg

    known = StudyAxes.of(run)
    x, y = known.pictured
    columns, rows = len(known.values(x)), len(known.values(y))
    size = min(2.6 + 0.75 * max(columns, 5), 12.0), min(1.7 + 0.5 * max(rows, 3), 12.0)
    title = f"Gain by {x} and {y}"
    draw = partial(heat_map, run, x, y)
    try:
        found = Markup(svg(draw, name="heat-map", title=title, caption=_PICTURE, size=size))
    except InputError as error:
        return f"No drawing: {error}."
    return Drawing(title, _PICTURE, found)


def _grid(run: RunData, known: StudyAxes, x: str, y: str) -> Block:
    """Return the heat map as numbers, a value of y a row."""
    columns, rows = known.values(x), known.values(y)
    if len(columns) > _MOST_COLUMNS:
        x, y, columns, rows = y, x, rows, columns
    if len(columns) > _MOST_COLUMNS:
        return f"{len(columns)} by {len(rows)} values: see the cells."
    found = {
        (row[x], row[y]): row for row in femubench.Run.of(run).gain_by(x, y).to_dict("records")
    }
    heads = [Column(y, 24, left=True), *(Column(StudyAxes.text_of(v), 7) for v in columns)]
    cells = [[_gain(found[c, r]) if (c, r) in found else None for c in columns] for r in rows]
    table = [[StudyAxes.text_of(r), *line] for r, line in zip(rows, cells, strict=True)]
    said = f"Down: {StudyAxes.title_of(y)}; across: {StudyAxes.title_of(x)}. *: failures."
    return Table(heads, table, said)


def _cells(cells: Sequence[dict[Any, Any]]) -> Iterator[Block]:
    """Yield every cell with its interval and what of it failed."""
    names = [str(name) for name in cells[0]]
    axes = names[: names.index("gain")]
    options = [name for name in axes if "." in name]
    bare = [name for name in axes if name not in options]
    lost = any(row["failed"] + row["missing"] for row in cells)
    heads = [Column(_SHORT.get(name, name), 16, left=True, wrap=True) for name in bare]
    heads += [Column("options", 14, left=True, wrap=True)] if options else []
    heads += [Column("gain", 8), Column("95 % interval", 18)]
    heads += [Column("failed", 14, wrap=True)] if lost else []
    rows = [
        [
            *(StudyAxes.text_of(row[name]) for name in bare),
            *([_options(row, options)] if options else []),
            *(_gain(row), interval(row["gain_low"], row["gain_high"])),
            *([_lost(row)] if lost else []),
        ]
        for row in cells
    ]
    yield Table(heads, rows, most=_MOST_ON_SCREEN)
    if not lost:
        yield "No job failed or is missing."


def _options(row: dict[Any, Any], names: Sequence[str]) -> str:
    """Return the options of a cell's strategy."""
    stated = {name.partition(".")[2]: row[name] for name in names if row[name] is not None}
    said = (f"{name} {StudyAxes.text_of(v)}" for name, v in stated.items() if v == v)
    return ", ".join(said) or NOTHING


def _gain(row: dict[Any, Any]) -> str:
    marks = ("!" if row["unphysical"] else "") + ("*" if row["failed"] + row["missing"] else "")
    return marks + (
        "n/a" if row["not_applicable"] == row["jobs"] else format_fixed(row["gain"], 3, 6)
    )


def _lost(row: dict[Any, Any]) -> str:
    """Return how many jobs of a cell gave no result, of how many."""
    parts = [f"{row[name]} {name}" for name in ("failed", "missing") if row[name]]
    return f"{', '.join(parts) or 0} of {row['jobs']}"
