"""What stands in a study file: cases, strategies with options, and the conditions to vary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import AfterValidator, Field, PlainValidator

from femubench.core.case.faults import BadKey, join_key_path
from femubench.core.case.schema import Many, Text, TomlTable, misfit
from femubench.core.case.toml_text import key_line, locate_fault, spec_of
from femubench.core.errors import InputError
from femubench.core.files import MIB, read_text
from femubench.core.schema.results import NOMINALS, Nominal
from femubench.core.schema.run_options import LARGEST_SEED, RunOptions, Seed

Value = bool | int | float | str
_T = TypeVar("_T")
_LARGEST = MIB
_MOST_SEEDS = 100_000
_SEEDS = "a number of draws of noise >= 1, or a list of seeds >= 0, each once"
_VALUES = "a number, a text, true or false, or a list of these, each once"
_AXIS = '"noise", "sensors_left_out", "strategy", "STRATEGY.OPTION", "case" or "nominal"'


def _each_once(values: tuple[_T, ...]) -> tuple[_T, ...]:
    if not values:
        raise misfit("an empty list", "one entry at least")
    if len(set(values)) < len(values):
        raise misfit("an entry stands twice", "every entry once")
    return values


def _seeds(given: object) -> int | tuple[int, ...]:
    if type(given) is int and 1 <= given <= _MOST_SEEDS:
        return given
    if isinstance(given, list) and all(type(s) is int and 0 <= s <= LARGEST_SEED for s in given):
        return _each_once(tuple(given))
    raise misfit("neither a number of draws nor a list of seeds", _SEEDS)


def _values(given: object) -> tuple[Value, ...]:
    listed: list[Value] = given if isinstance(given, list) else [given]  # type: ignore[list-item]
    if not all(isinstance(value, Value) for value in listed):
        raise misfit("not a value of an option", _VALUES)
    # 1 and true are equal, and two values.
    _each_once(tuple((type(value), value) for value in listed))
    return tuple(listed)


_Word = Annotated[str, Field(strict=True, min_length=1, max_length=500)]
_Factor = Annotated[float, Field(strict=True, ge=1e-3, le=1e3, allow_inf_nan=False)]
_Number = Annotated[int, Field(strict=True, ge=0, le=1_000_000)]
_Words = Annotated[Many[_Word], AfterValidator(_each_once)]
_Factors = Annotated[Many[_Factor], AfterValidator(_each_once)]
_Numbers = Annotated[Many[_Number], AfterValidator(_each_once)]
_Nominals = Annotated[Many[Nominal], AfterValidator(_each_once)]
_Seeds = Annotated[int | tuple[int, ...], PlainValidator(_seeds)]
_Values = Annotated[tuple[Value, ...], PlainValidator(_values)]


class StudyKeys(TomlTable):
    """`[study]`."""

    title: Text = Field("", description="a text on one line")
    seed: Annotated[Seed, Field(strict=True)] = Field(0, description="a whole number >= 0")


class AxesKeys(TomlTable):
    """`[axes]`."""

    cases: _Words = Field(description='names of cases or folders, ["NAME", "./FOLDER"]')
    seeds: _Seeds | None = Field(None, description=_SEEDS)
    noise: _Factors = Field(
        (1.0,), description="factors on the stated standard deviations, 0.001 to 1000"
    )
    sensors_left_out: _Numbers = Field((0,), description="whole numbers >= 0")
    nominal: _Nominals = Field(
        NOMINALS[1:], description=f"a list of {' or '.join(map(repr, NOMINALS))}"
    )


class StrategyKeys(TomlTable):
    """`[[strategies]]`."""

    name: _Word = Field(description="the name of a strategy")
    options: dict[str, _Values] = Field({}, description=_VALUES)


class HeatMapKeys(TomlTable):
    """`[heat_map]`."""

    x: _Word = Field(description=_AXIS)
    y: _Word = Field(description=_AXIS)


class StudyTables(TomlTable):
    """The whole of a study file."""

    study: StudyKeys | None = Field(None, description="a table")
    axes: AxesKeys = Field(description="a table [axes]")
    strategies: Annotated[Many[StrategyKeys], Field(min_length=1)] = Field(
        description="one table [[strategies]] at least"
    )
    heat_map: HeatMapKeys | None = Field(None, description="a table")


@dataclass(frozen=True)
class StudyFile:
    """A study file that was read.

    Arguments:
        text: as it stands there, for the lines of messages.
    """

    file: Path
    text: str
    tables: StudyTables

    @property
    def title(self) -> str:
        """Return the title, which may be empty."""
        return self.tables.study.title if self.tables.study is not None else ""

    @property
    def options(self) -> RunOptions:
        """Return the options of the run that the file has; a study goes on where it stopped."""
        axes, seed = self.tables.axes, self.tables.study.seed if self.tables.study else 0
        nominal = axes.nominal[0] if len(axes.nominal) == 1 else "both"
        return RunOptions(seeds=axes.seeds, seed=seed, nominal=nominal, resume=True)

    @contextmanager
    def at(self, *path: str | int) -> Iterator[None]:
        """Give file, line and key to an error that is raised inside for a word of the file.

        Raises:
            InputError: in place of one that names no file.
        """
        try:
            yield
        except InputError as error:
            if error.file is not None:
                raise
            raise InputError(
                error.what,
                file=self.file,
                line=key_line(self.text, path),
                key=join_key_path(path),
                expected=error.expected,
            ) from None


def read_study(file: str | PathLike[str]) -> StudyFile:
    """Read a study file; raises InputError for a key that is unknown, missing or wrong."""
    path = Path(file)
    text = read_text(path, _LARGEST)
    try:
        found = StudyFile(path, text, spec_of(text, path, StudyTables))
        axes = found.tables.axes
        if axes.noise != (1.0,) and 0 in found.options.all_seeds:
            where = ("axes", "noise") if axes.seeds is None else ("axes", "seeds")
            what = "noise is a factor on what is drawn, and seed 0 draws none"
            raise BadKey(where, what, "seeds = N, or a list of seeds >= 1")
    except BadKey as fault:
        raise locate_fault(fault, text, path) from None
    return found


def grid(options: Mapping[str, tuple[Value, ...]]) -> Iterator[dict[str, Value]]:
    """Yield every combination of the values of options, the last option varying fastest."""
    from itertools import product

    for values in product(*options.values()):
        yield dict(zip(options, values, strict=True))
