"""What is damaged in a store, and the store without it: ``bench store check``, ``repair``."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from msgspec import structs

from femubench.core.errors import InputError
from femubench.core.files import read_bytes
from femubench.core.run.record_file import LARGEST, Record, find_faults, read_records, write_file
from femubench.core.run.store import Store, report_write_errors
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.schema.records import compact, encode_result, parse_json, result_from_json
from femubench.core.schema.sealing import is_whole

_CONVERTED = ".converted"
_MODE = tuple(field.encode_name for field in structs.fields(PairedMode))[:6]  # of schema 2


def find_store_faults(store: Store) -> list[InputError]:
    """Return what is damaged or missing in a store, one error a fault, pictures last."""
    faults = [fault for file in store.files for fault in find_faults(file)]
    return [*faults, *store.exhibits.faults()]


def convert_old_files(store: Store) -> dict[Path, tuple[int, list[InputError]]]:
    """Write the runs of earlier versions as files of this one; their files get another name.

    Returns the number of records and the lines that are none, by file.

    Raises:
        InputError: when another process works on a run, or something cannot be written.
    """
    done = {}
    for file in store.old_files:
        faults: list[InputError] = []
        runs: dict[str, list[Record]] = {}
        for run, record in read_old_records(file, faults):
            runs.setdefault(run, []).append(record)
        for run, records in runs.items():
            own = store.file_of(run)
            with store.exclusive(run), report_write_errors(own):
                write_file(own, [*records, *(read_records(own, []) if own.exists() else ())])
        file.replace(file.with_name(f"{file.name}{_CONVERTED}"))
        done[file] = sum(map(len, runs.values())), faults
    return done


def read_old_records(file: Path, faults: list[InputError]) -> Iterator[tuple[str, Record]]:
    """Yield the records of a file of JSON lines with their runs.

    In schema 1 one file holds all runs; in schema 2 one does a run, and each line ends with a
    checksum.
    """
    for number, line in enumerate(read_bytes(file, LARGEST).splitlines(), 1):
        where: dict[str, Any] = {"file": file, "line": number}
        try:
            data = parse_json(line, **where, expected="one record a line")
            schema = data.get("schema") if isinstance(data, dict) else None
            if schema not in (1, 2) or (schema == 2 and not is_whole(line)):
                raise InputError("damaged", **where, expected="a record")
            run = data["run"] if schema == 1 else file.stem
            record = _record_of(data)
            record.file, record.number = file, number
            yield str(run), record
        except InputError as fault:
            where["key"], where["expected"] = fault.key, fault.expected
            faults.append(InputError(fault.what, **where))
        except (KeyError, TypeError, ValueError, AttributeError) as fault:
            faults.append(InputError(f"not a record: {fault}", **where, expected="a record"))


def _record_of(data: dict[str, Any]) -> Record:
    kind = data["record"]
    if kind != "result":
        meta = data["meta"]
        start = datetime.fromisoformat(meta.get("started", "1970-01-01T00:00:00+00:00"))
        at = data.get("at", start.timestamp())
        return Record(kind, "", "", compact({"at": at, "meta": meta}).encode())
    plain = data["result"]
    if "details" in data:
        plain |= data["details"]
        for name, block in plain.pop("blocks").items():
            rows = data["modes"].get(name, ())
            plain[name] = {**block, "modes": [dict(zip(_MODE, row, strict=True)) for row in rows]}
    result = result_from_json(plain, key="result")
    return Record(kind, result.key, result.status, encode_result(result))
