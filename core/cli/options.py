"""Options that several verbs have, each with one wording."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, TypeAlias, Union, get_args, get_origin, get_type_hints

import click
from annotated_types import Ge, Le
from click.core import ParameterSource

from femubench.core.errors import InputError
from femubench.core.files import check_writable
from femubench.core.schema.run_options import RunOptions, Where, describe_fields, split_keywords

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


def of_fields(kind: type[RunOptions | Where], *names: str, **words: object) -> Option:
    """Return the options for fields of `RunOptions` or of `Where`, as these say.

    Arguments:
        words: that a verb has otherwise.
    """
    hints, texts = get_type_hints(kind, include_extras=True), describe_fields(kind)

    def with_all(command: Callable[..., Any]) -> Callable[..., Any]:
        for name in reversed(names):
            *_, flag = hints[name].__metadata__
            own: dict[str, Any] = {
                "help": texts[name],
                "metavar": flag.metavar,
                "multiple": flag.multiple,
            }
            own |= {"callback": read_with(flag.parse)} if flag.parse else _read_type(hints[name])
            if flag.show_default:
                own |= {"default": getattr(kind(), name), "show_default": True}
            flags = flag.names.split() or [f"--{name}"]
            command = click.option(*flags, name, **{**own, **words})(command)
        return command

    return with_all


def _read_type(hint: Any) -> dict[str, Any]:  # noqa: ANN401 - of any field
    """Return the type of an option as click has it, the first of a union."""
    bounds: dict[type, Any] = {}
    while get_origin(hint) in (Annotated, Union, UnionType):
        bounds |= {type(one): one for one in getattr(hint, "__metadata__", ())}
        hint = get_args(hint)[0]
    if get_origin(hint) is Literal:
        return {"type": click.Choice(get_args(hint))}
    if Ge in bounds:
        most = bounds[Le].le if Le in bounds else None
        return {"type": click.IntRange(bounds[Ge].ge, most)}
    return {"is_flag": True} if hint is bool else {"type": hint}


def read_with(parse: Callable[[Any], Any]) -> Callable[..., Any]:
    """Return a callback of click that turns a value into another.

    Arguments:
        parse: of any value but None; raises a ValueError or an InputError for a wrong one.
    """

    def read(ctx: click.Context, parameter: click.Parameter, value: object) -> Any:  # noqa: ANN401
        try:
            return None if value is None else parse(value)
        except (ValueError, InputError) as fault:
            raise click.BadParameter(str(fault), ctx, parameter) from fault

    return read


def read_given(ctx: click.Context) -> tuple[dict[str, Any], Where]:
    """Return the options of a run that the user gave, and where it is computed."""
    names = {*RunOptions.__dataclass_fields__, *Where.__dataclass_fields__} & ctx.params.keys()
    return split_keywords({name: ctx.params[name] for name in names if is_given(ctx, name)})


def is_given(ctx: click.Context, name: str) -> bool:
    """Tell whether the user gave an option."""
    return ctx.get_parameter_source(name) is not ParameterSource.DEFAULT


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
    where = of_fields(Where, "jobs", "cluster", "sandbox")
    limits = of_fields(RunOptions, "timeouts", "memory")
    files = (json_file(json), store("Keep results there."), _report_file, quiet)

    def with_all(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed((where, limits, *files)):
            command = option(command)
        return command

    return with_all
