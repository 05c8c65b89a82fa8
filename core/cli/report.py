"""``bench report``: a stored run in any format; runs nothing."""

from __future__ import annotations

import os
import webbrowser
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femubench.core.cli import options
from femubench.core.cli.registry import plugins_for
from femubench.core.errors import InputError
from femubench.core.files import check_writable, make_folder, write_atomically
from femubench.core.library.cases import way_of
from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.validation import choose_names

if TYPE_CHECKING:
    from femubench.core.roles import Reporter
    from femubench.core.schema.results import RunData

_PAGE = "html"
# Formats that tell of what was left out themselves.
_TELLING = frozenset({"terminal", "markdown", _PAGE})


_SHORT = {"md": "markdown"}


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
@click.option("-f", "--format", "formats", multiple=True, metavar="FORMAT", cls=_Formats)
@click.option(
    "--rule", "rule", multiple=True, metavar="KEY=VALUE",
    help="Score by another number of the rule (docs/scoring.md); may be repeated.",
)  # fmt: skip
@click.option("--open", "opened", is_flag=True, help="Write the HTML page and open it.")
@options.output_folder("Write files there. Default: the screen; for html and parquet, the store.")
@options.store("Where the results are.")
@click.pass_context
def report(
    ctx: click.Context,
    run: str | None,
    formats: tuple[str, ...],
    rule: tuple[str, ...],
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
    parts = [part.strip() for word in formats for part in word.split(",")] + [_PAGE] * opened
    words = list(dict.fromkeys(_SHORT.get(p, p) for p in parts if p)) or ["terminal"]
    file = Path(run) if run is not None and os.path.isfile(run) else None
    if file is None:  # names are known to be right before what reads runs is loaded
        choose_names("report format", words, plugins.reporters)
    from femubench.core.library.rank import read_run, store_in
    from femubench.core.library.report import diagnosis_in

    diagnosis = None if file is None else diagnosis_in(file)
    if output is not None:
        make_folder(output)
    if file is not None and diagnosis is not None:
        written = _write_diagnosis(diagnosis, file, words, output)
    else:
        writers = [
            plugins.reporters[w] for w in choose_names("report format", words, plugins.reporters)
        ]
        kept = store_in(store)
        found = read_run(run, kept).scored_by(rule)
        # What was left out is printed on stderr where a report has no room for it.
        silent = any(writer.name not in _TELLING for writer in writers)
        for note in way_of("terminal", "notes")(found) if silent else ():
            click.echo(f"bench: {note}", err=True)
        exhibits = kept.exhibits if file is None else None
        above = kept.folder if file is None else file.parent
        written = _write(found, exhibits, writers, above, output)
    if opened and not webbrowser.open(written[_PAGE].resolve().as_uri()):
        click.echo(f"bench: there is no browser here; open {written[_PAGE]} in one", err=True)


def _write_diagnosis(
    data: Mapping[str, Any], path: Path, formats: Iterable[str], output: Path | None
) -> dict[str, Path]:
    """Show a diagnosis, or write it next to its file; return the files by format."""
    from femubench.core.library.report import SUFFIXES, rendering

    files = {}
    for name in formats:
        if name not in SUFFIXES:
            expected = f"one of {', '.join(SUFFIXES)}"
            raise InputError(f"a diagnosis has no format {name!r}", file=path, expected=expected)
    for name in formats:
        text = rendering(data, name)
        if output is None and name != _PAGE:
            click.echo(text)
            continue
        files[name] = (output or path.parent) / f"{path.stem}{SUFFIXES[name]}"
        check_writable(files[name])
        write_atomically(files[name], text)
        click.echo(f"{name}: {files[name]}")
    return files


def _write(
    run: RunData, exhibits: object, writers: Sequence[Reporter], folder: Path, output: Path | None
) -> dict[str, Path]:
    """Write files or show texts; return the files by format."""
    from femubench.core.library.report import is_for_files, render_report, run_name, text_of

    files = {
        writer.name: (output or folder) / f"{run_name(run)}{writer.suffix}"
        for writer in writers
        if output is not None or is_for_files(writer)
    }
    for path in files.values():
        check_writable(path)
    # What is shown may be on its way into a file: then nothing else must be in it.
    aside = len(files) < len(writers)
    for writer in writers:
        content = render_report(writer, run, exhibits)
        if writer.name not in files:
            click.echo(text_of(writer, content))
            continue
        write_atomically(files[writer.name], content)
        click.echo(f"{writer.name}: {files[writer.name]}", err=aside)
    return files
