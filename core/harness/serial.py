"""Results as plain data for JSON, and back with every field checked."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from femubench.core.errors import InputError
from femubench.core.harness.results import BLOCKS, Block, JobResult, Run
from femubench.core.harness.schema import (
    LARGEST_RUN,
    LONGEST_TEXT,
    MetaRecord,
    ResultRecord,
    RunRecord,
    check_depth,
    check_extent,
    parse_json,
)
from femubench.core.reading import read_text


def result_to_json(result: JobResult) -> dict[str, Any]:
    """Return one result in the JSON contract of ``bench run``; no NaN, no infinity in it."""
    blocks = {name: result.blocks.get(name) for name in BLOCKS}
    record: dict[str, Any] = {
        "case": result.case,
        "strategy": result.strategy,
        "seed": result.seed,
        "status": result.status,
        "reason": result.reason[:LONGEST_TEXT],
        "seconds": result.seconds,
        **{name: None if block is None else _block(block) for name, block in blocks.items()},
        "rigid_body_modes": result.rigid_body_modes,
        "rigid_body_modes_expected": result.rigid_body_modes_expected,
        "negative_eigenvalues": result.negative_eigenvalues,
        "unphysical": result.unphysical,
        "parameter_count": result.parameter_count,
        "evaluations": result.evaluations,
        "score": result.score,
        "rank": result.rank,
        "parameters": [dict(item) for item in result.parameters],
        "history": [dict(item) for item in result.history],
        "diagnostics": dict(result.diagnostics),
        "traceback": result.traceback[-LONGEST_TEXT:],
        "key": result.key,
        "provenance": dict(result.provenance),
    }
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
    data = _validated(ResultRecord, record, file, line, key)
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
    """Return a run in the JSON contract of ``bench run --json``."""
    meta: dict[str, Any] = finite(dict(run.meta))
    return {"meta": meta, "results": [result_to_json(result) for result in run.results]}


def run_from_json(data: object, *, file: Path | str | None = None) -> Run:
    """Return the run that `run_to_json` gave.

    Raises:
        InputError: naming the first field that is wrong.
    """
    record = _validated(RunRecord, data, file, None, "")
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
    _validated(MetaRecord, data, file, line, key)
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
    return {
        "rms_percent": block.rms_percent,
        "mean_mac": block.mean_mac,
        "modes": [
            {
                "mode": mode.number,
                "measured_hz": mode.measured_hz,
                "predicted_hz": mode.predicted_hz,
                "mac": mode.mac,
                "modification": mode.modification,
            }
            for mode in block.modes
        ],
    }


_R = TypeVar("_R", bound=BaseModel)


def _validated(
    kind: type[_R], record: object, file: Path | str | None, line: int | None, key: str
) -> _R:
    try:
        return kind.model_validate(record)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        path = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in first["loc"])
        raise InputError(
            first["msg"],
            file=file,
            line=line,
            key=(key + path).lstrip(".") or None,
        ) from error
