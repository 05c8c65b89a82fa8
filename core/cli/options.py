"""Options that several verbs have, each with one wording."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import click

from femubench.core.cli.quantities import bytes_of, timeouts_of
from femubench.core.files import check_writable

Option: TypeAlias = Callable[[Callable[..., Any]], Callable[..., Any]]

PATH = click.Path(path_type=Path)
FOLDER = click.Path(path_type=Path, file_okay=False)
SCREEN = Path("-")


class _Output(click.Path):
    """A file that can be written to, which is known before hours are spent on its content."""

    def convert(
        self,
        value: str | os.PathLike[str],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401 - as click has it
        """Return the path."""
        path: Any = super().convert(value, param, ctx)
        if path != SCREEN:
            check_writable(path)
        return path


OUTPUT = _Output(path_type=Path, dir_okay=False)
OUTPUT_PATH = _Output(path_type=Path)
OUTPUT_OR_SCREEN = _Output(path_type=Path, dir_okay=False, allow_dash=True)

quiet = click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")


def json_file(what: str, kind: click.Path = OUTPUT) -> Option:
    """Return the option for a file of JSON, which tells what is in it."""
    return click.option("--json", "json_file", type=kind, metavar="FILE", help=what)


def style(*names: str, dest: str = "style", what: str = "What is printed.") -> Option:
    """Return the option that chooses a style, the first by default."""
    return click.option(
        "-f", "--format", dest, type=click.Choice(names), default=names[0],
        show_default=True, help=what,
    )  # fmt: skip


def output_folder(what: str, *, metavar: str = "DIR", default: str | None = None) -> Option:
    """Return the option for a folder that files go to."""
    return click.option("-o", "--output", type=FOLDER, metavar=metavar, default=default, help=what)


def store(what: str) -> Option:
    """Return the option for the store of runs."""
    text = f"{what} Default: $FEMUBENCH_STORE or femubench-results."
    return click.option("--store", type=FOLDER, metavar="DIR", help=text)


jobs = click.option(
    "-j", "--jobs", type=click.IntRange(1), metavar="N",
    help="Number of worker processes. Default: one per core. With --cluster slurm:QUEUE the number "
    "of Slurm jobs.",
)  # fmt: skip

scheduler = click.option(
    "--scheduler", metavar="ADDRESS",
    help="Run the jobs on the workers of the Dask scheduler there, e.g. tcp://host:8786.",
)  # fmt: skip

sandbox = click.option(
    "--sandbox", type=click.Choice(["auto", "require", "off"]), default="auto", show_default=True,
    help="Run strategies where they see no case, no file of yours, no other process and no network "
    "(Linux): where that is possible, or not at all, or without.",
)  # fmt: skip

cluster = click.option(
    "--cluster", metavar="CLUSTER",
    help="Start a Dask cluster for the run: local:N workers here, or slurm:QUEUE.",
)  # fmt: skip

timeouts = click.option(
    "--timeout", "timeouts", multiple=True, callback=timeouts_of, metavar="DURATION",
    help="Give up on a job after this time, e.g. 90s, 10m, 1h. STRATEGY=DURATION is for one "
    "strategy; may be repeated. Default: 10m.",
)  # fmt: skip

_memory = click.option(
    "--memory", callback=bytes_of, metavar="SIZE",
    help="Stop a job that takes more, e.g. 512M, 4G. Default: an even share of the machine's.",
)  # fmt: skip

_csv_file = click.option(
    "--csv", "csv_file", type=OUTPUT, metavar="FILE", help="Write one line per job as CSV."
)

_report_file = click.option(
    "--report", "report_file", type=OUTPUT, metavar="FILE",
    help="Write the report there; its suffix decides the format. Default: RUN.html and "
    "RUN.md in the store.",
)  # fmt: skip


def of_jobs(json: str) -> Option:
    """Return what every verb has that runs jobs: where, within which limits, and into which files.

    Arguments:
        json: what is in the file of JSON.
    """
    where, limits = (jobs, scheduler, cluster), (sandbox, timeouts, _memory)
    files = (json_file(json), _csv_file, store("Keep results there."), _report_file, quiet)

    def with_all(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed((*where, *limits, *files)):
            command = option(command)
        return command

    return with_all
