"""``bench reproduce``: the papers' tables recomputed, cell by cell, each with a verdict."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli.cases import read_cases
from femubench.core.cli.files import (
    check_can_make,
    check_writable,
    make_folder,
    write_atomically,
)
from femubench.core.cli.progress import waiting
from femubench.core.cli.registry import chosen, counted, plugins_for, wrapped
from femubench.core.errors import require

if TYPE_CHECKING:
    from femubench.core.plugin.loader import Plugins
    from femubench.core.reproduction.study import Study

FILE = click.Path(path_type=Path, dir_okay=False, allow_dash=True)
FOLDER = click.Path(path_type=Path, file_okay=False)
SCREEN = Path("-")
_STEM = "reproduce"


@click.command("reproduce")
@click.argument("paper", required=False, metavar="[frame|hframe]")
@click.option(
    "--json",
    "json_file",
    type=FILE,
    metavar="FILE",
    help="Write the cells as JSON; - prints them.",
)
@click.option(
    "-o",
    "--output",
    type=FOLDER,
    metavar="DIR",
    help="Write reproduce.md, .html, .json and the figures there; needs femubench[plot].",
)
@click.option(
    "-f",
    "--format",
    "style",
    type=click.Choice(["terminal", "markdown", "html"]),
    default="terminal",
    show_default=True,
    help="What is printed.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.pass_context
def reproduce(
    ctx: click.Context,
    paper: str | None,
    json_file: Path | None,
    output: Path | None,
    style: str,
    quiet: bool,
) -> None:
    """Recompute the tables of the papers, cell by cell.

    Each printed figure stands beside ours, with a verdict: it agrees, it agrees under a convention
    that the text does not state, or it does not follow from the text. Without a paper, both.
    """
    from femubench.papers import PAPERS

    papers = chosen("paper", [paper] if paper is not None else PAPERS, PAPERS)
    if json_file is not None and json_file != SCREEN:
        check_writable(json_file)
    if output is not None:
        check_can_make(output)
    if output is not None or style == "html":
        require("matplotlib", "plot", "drawing the figures")
    with waiting(f"recomputing {' and '.join(papers)}", quiet=quiet):
        studies = _studies(papers, plugins_for(ctx))
    if json_file is not None and json_file != SCREEN:
        write_atomically(json_file, _json(studies))
    written = _write(studies, output) if output is not None else ""
    if json_file == SCREEN:
        click.echo(_json(studies))
    elif not quiet:
        click.echo(_report(studies, style))
        if written and style == "terminal":
            click.echo(f"\n{wrapped(written, hanging=2)}")


def _studies(papers: Sequence[str], plugins: Plugins) -> list[Study]:
    from threadpoolctl import threadpool_limits

    from femubench.core.reproduction.workbench import Workbench
    from femubench.papers import PAPERS, study

    found = []
    for paper in papers:
        cases = {case.name: case for case in read_cases(PAPERS[paper], plugins)}
        # Many small matrices: threads would only wait for each other.
        with threadpool_limits(1):
            found.append(study(paper, Workbench(plugins.strategies, cases)))
    return found


def _json(studies: Sequence[Study]) -> str:
    from femubench.core.reproduction.study import cells_to_json

    return json.dumps(cells_to_json(studies), indent=1, ensure_ascii=False, allow_nan=False)


def _report(studies: Sequence[Study], style: str) -> str:
    from femubench.reports.reproduction import (
        reproduction_html,
        reproduction_markdown,
        reproduction_text,
    )

    if style == "html":
        return reproduction_html(studies, dict(_drawings(studies)))
    return reproduction_markdown(studies) if style == "markdown" else reproduction_text(studies)


def _write(studies: Sequence[Study], folder: Path) -> str:
    """Write the reports and the figures; return what lies where."""
    from femubench.reports.reproduction import (
        FIGURES,
        reproduction_html,
        reproduction_markdown,
    )

    drawings = dict(_drawings(studies))
    make_folder(folder)
    texts = {
        ".md": reproduction_markdown(studies, figures=True),
        ".html": reproduction_html(studies, drawings),
        ".json": _json(studies),
    }
    make_folder(folder / FIGURES)
    for name, svg in drawings.items():
        write_atomically(folder / FIGURES / f"{name}.svg", svg)
    for suffix, text in texts.items():
        write_atomically(folder / f"{_STEM}{suffix}", text)
    names = ", ".join(f"{_STEM}{suffix}" for suffix in texts)
    return f"{folder}: {names}, {counted(len(drawings), 'figure')} in {FIGURES}"


def _drawings(studies: Sequence[Study]) -> Iterator[tuple[str, str]]:
    from femubench.core.plot.figure import drawn

    for study in studies:
        for figure in study.figures:
            yield figure.name, drawn(figure)
