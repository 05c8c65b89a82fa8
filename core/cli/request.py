"""What a run is asked for, in words that can be kept with it and asked for again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from femubench.core.cli.registry import chosen
from femubench.core.errors import InputError
from femubench.core.plugin.loader import Plugins
from femubench.core.schema.results import Run

DEFAULT_TIMEOUT = 600.0  # s
_Seconds = Annotated[float, Field(gt=0, allow_inf_nan=False)]


@dataclass(frozen=True)
class Request:
    """The words of ``bench run`` that decide on results.

    Arguments:
        cases: names of scenarios or of their cases, and absolute folders.
        strategies: names, with options.
        seeds: number of draws of noise; None for the data as recorded.
        seed: the first one.
        timeout: seconds that a job may take.
        timeouts: the same for single strategies.
        memory: bytes that a job may take; None for an even share.
    """

    cases: tuple[str, ...]
    strategies: tuple[str, ...]
    seeds: Annotated[int, Field(ge=1)] | None = None
    seed: Annotated[int, Field(ge=0)] = 0
    timeout: _Seconds = DEFAULT_TIMEOUT
    timeouts: Mapping[str, _Seconds] = field(default_factory=dict)
    memory: Annotated[int, Field(ge=1)] | None = None

    @property
    def all_seeds(self) -> range:
        """Return the seeds: 0 is the data as recorded, several are draws of noise and no other."""
        first = self.seed if self.seeds is None else self.seed + 1
        return range(first, first + (self.seeds or 1))

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            **asdict(self),
            "cases": list(self.cases),
            "strategies": list(self.strategies),
            "timeouts": dict(self.timeouts),
        }


def request_of(run: Run) -> Request:
    """Return what a stored run was asked for.

    Raises:
        InputError: when it was not kept, as by earlier versions and by calls from Python.
    """
    kept = run.meta.get("request")
    if not isinstance(kept, Mapping) or not {"cases", "strategies"} <= kept.keys():
        what = f"run {run.meta.get('run')} does not tell what it was asked for"
        raise InputError(what, expected="a run of `bench run` of this version")
    try:
        found = TypeAdapter(Request).validate_python(dict(kept))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        what = f"request of run {run.meta.get('run')}: {where}: {first['msg']}"
        raise InputError(what, expected="what `bench run` keeps") from error
    return replace(found, timeouts=dict(found.timeouts))


def case_words(words: Iterable[str], plugins: Plugins) -> tuple[str, ...]:
    """Return words for cases that mean the same from any working directory."""
    given = tuple(words) or tuple(plugins.scenarios)
    parts = {name for scenario in plugins.scenarios.values() for name in scenario.cases}
    known = parts | set(plugins.scenarios)
    return tuple(word if word in known else str(Path(word).absolute()) for word in given)


def strategy_words(words: Iterable[str], plugins: Plugins) -> tuple[str, ...]:
    """Return the strategies that are asked for, each once, all where none is named.

    Raises:
        InputError: for an unknown one, or where there is none at all.
    """
    given = tuple(dict.fromkeys(words))
    chosen("strategy", (word.partition(":")[0] for word in given), plugins.strategies)
    names = given or tuple(plugins.strategies)
    if not names:
        raise InputError("there is no strategy to run", expected="a plugin that brings one")
    return names


def check_timeouts(timeouts: Mapping[str, float], strategies: Iterable[str]) -> None:
    """Make sure that every time limit is for a strategy that runs.

    Raises:
        InputError: for another name.
    """
    chosen("strategy to limit", (name for name in timeouts if name), tuple(strategies))
