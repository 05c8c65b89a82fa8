"""``bench diagnose``: what a model lacks, where, how sure, and the model with it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femubench.core.cli import options
from femubench.core.cli.progress import progress
from femubench.core.cli.registry import plugins_for
from femubench.core.errors import FemubenchError, InputError
from femubench.core.files import check_new, write_atomically
from femubench.core.library.cases import one_case, render_diagnosis
from femubench.core.plugin.validation import choose_names
from femubench.core.schema.run_options import RunOptions

if TYPE_CHECKING:
    from femubench.core.diagnosis.result import Diagnosis

# Formats of a report by the suffix of its file.
_STYLES = {".html": "html", ".md": "markdown"}


@click.command("diagnose")
@click.argument("case")
@options.json_file("Write the diagnosis as JSON; - prints it.", options.OUTPUT_OR_SCREEN)
@options.output_folder(
    "Write the extended model as a case folder, which must be new or empty.", metavar="FOLDER"
)
@click.option(
    "--tolerance", type=float, metavar="X",
    help="Ordinary relative scatter of every element; 0 for none. Default: the case's.",
)  # fmt: skip
@options.of_fields(RunOptions, "drawing", default="")
@click.option("--no-pairs", is_flag=True, help="Look for single effects only, which is quicker.")
@click.option("--no-faults", is_flag=True, help="Take data and input as they are.")
@click.option(
    "--budget", type=float, metavar="SECONDS",
    help="End after so long with what was found until then; a note says so. Default: no end.",
)  # fmt: skip
@click.option(
    "--effects", metavar="A,B,...", help="Try these effects only. Default: all that come along."
)
@click.option(
    "--plugin", "others", multiple=True, metavar="NAME",
    help="Try the effects and faults of this plugin too, which is imported; may be repeated.",
)  # fmt: skip
@click.option(
    "--set", "words", multiple=True, metavar="NAME=VALUE",
    help="Move where a statement begins, such as sure_fault=0.95; a note says so, and "
    "docs/settings.md has all names. May be repeated.",
)  # fmt: skip
@options.style("terminal", "markdown")
@click.option(
    "--report", "report_file", type=options.OUTPUT, metavar="FILE",
    help="Write the report to a file: .html is a page with drawings (needs femubench[plot]), "
    ".md is Markdown.",
)  # fmt: skip
@options.quiet
@click.pass_context
def diagnose(
    ctx: click.Context,
    case: str,
    json_file: Path | None,
    output: Path | None,
    tolerance: float | None,
    drawing: str,
    no_pairs: bool,
    no_faults: bool,
    budget: float | None,
    effects: str | None,
    others: tuple[str, ...],
    words: tuple[str, ...],
    style: str,
    report_file: Path | None,
    quiet: bool,
) -> None:
    """Find what a model lacks, and extend it.

    CASE is a scenario with one case (bench scenarios list), one case of a scenario, or a folder
    with a case.toml. Held-out modes and design changes only judge the outcome.
    """
    plugins = plugins_for(ctx)
    if report_file is not None and report_file.suffix.lower() not in _STYLES:
        expected = f"a name with {' or '.join(_STYLES)}"
        raise InputError("does not say its format", file=report_file, expected=expected)
    if output is not None:
        check_new(output)
    names = None if effects is None else [word.strip() for word in effects.split(",")]
    choose_names("effect", names or (), plugins.effects)
    choose_names("plugin", others, (plugin.plugin for plugin in plugins.loaded))
    read = one_case(case, plugins, drawing)
    from femubench.core.diagnosis.serial import diagnosis_to_json
    from femubench.core.inference.settings import decisions_from
    from femubench.core.library.diagnose import diagnosis_of, has_model

    with progress(read.name, quiet=quiet) as on_advance:
        found = diagnosis_of(
            *(read, names, plugins),
            pairs=not no_pairs,
            faults=not no_faults,
            tolerance=tolerance,
            budget=budget,
            on_advance=on_advance,
            others=others,
            decisions=decisions_from(words),
        )
    written = output if output is not None and has_model(found) else None
    fault = None if written is None else _fault(found, written)
    data = diagnosis_to_json(
        found, written=None if fault is not None else written, case=found.subject
    )
    if report_file is not None:
        write_atomically(report_file, render_diagnosis(data, _STYLES[report_file.suffix.lower()]))
    _tell(data, json_file, None if quiet else style)
    if not quiet and style == "terminal" and json_file != options.SCREEN and Path(case).is_dir():
        click.echo(f"Next: bench run {case}")
    if fault is not None:
        raise fault
    if output is not None and written is None:
        what = f"the verdict is {found.verdict!r}: nothing was written to {output}"
        click.echo(f"bench: {' '.join(what.split())}", err=True)


def _fault(found: Diagnosis, folder: Path) -> Exception | None:
    """Write the extended case; return what went wrong, for the diagnosis is worth its print."""
    from femubench.core.library.diagnose import write_extended

    try:
        write_extended(found, folder)
    except (FemubenchError, OSError) as fault:
        return fault
    return None


def _tell(data: Mapping[str, Any], json_file: Path | None, style: str | None) -> None:
    """Print the report, and write or print the JSON."""
    if json_file is not None:
        text = render_diagnosis(data, "json")
        if json_file == options.SCREEN:
            click.echo(text)
            return
        write_atomically(json_file, text)
    if style is not None:
        click.echo(render_diagnosis(data, style))
