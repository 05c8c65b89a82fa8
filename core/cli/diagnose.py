"""``bench diagnose``: what a model lacks, where, how sure, and the model with it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femubench.core.cli.cases import read_cases
from femubench.core.cli.files import (
    check_can_make,
    check_writable,
    make_folder,
    write_atomically,
)
from femubench.core.cli.progress import waiting
from femubench.core.cli.registry import chosen, plugins_for
from femubench.core.errors import FemubenchError, InputError, NotApplicable, require

if TYPE_CHECKING:
    from femubench.core.case.case import Case
    from femubench.core.diagnosis.result import Diagnosis
    from femubench.core.plugin.loader import Plugins

FILE = click.Path(path_type=Path, dir_okay=False, allow_dash=True)
FOLDER = click.Path(path_type=Path, file_okay=False)
REPORT = click.Path(path_type=Path, dir_okay=False)
SCREEN = Path("-")
# Verdicts that leave no model to write.
_NO_MODEL = ("none", "unknown")
# Formats of a report by the suffix of its file.
_STYLES = {".html": "html", ".md": "markdown"}
_LONGEST = 70  # of 80 characters that a name may have


def _share(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """Return the value; a callback of click, whose own range lets nan pass."""
    if value is not None and not 0.0 <= value <= 0.2:
        raise click.BadParameter(f"{value!r} is no number >= 0 and <= 0.2")
    return value


@click.command("diagnose")
@click.argument("case")
@click.option(
    "--json",
    "json_file",
    type=FILE,
    metavar="FILE",
    help="Write the diagnosis as JSON; - prints it.",
)
@click.option(
    "-o",
    "--output",
    type=FOLDER,
    metavar="FOLDER",
    help="Write the extended model as a case folder, which must be new or empty.",
)
@click.option(
    "--tolerance",
    type=float,
    callback=_share,
    metavar="X",
    help="Ordinary relative scatter of every element; 0 for none. Default: the case's.",
)
@click.option("--no-pairs", is_flag=True, help="Look for single effects only, which is quicker.")
@click.option(
    "--effects", metavar="A,B,...", help="Try these effects only. Default: all that apply."
)
@click.option(
    "-f",
    "--format",
    "style",
    type=click.Choice(["terminal", "markdown"]),
    default="terminal",
    show_default=True,
    help="What is printed.",
)
@click.option(
    "--report",
    "report_file",
    type=REPORT,
    metavar="FILE",
    help="Write the report to a file: .html is a page with drawings (needs femubench[plot]), "
    ".md is Markdown.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.pass_context
def diagnose(
    ctx: click.Context,
    case: str,
    json_file: Path | None,
    output: Path | None,
    tolerance: float | None,
    no_pairs: bool,
    effects: str | None,
    style: str,
    report_file: Path | None,
    quiet: bool,
) -> None:
    """Find what a model lacks, and extend it.

    CASE is a scenario with one case (bench scenarios list), one case of a scenario, or a folder
    with a case.toml. Held-out modes and design changes only judge the outcome.
    """
    plugins = plugins_for(ctx)
    names = _effects(effects, plugins)
    if json_file is not None and json_file != SCREEN:
        check_writable(json_file)
    if report_file is not None:
        _check_report(report_file)
    if output is not None:
        _check_new(output)
    read = _one_case(case, plugins)
    from femubench.core.diagnosis.serial import diagnosis_to_json

    if tolerance is not None:
        read = replace(read, tolerance=tolerance)
    with waiting(f"looking for what {read.name} lacks", quiet=quiet):
        found = _diagnosed(read, names, plugins, pairs=not no_pairs)
    fault = _extended(read, found, output)
    written = output if output is not None and fault is None and _has_model(found) else None
    data = diagnosis_to_json(found, written=written, case=read)
    if report_file is not None:
        write_atomically(report_file, _report(data, _STYLES[report_file.suffix.lower()]))
    _tell(data, json_file, None if quiet else style)
    if fault is not None:
        raise fault
    if output is not None and written is None:
        what = f"the verdict is {found.verdict!r}: nothing was written to {output}"
        click.echo(f"bench: {' '.join(what.split())}", err=True)


def _effects(words: str | None, plugins: Plugins) -> tuple[str, ...]:
    """Return the names of the effects to try.

    Raises:
        InputError: for an unknown one.
    """
    if words is None:
        return tuple(plugins.effects)
    return chosen("effect", (word.strip() for word in words.split(",")), plugins.effects)


def _one_case(word: str, plugins: Plugins) -> Case:
    cases = read_cases([word], plugins)
    if len(cases) > 1:
        names = ", ".join(case.name for case in cases)
        raise InputError(f"{word!r} stands for {len(cases)} cases", expected=f"one of {names}")
    return cases[0]


def _diagnosed(case: Case, names: tuple[str, ...], plugins: Plugins, *, pairs: bool) -> Diagnosis:
    """Return the diagnosis.

    Raises:
        InputError: when the case does not have what it takes.
    """
    from threadpoolctl import threadpool_limits

    from femubench.core.diagnosis.diagnose import diagnose as search

    effects = [plugins.effects[name] for name in names]
    try:
        # Many small matrices: threads would only wait for each other.
        with threadpool_limits(1):
            return search(case, effects=effects, pairs=pairs)
    except NotApplicable as fault:
        raise InputError(f"cannot be diagnosed: {fault}", file=case.folder) from fault


def _check_new(folder: Path) -> None:
    """Make sure that a case can be written to a folder before the search starts.

    Raises:
        InputError: when it holds something or cannot be made.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError("is not empty", file=folder, expected="a new or an empty folder")
    check_can_make(folder)


def _has_model(found: Diagnosis) -> bool:
    return found.verdict not in _NO_MODEL and bool(found.causes)


def _extended(case: Case, found: Diagnosis, folder: Path | None) -> Exception | None:
    """Write the extended case; return what went wrong, for the diagnosis is worth its print."""
    if folder is None or not _has_model(found):
        return None
    from femubench.core.case.writing import write_case
    from femubench.core.diagnosis.serial import diagnosis_to_json
    from femubench.reports.diagnosis import summary_lines

    comment = summary_lines(diagnosis_to_json(found))
    # A name of its own, so that both cases can be run together.
    name = f"{case.name[:_LONGEST]}-extended"
    try:
        make_folder(folder.parent)
        write_case(folder, case, found.extended, comment=comment, name=name)
    except (FemubenchError, OSError) as fault:
        return fault
    return None


def _tell(data: Mapping[str, Any], json_file: Path | None, style: str | None) -> None:
    """Print the report, and write or print the JSON."""
    if json_file is not None:
        text = json.dumps(data, indent=1, allow_nan=False)
        if json_file == SCREEN:
            click.echo(text)
            return
        write_atomically(json_file, text)
    if style is not None:
        click.echo(_report(data, style))


def _check_report(file: Path) -> None:
    """Make sure that a report can be written there before the search starts.

    Raises:
        InputError: for a suffix that says no format, or a file that cannot be written.
    """
    if file.suffix.lower() not in _STYLES:
        known = " or ".join(_STYLES)
        raise InputError("does not say its format", file=file, expected=f"a name with {known}")
    if _STYLES[file.suffix.lower()] == "html":
        require("matplotlib", "plot", "a page with drawings")
    check_writable(file)


def _report(data: Mapping[str, Any], style: str) -> str:
    from femubench.reports.diagnosis import diagnosis_markdown, diagnosis_text
    from femubench.reports.diagnosis_page import diagnosis_html

    if style == "html":
        return diagnosis_html(data)
    return diagnosis_markdown(data) if style == "markdown" else diagnosis_text(data)
