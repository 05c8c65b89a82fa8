"""Results as plain data for JSON, and back with every field checked."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NoReturn

from pydantic import BaseModel, ConfigDict, Field

from femubench.core.errors import InputError
from femubench.core.files import MIB, read_text
from femubench.core.schema.results import (
    BLOCKS,
    NOMINALS,
    Block,
    JobResult,
    Nominal,
    PairedMode,
    Run,
    Status,
)
from femubench.core.schema.validation import validated

LARGEST_RUN = 256 * MIB  # bytes of a file of `bench run --json`
LARGEST_STORE = 1024 * MIB  # bytes of a store, which holds many runs
MOST_RESULTS = 100_000
LONGEST_TEXT = 100_000  # characters of a reason or a traceback
_MOST_NAMES, _MOST_JOBS = 1_000, 1_000_000
_DEEPEST = 32
Name = Annotated[str, Field(max_length=1_000)]
_Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
_Whole = Annotated[int, Field(ge=0, lt=2**63)]
_Percent = Annotated[float, Field(ge=0, le=1e150)]
_Mac = Annotated[float, Field(ge=-1e-6, le=1 + 1e-6)]


class Record(BaseModel):
    """Base of all records."""

    # What a later version adds is left out; what it must have is checked.
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class _ModeRecord(Record):
    mode: _Whole = 0
    measured_hz: Annotated[float, Field(ge=1e-45, le=1e30)]
    # Bounded so that the square of a relative error is a number.
    predicted_hz: Annotated[float, Field(ge=-1e100, le=1e100)] | None
    mac: _Mac | None
    modification: _Text | None = None
    predicted_std_hz: Annotated[float, Field(ge=0, le=1e100)] | None = None


class _BlockRecord(Record):
    rms_percent: _Percent
    mean_mac: _Mac | None = None
    modes: list[_ModeRecord]

    def block(self) -> Block:
        """Return the block of errors."""
        modes = (PairedMode(number=m.mode, **m.model_dump(exclude={"mode"})) for m in self.modes)
        return Block(self.rms_percent, self.mean_mac, tuple(modes))


class ResultRecord(Record):
    """One result."""

    case: Name
    strategy: Name
    seed: _Whole
    nominal: Nominal = "drawn"
    status: Status
    reason: _Text = ""
    seconds: Annotated[float, Field(ge=0)] = 0.0
    used: _BlockRecord | None = None
    higher: _BlockRecord | None = None
    modified: _BlockRecord | None = None
    rigid_body_modes: _Whole | None = None
    rigid_body_modes_expected: _Whole | None = None
    negative_eigenvalues: _Whole | None = None
    parameter_count: _Whole | None = None
    evaluations: _Whole | None = None
    score: Annotated[float, Field(gt=0, le=1e150)] | None = None
    rank: Annotated[int, Field(ge=1, lt=2**63)] | None = None
    parameters: list[dict[Name, _Text | float | None]] = []
    history: list[dict[Name, float | None]] = []
    diagnostics: dict[Name, float | None] = {}
    traceback: _Text = ""
    key: Name = ""
    provenance: dict[Name, _Text | int | float | None] = {}


class RunRecord(Record):
    """What ``bench run --json`` writes; results are checked one by one."""

    meta: dict[str, Any]
    results: Annotated[list[Any], Field(max_length=MOST_RESULTS)]


class _CaseMeta(Record):
    title: _Text | None = None


class MetaRecord(BaseModel):
    """The meta data that reports rest on; anything else in there is only shown."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, strict=True)

    run: Name | None = None
    seed: _Whole = 0
    seeds: Annotated[list[_Whole], Field(max_length=MOST_RESULTS)] = []
    strategies: Annotated[list[Name], Field(max_length=_MOST_NAMES)] = []
    baseline: Name | None = None
    cases: dict[Name, _CaseMeta] = {}
    structures: dict[Name, Name] | None = None
    yardstick: Nominal | None = None
    starts: dict[Name, list[Nominal]] | None = None
    alike: list[Name] | None = None
    drawings: dict[Name, Name] | None = None
    classes: dict[Name, list[Name]] | None = None
    citations: dict[Name, _Text] | None = None
    reference: dict[Name, dict[Name, _Percent]] | None = None


def check_depth(data: object, what: str, **where: Any) -> None:  # noqa: ANN401 - of InputError
    """Check that plain data are not nested deeply, which functions that call themselves rely on.

    Arguments:
        data: mappings, lists and plain values.
        what: its name, for the message.
        where: file, line and key, for the message.

    Raises:
        InputError: when they are.
    """
    level: list[object] = [data]
    for _ in range(_DEEPEST):
        level = [
            entry
            for item in level
            if isinstance(item, (dict, list))
            for entry in (item.values() if isinstance(item, dict) else item)
        ]
        if not level:
            return
    expected = f"at most {_DEEPEST} levels"
    raise InputError(f"{what} nested too deeply", **where, expected=expected)


def check_extent(
    meta: Mapping[str, Any], results: tuple[JobResult, ...], *, file: Path | str | None
) -> None:
    """Check that the table of all strategies on all cases and seeds can be made.

    Raises:
        InputError: when names and seeds are too many.
    """
    strategies = {*meta.get("strategies", ()), *(result.strategy for result in results)}
    cases = {*(meta.get("cases") or ()), *(meta.get("reference") or ())}
    cases |= {result.case for result in results}
    seeds = {*meta.get("seeds", ()), *(result.seed for result in results)}
    jobs = len(strategies) * len(cases) * len(seeds) * len(NOMINALS)
    if len(strategies) > _MOST_NAMES or jobs > _MOST_JOBS:
        what = f"{len(strategies)} strategies on {len(cases)} cases with {len(seeds)} seeds"
        expected = f"at most {_MOST_NAMES} strategies and {_MOST_JOBS} jobs"
        raise InputError(what, file=file, key="results", expected=expected)


def parse_json(
    text: str | bytes, *, file: Path | str | None = None, line: int | None = None, expected: str
) -> Any:  # noqa: ANN401 - JSON data of any form
    """Return the data of a JSON text from a stranger.

    Arguments:
        text: not longer than the caller can bear.
        file, line: where it stands, for the message.
        expected: what it should have been, for the message.

    Raises:
        InputError: when it is no JSON, has NaN or infinity in it, or is nested too deeply.
    """
    try:
        return json.loads(text, parse_constant=_not_json)
    except RecursionError:
        raise InputError("nested too deeply", file=file, line=line, expected=expected) from None
    except ValueError as error:
        what = f"not JSON: {error}"
        raise InputError(what, file=file, line=line, expected=expected) from None


def _not_json(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number of JSON")


def result_to_json(result: JobResult) -> dict[str, Any]:
    """Return one result in the JSON contract of ``bench run``; no NaN, no infinity in it."""
    record = {name: getattr(result, name, None) for name in ResultRecord.model_fields}
    record |= {name: _block(block) for name, block in result.blocks.items()}
    record |= {"reason": result.reason[:LONGEST_TEXT], "unphysical": result.unphysical}
    record["traceback"] = result.traceback[-LONGEST_TEXT:]
    clean: dict[str, Any] = _encodable(finite(record))
    return clean


def result_from_json(
    record: object, *, file: Path | str | None = None, line: int | None = None, key: str = ""
) -> JobResult:
    """Return the result that a record holds.

    Arguments:
        record: what `result_to_json` gave.
        file, line, key: where the record stands, for the message.

    Raises:
        InputError: naming the first field that is wrong.
    """
    data = validated(ResultRecord, record, file, line, key)
    found = {name: getattr(data, name) for name in BLOCKS}
    plain = data.model_dump(exclude=set(BLOCKS))
    plain["parameters"] = tuple(
        {**item, **_numbers(item, ("before", "after"))} for item in data.parameters
    )
    plain["history"] = tuple(_numbers(item, item) for item in data.history)
    plain["diagnostics"] = _numbers(data.diagnostics, data.diagnostics)
    result = JobResult(**plain)
    return replace(
        result, blocks={name: item.block() for name, item in found.items() if item is not None}
    )


def run_to_json(run: Run) -> dict[str, Any]:
    """Return a run in the JSON contract of ``bench run --json``.

    Examples:
        >>> sorted(results.run_to_json(run))
        ['meta', 'results']
    """
    meta: dict[str, Any] = finite(dict(run.meta))
    structures = meta.get("structures") or {}
    results = [
        {**result_to_json(result), "structure": structures.get(result.case, result.case)}
        for result in run.results
    ]
    return {"meta": meta, "results": results}


def run_from_json(data: object, *, file: Path | str | None = None) -> Run:
    """Return the run that `run_to_json` gave.

    Raises:
        InputError: naming the first field that is wrong.

    Examples:
        >>> results.run_from_json(results.run_to_json(run)).results == run.results
        True
    """
    record = validated(RunRecord, data, file, None, "")
    meta = meta_from_json(record.meta, file=file)
    results = tuple(
        result_from_json(item, file=file, key=f"results[{i}]")
        for i, item in enumerate(record.results)
    )
    check_extent(meta, results, file=file)
    return Run(meta, results)


def meta_from_json(
    data: object, *, file: Path | str | None = None, line: int | None = None, key: str = "meta"
) -> dict[str, Any]:
    """Return the meta data of a run as they are, once checked.

    Arguments:
        data: what `run_to_json` gave under ``meta``.
        file, line, key: where they stand, for the message.

    Raises:
        InputError: naming the first field that is wrong.
    """
    if not isinstance(data, dict):
        raise InputError("no meta data", file=file, line=line, key=key, expected="a table")
    check_depth(data, "meta data", file=file, line=line, key=key)
    validated(MetaRecord, data, file, line, key)
    return data


def read_run(file: Path) -> Run:
    """Return the run in a file that ``bench run --json`` wrote, or somebody else.

    Raises:
        InputError: for anything but a run, with the first field that is wrong.
    """
    expected = "what 'bench run --json' writes"
    return run_from_json(
        parse_json(read_text(file, LARGEST_RUN), file=file, expected=expected), file=file
    )


def finite(data: Any) -> Any:  # noqa: ANN401 - JSON data of any form
    """Return plain data with None for every number that JSON does not know."""
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, Mapping):
        return {str(key): finite(value) for key, value in data.items()}
    if isinstance(data, Sequence) and not isinstance(data, str | bytes):
        return [finite(value) for value in data]
    return data


def _encodable(data: Any) -> Any:  # noqa: ANN401 - JSON data of any form
    """Return plain data with a question mark for every character that UTF-8 does not know."""
    if isinstance(data, str):
        return data.encode("utf-8", "replace").decode()
    if isinstance(data, dict):
        return {_encodable(key): _encodable(value) for key, value in data.items()}
    return [_encodable(value) for value in data] if isinstance(data, list) else data


def _numbers(item: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """Return the named figures, nan again where JSON had no word for them."""
    return {name: math.nan if item.get(name) is None else item[name] for name in names}


def _block(block: Block) -> dict[str, Any]:
    plain = ({"mode": mode.number, **vars(mode)} for mode in block.modes)
    modes = [{name: mode[name] for name in _ModeRecord.model_fields} for mode in plain]
    return {**vars(block), "modes": modes}
