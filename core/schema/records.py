"""Results as plain data for JSON, and back with every field checked."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, NoReturn

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from femubench.core.errors import InputError
from femubench.core.files import MIB, read_text
from femubench.core.schema.bounds import (
    LONGEST_TEXT,
    Hertz,
    Mac,
    Name,
    Percent,
    PredictedHertz,
    Rank,
    Score,
    Seconds,
    StdHertz,
    Text,
    Whole,
)
from femubench.core.schema.details import DETAILS, with_nan
from femubench.core.schema.paired_modes import PairedMode, rows_of
from femubench.core.schema.results import (
    BLOCKS,
    NOMINALS,
    Block,
    JobResult,
    Nominal,
    Run,
    Status,
    leave_unread,
)
from femubench.core.schema.validation import validated, wrong_field

LARGEST_RUN = 256 * MIB  # bytes of a file of `bench run --json`
MOST_RESULTS = 100_000
_MOST_NAMES, _MOST_JOBS = 1_000, 1_000_000
_DEEPEST = 32


class BaseRecord(BaseModel):
    """Base of all records."""

    # What a later version adds is left out; what it must have is checked.
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class _ModeRecord(BaseRecord):
    mode: Whole = 0
    measured_hz: Hertz
    predicted_hz: PredictedHertz | None
    mac: Mac | None
    modification: Text | None = None
    predicted_std_hz: StdHertz | None = None


_MODE = tuple(_ModeRecord.model_fields)


class _BlockRecord(BaseRecord):
    rms_percent: Percent
    mean_mac: Mac | None = None
    modes: list[_ModeRecord]

    def block(self) -> Block:
        """Return the block of errors."""
        modes = (PairedMode(number=m.mode, **m.model_dump(exclude={"mode"})) for m in self.modes)
        return Block(self.rms_percent, self.mean_mac, tuple(modes))


class ResultRecord(BaseRecord):
    """One result."""

    case: Name
    strategy: Name
    seed: Whole
    nominal: Nominal = "drawn"
    status: Status
    reason: Text = ""
    seconds: Seconds = 0.0
    used: _BlockRecord | None = None
    higher: _BlockRecord | None = None
    modified: _BlockRecord | None = None
    rigid_body_modes: Whole | None = None
    rigid_body_modes_expected: Whole | None = None
    negative_eigenvalues: Whole | None = None
    surplus_partners: Whole | None = None
    start_percent: dict[Name, Percent] = {}
    parameter_count: Whole | None = None
    evaluations: Whole | None = None
    score: Score | None = None
    rank: Rank | None = None
    parameters: list[dict[Name, Text | float | None]] = []
    history: list[dict[Name, float | None]] = []
    diagnostics: dict[Name, float | None] = {}
    traceback: Text = ""
    key: Name = ""
    provenance: dict[Name, Text | int | float | None] = {}


class RunRecord(BaseRecord):
    """What ``bench run --json`` writes; results are checked one by one."""

    meta: dict[str, Any]
    results: Annotated[list[Any], Field(max_length=MOST_RESULTS)]
    beside: Annotated[list[Any], Field(max_length=MOST_RESULTS)] = []


class _CaseMeta(BaseRecord):
    title: Text | None = None


class _TwinsMeta(BaseModel):
    """What ran beside the cases: twins by their name, and jobs that were run again."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, strict=True)

    seed: Whole
    number: Whole
    of: dict[Name, Name]
    kinds: dict[Name, list[Name]] = {}
    again: dict[Name, Name]
    cases: dict[Name, _CaseMeta]
    reference: dict[Name, dict[Name, Percent]]


class MetaRecord(BaseModel):
    """The meta data that reports rest on; anything else in there is only shown."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, strict=True)

    run: Name | None = None
    seed: Whole = 0
    seeds: Annotated[list[Whole], Field(max_length=MOST_RESULTS)] = []
    strategies: Annotated[list[Name], Field(max_length=_MOST_NAMES)] = []
    baseline: Name | None = None
    cases: dict[Name, _CaseMeta] = {}
    structures: dict[Name, Name] | None = None
    yardstick: Nominal | None = None
    starts: dict[Name, list[Nominal]] | None = None
    alike: list[Name] | None = None
    drawings: dict[Name, Name] | None = None
    classes: dict[Name, list[Name]] | None = None
    citations: dict[Name, Text] | None = None
    reference: dict[Name, dict[Name, Percent]] | None = None
    twins: _TwinsMeta | None = None


_FIGURES = tuple(
    field.name
    for field in fields(JobResult)
    if field.name not in (*DETAILS, "reason", "blocks", "rank")
)


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
    result = JobResult(**{**plain, **with_nan(plain)})
    return replace(
        result, blocks={name: item.block() for name, item in found.items() if item is not None}
    )


def result_to_line(result: JobResult) -> tuple[str, str, str]:
    """Return the figures of one result, its modes and its details, as tables of compact JSON.

    What has no value is left out.
    """
    figures = _fields(result, *_FIGURES)
    figures = {name: value for name, value in figures.items() if value not in (None, {})}
    figures["reason"] = result.reason[:LONGEST_TEXT]
    errors = "rms_percent", "mean_mac"
    figures["blocks"] = {name: _fields(block, *errors) for name, block in result.blocks.items()}
    modes = {name: rows_of(block.modes) for name, block in result.blocks.items()}
    details = _fields(result, *DETAILS)
    details["traceback"] = result.traceback[-LONGEST_TEXT:]
    return compact(figures), compact(modes), compact(details)


def compact(data: Mapping[str, Any]) -> str:
    """Return plain data as JSON on one line, in ASCII, with null for what is not finite."""
    return json.dumps(_encodable(finite(data)), allow_nan=False, separators=(",", ":"))


def result_from_line(
    figures: bytes,
    modes: bytes | None,
    details: bytes,
    *,
    file: Path | str | None = None,
    line: int | None = None,
) -> JobResult:
    """Return the result of which `result_to_line` gave three tables.

    Modes and details are read when they are asked for.

    Arguments:
        figures, modes, details: the tables; modes may stand in the figures.
        file, line: where they stand, for the message.

    Raises:
        InputError: naming the first figure that is wrong.
    """
    try:
        found: JobResult = _line_reader()(figures)
    except ValidationError as error:
        raise wrong_field(error, file, line, "result") from error
    leave_unread(found, modes, details)
    return found


@cache
def _line_reader() -> Callable[[bytes], JobResult]:
    # That of the adapter itself takes a tenth longer, for arguments that are not given.
    return TypeAdapter(JobResult).validator.validate_json


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
    beside = [result_to_json(result) for result in run.beside]
    return {"meta": meta, "results": results, **({"beside": beside} if beside else {})}


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
    results, beside = (
        tuple(
            result_from_json(item, file=file, key=f"{key}[{i}]")
            for i, item in enumerate(getattr(record, key))
        )
        for key in ("results", "beside")
    )
    check_extent(meta, results, file=file)
    return Run(meta, results, beside)


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


def _block(block: Block) -> dict[str, Any]:
    modes = [{"mode": mode.number, **_fields(mode, *_MODE[1:])} for mode in block.modes]
    return {**_fields(block, "rms_percent", "mean_mac"), "modes": modes}


def _fields(thing: object, *names: str) -> dict[str, Any]:
    return {name: getattr(thing, name) for name in names}


# Stand-ins, which the records of `msgspec` replace: the same two names, one line of JSON a result.


def encode_result(result: JobResult) -> bytes:
    """Return one result as JSON on one line, which `decode_result` reads."""
    return compact(result_to_json(result)).encode()


def decode_result(data: bytes) -> JobResult:
    """Return the result of which `encode_result` gave the JSON.

    Raises:
        InputError: naming the first field that is wrong.
    """
    return result_from_json(parse_json(data, expected="a result"))
