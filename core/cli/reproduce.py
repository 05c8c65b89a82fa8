"""``bench reproduce``: the papers' tables recomputed, cell by cell, each with a verdict."""

from __future__ import annotations

from pathlib import Path

import click

from femubench.core.cli import options
from femubench.core.cli.progress import progress
from femubench.core.cli.registry import plugins_for, wrap_text
from femubench.core.display import count_noun
from femubench.core.files import check_can_make, write_atomically
from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.validation import choose_names


class _PaperName(click.Argument):
    """The argument of the papers; its help names those that come with femubench."""

    def make_metavar(self, *_: click.Context) -> str:  # none before click 8.2
        """Return what may stand there."""
        return f"[{'|'.join(load_plugins(third_parties=False).papers)}]"


@click.command("reproduce")
@click.argument("paper", required=False, cls=_PaperName)
@options.json_file("Write the cells as JSON; - prints them.", options.OUTPUT_OR_SCREEN)
@options.output_folder(
    "Write reproduce.md, .html, .json and the figures there; needs femubench[plot]."
)
@options.style("terminal", "markdown", "html")
@options.quiet
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

    Each printed figure stands next to ours with a verdict and its reason: it agrees independently,
    under a convention, after a search or after a fit; it is input, a misprint or cannot be checked;
    or it does not follow from the text. Without a paper, both.
    """
    plugins = plugins_for(ctx)
    if paper is not None:
        choose_names("paper", [paper], plugins.papers)
    if output is not None:
        check_can_make(output)
    from femubench.core.library.report import rendering
    from femubench.core.library.reproduce import papers_of, studies_of, write_studies

    with progress(quiet=quiet) as on_advance:
        studies = studies_of(papers_of(plugins, paper), plugins, on_advance)
    if json_file is not None and json_file != options.SCREEN:
        write_atomically(json_file, rendering(studies, "json"))
    files, figures = ([], 0) if output is None else write_studies(studies, output)
    if json_file == options.SCREEN:
        click.echo(rendering(studies, "json"))
    elif not quiet:
        click.echo(rendering(studies, style))
        if files and style == "terminal":
            written = f"{output}: {', '.join(files)}, {count_noun(figures, 'figure')} in figures"
            click.echo(f"\n{wrap_text(written, hanging=2)}")
