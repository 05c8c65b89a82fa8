"""Results as JSON and as plain data for it, and back with every field checked."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NoReturn

import msgspec
import numpy as np
from msgspec import Meta, Struct

from femubench.core.errors import InputError
from femubench.core.files import MIB, read_text
from femubench.core.schema.bounds import Name, Percent, Text, Whole, read_rule_number
from femubench.core.schema.results import BLOCKS, NOMINALS, Blocks, JobResult, Nominal, RunData
from femubench.core.schema.validation import read_plain

LARGEST_RUN = 256 * MIB  # bytes of a file of `bench run --json`
MOST_RESULTS = 100_000
_MOST_NAMES, _MOST_JOBS = 1_000, 1_000_000
_DEEPEST = 32


class _RunRecord(Struct):
    """What ``bench run --json`` writes; results are checked one by one."""

    meta: dict[str, Any]
    results: Annotated[list[Any], Meta(max_length=MOST_RESULTS)]
    companions: Annotated[list[Any], Meta(max_length=MOST_RESULTS)] = []


class _Names(Struct):
    """Names within a result; a `JobResult` that checked each would be read half as fast."""

    parameters: list[dict[Name, Any]] = []
    history: list[dict[Name, Any]] = []
    diagnostics: dict[Name, Any] = {}
    provenance: dict[Name, Any] = {}


class _CaseMeta(Struct):
    title: Text | None = None


Models = dict[Name, dict[Nominal, Blocks]]


class _TwinsMeta(Struct):
    """What ran with the cases: twins by their name, and jobs that were run again."""

    seed: Whole
    number: Whole
    of: dict[Name, Name]
    again: dict[Name, Name]
    cases: dict[Name, _CaseMeta]
    reference: dict[Name, dict[Name, Percent]]
    kinds: dict[Name, list[Name]] = {}
    models: Models = {}


class _MetaRecord(Struct):
    """The meta data that reports rest on; anything else in there is only shown."""

    run: Name | None = None
    seed: Whole = 0
    seeds: Annotated[list[Whole], Meta(max_length=MOST_RESULTS)] = []
    strategies: Annotated[list[Name], Meta(max_length=_MOST_NAMES)] = []
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
    yardsticks: dict[Name, Text] | None = None
    models: Models | None = None
    rule: dict[Name, str | float] | None = None


def check_depth(data: object, **where: Any) -> None:  # noqa: ANN401 - of InputError
    """Check that plain data are not nested deeply, which functions that call themselves rely on.

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
    raise InputError("meta data nested too deeply", **where, expected=expected)


def check_extent(
    meta: Mapping[str, Any], results: tuple[JobResult, ...], *, file: Path | str | None
) -> None:
    """Check that the table of all strategies on all cases and seeds can be made.

    Raises:
        InputError: when names and seeds are too many, or what a nominal model predicts is missing.
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
    models = {**(meta.get("models") or {}), **((meta.get("twins") or {}).get("models") or {})}
    nominal = meta.get("yardstick") or "drawn"
    ranked = {result.case for result in results} if models or meta.get("rule") else set()
    for case in sorted(ranked | models.keys()):
        if nominal not in models.get(case, ()):
            where, expected = f"meta.models.{case}.{nominal}", "what that model predicts"
            raise InputError("missing", file=file, key=where, expected=expected)


def parse_json(
    text: str | bytes, *, file: Path | str | None = None, line: int | None = None, expected: str
) -> Any:  # noqa: ANN401 - JSON data of any form
    """Return the data of a JSON text that anybody may have written.

    Arguments:
        text: not longer than the caller can bear.
        expected: what it should have been, for the message.

    Raises:
        InputError: when it is no JSON, has NaN, infinity or half a character in it, or is nested
            too deeply.
    """
    what = "nested too deeply"
    try:
        return msgspec.json.decode(text)
    except (msgspec.DecodeError, UnicodeError) as error:
        what = f"not JSON: {error}"
        try:
            json.loads(text, parse_constant=_not_json)
        except (ValueError, RecursionError) as named:  # with line and column
            what = f"not JSON: {named}"
    except RecursionError:
        pass
    raise InputError(what, file=file, line=line, expected=expected)


def _not_json(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number of JSON")


def encode_result(result: JobResult) -> bytes:
    """Return one result as JSON on one line, which `decode_result` reads."""
    return encode(result)


def decode_result(data: bytes) -> JobResult:
    """Return the result of which `encode_result` gave the JSON.

    Raises:
        InputError: naming the first field that is wrong.
    """
    try:
        return _DECODER.decode(data)
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return read_plain(JobResult, parse_json(data, expected="a result"))


_DECODER = msgspec.json.Decoder(JobResult)


def encode(data: object) -> bytes:
    """Return data classes and plain data as JSON on one line, with null for what is not finite."""
    try:
        return _ENCODER.encode(data)
    except UnicodeEncodeError:
        return _ENCODER.encode(encodable(msgspec.to_builtins(data, enc_hook=to_builtin)))


def to_builtin(value: object) -> object:
    """Return a number of numpy or a mapping as msgspec knows it; raises TypeError for others."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} is no plain data")


_ENCODER = msgspec.json.Encoder(enc_hook=to_builtin)


def to_plain(data: object) -> Any:  # noqa: ANN401 - JSON data of any form
    """Return data classes and plain data as JSON has them: None for what is no finite number."""
    return msgspec.json.decode(encode(data))


def compact(data: Mapping[str, Any]) -> str:
    """Return plain data as JSON on one line, in ASCII, with null for what is not finite."""
    return json.dumps(to_plain(data), separators=(",", ":"))


def encodable(data: Any) -> Any:  # noqa: ANN401 - JSON data of any form
    """Return plain data with a question mark for every character that UTF-8 does not know."""
    if isinstance(data, str):
        return data.encode("utf-8", "replace").decode()
    if isinstance(data, dict):
        return {encodable(key): encodable(value) for key, value in data.items()}
    return [encodable(value) for value in data] if isinstance(data, list | tuple) else data


def result_to_json(result: JobResult) -> dict[str, Any]:
    """Return one result in the JSON contract of ``bench run``; no NaN, no infinity in it."""
    plain: dict[str, Any] = to_plain(result)
    blocks = plain.pop("blocks")
    return {**plain, **dict.fromkeys(BLOCKS), **blocks, "unphysical": result.unphysical}


def result_from_json(record: object, *, file: Path | str | None = None, key: str = "") -> JobResult:
    """Return the result that a record holds.

    Arguments:
        record: what `result_to_json` gave.
        file, key: where the record stands, for the message.

    Raises:
        InputError: naming the first field that is wrong.
    """
    if isinstance(record, dict):
        blocks = {name: record[name] for name in BLOCKS if record.get(name) is not None}
        record = {**record, "blocks": blocks}
    read_plain(_Names, record, file=file, key=key)
    return read_plain(JobResult, record, file=file, key=key, hidden="blocks")


def run_to_json(run: RunData) -> dict[str, Any]:
    """Return a run in the JSON contract of ``bench run --json``.

    Examples:
        >>> sorted(results.run_to_json(run))
        ['meta', 'results']
    """
    meta: dict[str, Any] = to_plain(run.meta)
    structures = meta.get("structures") or {}
    results = [
        {**result_to_json(result), "structure": structures.get(result.case, result.case)}
        for result in run.results
    ]
    companions = [result_to_json(result) for result in run.companions]
    return {"meta": meta, "results": results, **({"companions": companions} if companions else {})}


def run_from_json(data: object, *, file: Path | str | None = None) -> RunData:
    """Return the run that `run_to_json` gave.

    Raises:
        InputError: naming the first field that is wrong.

    Examples:
        >>> results.run_from_json(results.run_to_json(run)).results == run.results
        True
    """
    record = read_plain(_RunRecord, data, file=file)
    meta = meta_from_json(record.meta, file=file)
    results, companions = (
        tuple(
            result_from_json(item, file=file, key=f"{key}[{i}]")
            for i, item in enumerate(getattr(record, key))
        )
        for key in ("results", "companions")
    )
    check_extent(meta, results, file=file)
    return RunData(meta, results, companions)


def meta_from_json(
    data: object, *, file: Path | str | None = None, line: int | None = None
) -> dict[str, Any]:
    """Return the meta data of a run as they are, once checked.

    Arguments:
        data: what `run_to_json` gave under ``meta``.

    Raises:
        InputError: naming the first field that is wrong.
    """
    if not isinstance(data, dict):
        raise InputError("no meta data", file=file, line=line, key="meta", expected="a table")
    check_depth(data, file=file, line=line, key="meta")
    read_plain(_MetaRecord, data, file=file, line=line, key="meta")
    for name, value in (data.get("rule") or {}).items():
        if name != "version":
            read_rule_number(name, value, file=file, line=line, key=f"meta.rule.{name}")
    return data


def read_run(file: Path) -> RunData:
    """Return the run in a file that ``bench run --json`` wrote, or somebody else.

    Raises:
        InputError: for anything but a run, with the first field that is wrong.
    """
    expected = "what 'bench run --json' writes"
    return run_from_json(
        parse_json(read_text(file, LARGEST_RUN), file=file, expected=expected), file=file
    )
