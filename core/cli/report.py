"""``bench report``: a stored run in any format; runs nothing."""

from __future__ import annotations

import os
import webbrowser
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli.files import check_writable, make_folder, write_atomically
from femubench.core.cli.registry import chosen, plugins_for, store_folder
from femubench.core.cli.reporting import (
    is_for_files,
    rendered,
    run_name,
    text_of,
)
from femubench.core.plugin.loader import load_plugins

if TYPE_CHECKING:
    from femubench.core.plugin.roles import Reporter
    from femubench.core.schema.results import Run

FOLDER = click.Path(path_type=Path, file_okay=False)
_PAGE = "html"
_SHORT = {"md": "markdown"}
# Formats that tell of what was left out themselves.
_TELLING = frozenset({"terminal", "markdown", _PAGE})


@dataclass(frozen=True)
class _Found:
    """A run, what the store has to draw of it, and the folder that its files go to by default."""

    run: Run
    exhibits: object
    folder: Path


class _Formats(click.Option):
    """The option of the formats; its help names those that there are."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Return the option and its help."""
        short = {name: f"{name} ({word})" for word, name in _SHORT.items()}
        names = ", ".join(short.get(name, name) for name in load_plugins().reporters)
        self.help = f"{names}; several separated by commas. Default: terminal."
        return super().get_help_record(ctx)


@click.command("report")
@click.argument("run", required=False)
@click.option(
    "-f",
    "--format",
    "formats",
    multiple=True,
    metavar="FORMAT",
    cls=_Formats,
)
@click.option("--open", "opened", is_flag=True, help="Write the HTML page and open it.")
@click.option(
    "-o",
    "--output",
    type=FOLDER,
    metavar="DIR",
    help="Write files there. Default: the screen; for html and parquet, the store.",
)
@click.option(
    "--store",
    type=FOLDER,
    metavar="DIR",
    help="Where the results are. Default: $FEMUBENCH_STORE or femubench-results.",
)
@click.pass_context
def report(
    ctx: click.Context,
    run: str | None,
    formats: tuple[str, ...],
    opened: bool,
    output: Path | None,
    store: Path | None,
) -> None:
    """Write a report on a stored run.

    RUN is a run id in the store, its first letters, or a file that run --json or diagnose --json
    wrote. Without it, the last run of the store. Lines of a store that cannot be read are left
    out and reported.
    """
    plugins = plugins_for(ctx)
    words = list(dict.fromkeys([*_words(formats), *([_PAGE] if opened else [])])) or ["terminal"]
    if run is not None and _is_file(run):
        from femubench.core.cli.report_diagnosis import diagnosis_in, report_diagnosis

        diagnosis = diagnosis_in(Path(run))
        if diagnosis is not None:
            report_diagnosis(diagnosis, Path(run), words, output, opened=opened)
            return
    writers = [
        plugins.reporters[name] for name in chosen("report format", words, plugins.reporters)
    ]
    found = _find(run, store_folder(store))
    if output is not None:
        make_folder(output)
    _tell(found.run, writers)
    written = _write(found, writers, output)
    if opened:
        _open(written[_PAGE])


def _words(formats: Iterable[str]) -> list[str]:
    """Return the formats that the words of the user stand for."""
    parts = [part.strip() for word in formats for part in word.split(",")]
    return [_SHORT.get(part, part) for part in parts if part]


def _is_file(word: str) -> bool:
    return os.path.exists(word) and not os.path.isdir(word)


def _find(word: str | None, folder: Path) -> _Found:
    """Return a run from a file or from the store."""
    from femubench.core.run.store import Store
    from femubench.core.schema.records import read_run

    if word is not None and _is_file(word):
        file = Path(word)
        return _Found(read_run(file), None, file.parent)
    store = Store(folder)
    return _Found(store.load(word, lenient=True), store.exhibits, folder)


def _tell(run: Run, writers: Sequence[Reporter]) -> None:
    """Tell on stderr what was left out, where a report has no room for it."""
    from femubench.reports.summary import notes_of

    if any(writer.name not in _TELLING for writer in writers):
        for note in notes_of(run):
            click.echo(f"bench: {note}", err=True)


def _write(found: _Found, writers: Sequence[Reporter], output: Path | None) -> dict[str, Path]:
    """Write files or show texts; return the files by format."""
    files = {
        writer.name: (output or found.folder) / f"{run_name(found.run)}{writer.suffix}"
        for writer in writers
        if output is not None or is_for_files(writer)
    }
    for path in files.values():
        check_writable(path)
    # What is shown may be on its way into a file: then nothing else must be in it.
    aside = len(files) < len(writers)
    for writer in writers:
        content = rendered(writer, found.run, found.exhibits)
        if writer.name not in files:
            click.echo(text_of(writer, content))
            continue
        write_atomically(files[writer.name], content)
        click.echo(f"{writer.name}: {files[writer.name]}", err=aside)
    return files


def _open(path: Path) -> None:
    """Show a page in the browser."""
    if not webbrowser.open(path.resolve().as_uri()):
        click.echo(f"bench: there is no browser here; open {path} in one", err=True)
