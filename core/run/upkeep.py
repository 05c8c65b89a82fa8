"""What is damaged in a store, and the store without it: ``bench store check``, ``repair``."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from femubench.core.errors import InputError
from femubench.core.run.sealed_file import lines_of, sync
from femubench.core.run.store import Store
from femubench.core.run.stored import OLD_FILE, AnyRecord, Record, records_of
from femubench.core.schema.records import compact, result_to_json
from femubench.core.schema.sealing import sum_of

_DAMAGED, _CONVERTED = ".damaged", ".converted"
_GAP = "records are missing before this one"


@dataclass(frozen=True)
class Repair:
    """What became of a file.

    Arguments:
        file: as it was called.
        records: that were kept.
        lost: lines that were no records, and gaps between those that are.
        aside: where the damaged lines are now, None without any; what an earlier version wrote is
            beside the new files under another name.
    """

    file: Path
    records: int
    lost: int
    aside: Path | None


def faults_of(store: Store) -> list[InputError]:
    """Return what is damaged or missing in a store, one error a fault, pictures last.

    Every record is read to the end. What schema 1 wrote has no checksums: of it only those faults
    are found that leave no record, or one that cannot be read.
    """
    faults: list[InputError] = []
    for file in store.files:
        found: list[InputError] = []
        for record in _chained(file, found):
            try:
                if record.kind == "result":
                    record.result()
                else:
                    record.meta()
            except InputError as fault:
                found.append(fault)
        faults += sorted(found, key=lambda fault: fault.line or 0)
    return [*faults, *store.exhibits.faults()]


def unsealed(store: Store) -> int:
    """Return the number of records that have no checksum, since an earlier version wrote them."""
    return sum(1 for f in store.files if f.name == OLD_FILE for _ in records_of(f, []))


def _chained(file: Path, faults: list[InputError]) -> Iterator[AnyRecord]:
    """Yield the records of a file; gaps between them are faults too."""
    before: bytes | None = b""
    told = 0
    for record in records_of(file, faults):
        if isinstance(record, Record):
            # Behind a damaged line nobody knows what should stand there.
            if len(faults) == told and record.after != before:
                expected = "all that were written"
                faults.append(InputError(_GAP, file=file, line=record.number, expected=expected))
            before, told = record.checksum, len(faults)
        yield record


def repair(store: Store) -> list[Repair]:
    """Write the files of a store anew that have faults, with all records that are whole.

    Damaged lines go to a file beside, ``RUN.jsonl.damaged``; the file of an earlier version becomes
    files of this one, with checksums, and is kept under another name. An original is there until
    all that is to replace it is on the disk.

    Raises:
        InputError: when another process works on a run, or something cannot be written.
    """
    done = []
    for file in store.files:
        faults: list[InputError] = []
        for _ in _chained(file, faults):
            pass
        if file.name == OLD_FILE:
            # The records of schema 1 become files of this version.
            kept, runs = 0, dict.fromkeys(record.run for record in records_of(file, []))
            with ExitStack() as stack:
                for run in runs:
                    stack.enter_context(store.exclusive(run))
                aside = _set_aside(file, faults)
                for run in runs:
                    own = store.file_of(run)
                    kept += _rewritten(store.folder, own, store.records(run, []))
                file.replace(file.with_name(f"{file.name}{_CONVERTED}"))
                sync(store.folder)
            done.append(Repair(file, kept, len(faults), aside))
        elif faults:
            with store.exclusive(file.stem):
                aside = _set_aside(file, faults)
                kept = _rewritten(store.folder, file, records_of(file, []))
                done.append(Repair(file, kept, len(faults), aside))
    return done


def _set_aside(file: Path, faults: Iterable[InputError]) -> Path | None:
    """Keep the damaged lines of a file beside it; return where."""
    numbers = {fault.line for fault in faults if fault.what != _GAP}
    lines = [text for number, text, _ in lines_of(file) if number in numbers]
    if not lines:
        return None
    aside = file.with_name(f"{file.name}{_DAMAGED}")
    try:
        with aside.open("ab") as stream:
            stream.write(b"\n".join([*lines, b""]))
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise _unwritable(aside, error) from error
    return aside


def _rewritten(folder: Path, file: Path, records: Iterable[AnyRecord]) -> int:
    """Put records into a file in place of what it holds; return how many."""
    count, after = 0, b""
    handle, name = tempfile.mkstemp(dir=folder, prefix=f".{file.name}.")
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            for record in records:
                line = record.following(after)
                stream.write(line + b"\n")
                count, after = count + 1, sum_of(line)
            stream.flush()
            os.fsync(stream.fileno())
        part.chmod(0o644)
        part.replace(file)
        sync(folder)
    except OSError as error:
        raise _unwritable(file, error) from error
    finally:
        part.unlink(missing_ok=True)
    return count


def _unwritable(file: Path, error: OSError) -> InputError:
    what = f"cannot be written: {error.strerror or error}"
    return InputError(what, file=file, expected="a store with room, of yours")


def exported(store: Store, run_id: str, faults: list[InputError]) -> Iterator[str]:
    """Yield the records of a run as lines of plain JSON, without checksums.

    Arguments:
        run_id: of a run that is there.
        faults: takes what is left out.
    """
    for record in store.records(run_id, faults):
        plain = {"record": record.kind, "run": run_id}
        try:
            if record.kind == "result":
                yield compact({**plain, "result": result_to_json(record.result())})
            else:
                yield compact({**plain, "meta": record.meta()})
        except InputError as fault:
            faults.append(fault)
