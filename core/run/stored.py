"""One record of a store: a run that began, the result of one job, the end of a run."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from femubench.core.errors import InputError
from femubench.core.run.sealed_file import lines_of
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.records import (
    compact,
    decode_result,
    encode_result,
    meta_from_json,
    parse_json,
    result_from_json,
)
from femubench.core.schema.results import JobResult
from femubench.core.schema.sealing import TAIL, is_whole, sealed, sum_of

SCHEMA = 2
OLD_FILE = "results.jsonl"  # of schema 1: the records of all runs, without checksums
_OLD_SCHEMA = 1
_KINDS = ("run", "result", "end")
CUT_SHORT = "the last line is cut short"
# What is asked of many records stands first, where it is found without reading the rest.
_HEAD = re.compile(
    rb'\{"schema":2,"record":"(run|result|end)","after":"([0-9a-f]{8}|)",'
    rb'(?:"key":("[^"\\]*(?:\\.[^"\\]*)*"),"status":"([a-z-]+)",)?'
)
_RESULT, _DETAILS = b'"result":', b',"details":{'


@dataclass(slots=True)
class Record:
    """One record.

    Arguments:
        file, number: where it stands.
        kind: ``run``, ``result`` or ``end``.
        run: id of its run.
        after: checksum of the record before it; empty for the first one.
        key, status: of a result.
    """

    file: Path
    number: int
    kind: str
    run: str
    after: bytes
    key: str
    status: str
    _text: bytes

    def following(self, after: bytes) -> bytes:
        """Return the line of the same record behind another one.

        Arguments:
            after: checksum of that.
        """
        own, new = (f'"after":"{s.decode()}"'.encode() for s in (self.after, after))
        return sealed(self._text[:-TAIL].replace(own, new, 1) + b"}")

    @property
    def checksum(self) -> bytes:
        """Return the checksum with which its line ends."""
        return sum_of(self._text)

    def result(self) -> JobResult:
        """Return the result.

        Raises:
            InputError: naming the first field that is wrong.
        """
        start = self._text.index(_RESULT) + len(_RESULT)
        parted = _DETAILS in self._text
        try:
            return decode_result(_joined(self._text) if parted else self._text[start:-TAIL])
        except InputError as fault:
            key = ".".join(part for part in ("result", fault.key) if part)
            where = {"file": self.file, "line": self.number, "key": key}
            raise InputError(fault.what, **where, expected=fault.expected) from None  # type: ignore[arg-type]

    def meta(self) -> dict[str, Any]:
        """Return the meta data.

        Raises:
            InputError: naming the first field that is wrong.
        """
        data = json.loads(self._text)
        return {**meta_from_json(data.get("meta"), file=self.file, line=self.number)}

    @property
    def at(self) -> float:
        """Return when the run began, in seconds since 1970."""
        return float(json.loads(self._text).get("at") or 0.0)


def _joined(text: bytes) -> bytes:
    """Return the JSON of a result that was stored in parts, its modes as rows of values."""
    line = json.loads(text)
    result = {**line["result"], **line["details"]}
    for name, rows in (line.get("modes") or {}).items():
        modes = [dict(zip(PairedMode.__struct_encode_fields__, row, strict=True)) for row in rows]
        result["blocks"][name]["modes"] = modes
    return json.dumps(result).encode()


@dataclass(frozen=True, slots=True)
class OldRecord:
    """One record of schema 1; arguments as for `Record`."""

    file: Path
    number: int
    kind: str
    run: str
    key: str
    status: str
    _data: Mapping[str, Any]

    def result(self) -> JobResult:
        """Return the result, as `Record` does."""
        record = self._data.get("result")
        return result_from_json(record, file=self.file, line=self.number, key="result")

    def meta(self) -> dict[str, Any]:
        """Return the meta data, as `Record` does."""
        return meta_from_json(self._data.get("meta"), file=self.file, line=self.number)

    def following(self, after: bytes) -> bytes:
        """Return the line of the same record in the schema of this version.

        Raises:
            InputError: when it cannot be read.
        """
        if self.kind == "result":
            return done(self.result(), after)
        if self.kind == "end":
            return ended(self.meta(), after)
        return begun(self.meta(), after, self._at())

    def _at(self) -> float:
        """Return about when the run began, in the order of the file, in seconds since 1970."""
        with suppress(TypeError, ValueError):
            start = datetime.fromisoformat(self._data["meta"].get("started"))
            return start.timestamp() + 1e-6 * min(self.number, 10**6)
        return 0.0


AnyRecord = Record | OldRecord


def begun(meta: Mapping[str, Any], after: bytes, at: float | None = None) -> bytes:
    """Return the line of a run that begins now, or began at a time in seconds since 1970."""
    when = time.time() if at is None else at
    return _line("run", after, compact({"at": when, "meta": meta}).encode())


def ended(meta: Mapping[str, Any], after: bytes) -> bytes:
    """Return the line of a run that ends."""
    return _line("end", after, compact({"meta": meta}).encode())


def done(result: JobResult, after: bytes) -> bytes:
    """Return the line of a result."""
    key, status = json.dumps(result.key), json.dumps(result.status)
    head = f'{{"key":{key},"status":{status},"result":'
    return _line("result", after, head.encode() + encode_result(result) + b"}")


def _line(kind: str, after: bytes, body: bytes) -> bytes:
    head = f'{{"schema":{SCHEMA},"record":"{kind}","after":"{after.decode()}",'
    return sealed(head.encode() + body[1:])


def records_of(path: Path, faults: list[InputError]) -> Iterator[AnyRecord]:
    """Yield the records of a file; what is none is left out.

    Arguments:
        path: of the records of one run, which has the name of the run, or of schema 1.
        faults: takes an error for every line that is no record.

    Raises:
        InputError: when the file cannot be read.
    """
    old, run = path.name == OLD_FILE, path.stem
    for number, text, with_end in lines_of(path):
        try:
            if not old:
                if not is_whole(text):
                    expected = "the line that was written"
                    raise InputError("damaged", file=path, line=number, expected=expected)
                head = _HEAD.match(text)
                if head is None:
                    what, expected = f"schema {json.loads(text).get('schema')!r}", f"{SCHEMA}"
                    raise InputError(what, file=path, line=number, key="schema", expected=expected)
                kind, after, key, status = head.groups(b"")
                name = json.loads(key) if b"\\" in key else key[1:-1].decode()
                yield Record(path, number, kind.decode(), run, after, name, status.decode(), text)
            elif text.strip():
                yield _old_record(path, number, text)
        except InputError as fault:
            cut = InputError(CUT_SHORT, file=path, line=number, expected="a whole record")
            faults.append(fault if with_end else cut)


def _old_record(path: Path, number: int, text: bytes) -> OldRecord:
    data = parse_json(text, file=path, line=number, expected="one record a line")
    kind = data.get("record") if isinstance(data, dict) else None
    if kind not in _KINDS:
        wrong = "not a record", "record", f"one of {', '.join(_KINDS)}"
    elif data.get("schema") != _OLD_SCHEMA:
        wrong = f"schema {data.get('schema')!r}", "schema", f"{_OLD_SCHEMA}"
    elif not isinstance(data.get("run"), str):
        wrong = "no run id", "run", "a text"
    else:
        result = data.get("result")
        told = result if isinstance(result, dict) else {}
        key, status = (str(told.get(name) or "") for name in ("key", "status"))
        return OldRecord(path, number, kind, data["run"], key, status, data)
    what, place, expected = wrong
    raise InputError(what, file=path, line=number, key=place, expected=expected)
