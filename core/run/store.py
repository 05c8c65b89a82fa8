"""The store of results: one file of JSON lines to which every job adds one line at once."""

from __future__ import annotations

import errno
import fcntl
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from femubench.core.drawing.files import Exhibits
from femubench.core.errors import InputError
from femubench.core.files import read_bytes
from femubench.core.schema.records import (
    LARGEST_STORE,
    check_extent,
    finite,
    meta_from_json,
    parse_json,
    result_from_json,
    result_to_json,
)
from femubench.core.schema.results import DONE, NOMINALS, JobResult, Nominal, Run
from femubench.core.score.ranking import rank_results

_MOST_NOTES = 3


class Damage:
    """Lines that are no records of this version.

    Arguments:
        lenient: whether they are left out and counted, instead of being an error.
    """

    def __init__(self, lenient: bool) -> None:
        self.lenient = lenient
        self._faults: list[InputError] = []

    @contextmanager
    def told(self) -> Iterator[None]:
        """Keep an error of the block, where lenient."""
        try:
            yield
        except InputError as error:
            if not self.lenient:
                raise
            self._faults.append(error)

    def notes(self, file: Path) -> list[str]:
        """Return a line for each of the first ones and one for the others."""
        shown = [f"{' '.join(str(f).split())}: left out" for f in self._faults[:_MOST_NOTES]]
        more = len(self._faults) - len(shown)
        if more:
            lines = "line was" if more == 1 else "lines were"
            shown.append(f"{file}: {more} more {lines} left out")
        return shown


@contextmanager
def locked(path: Path) -> Iterator[int]:
    """Wait for the lock of a file to which records are added; yield its descriptor."""
    descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield descriptor
    finally:
        os.close(descriptor)


def held(path: Path) -> int:
    """Return a descriptor that holds the lock of a file, which its holder removes.

    Raises:
        BlockingIOError: when another process holds it.
    """
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BaseException:
            os.close(descriptor)
            raise
        # The lock of a file that was removed meanwhile keeps nobody out.
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        os.close(descriptor)


SCHEMA = 1
FILE_NAME = "results.jsonl"
_KINDS = ("run", "result", "end")


@dataclass(frozen=True)
class _Line:
    number: int
    record: dict[str, Any]


class Store:
    """Results of many runs in one folder.

    Several processes may write at the same time. Every record is a line with ``record`` (run,
    result or end), ``schema`` and ``run``; results carry ``result``, the other two ``meta``.

    Arguments:
        folder: created with the first record.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)

    @property
    def path(self) -> Path:
        """Return the file that holds the records."""
        return self.folder / FILE_NAME

    @cached_property
    def exhibits(self) -> Exhibits:
        """Return the shelf of pictures beside the records."""
        return Exhibits(self.folder)

    def begin(self, meta: Mapping[str, Any]) -> None:
        """Record the start of a run; `meta` has its id under ``run``."""
        self._write({"record": "run", "run": meta["run"], "meta": dict(meta)})

    def append(self, run_id: str, result: JobResult) -> None:
        """Record the result of one job; after a crash it is there whole or not at all."""
        self._write({"record": "result", "run": run_id, "result": result_to_json(result)})

    def end(self, run_id: str, meta: Mapping[str, Any]) -> None:
        """Record the end of a run with what is known only then."""
        self._write({"record": "end", "run": run_id, "meta": dict(meta)})

    def runs(self) -> tuple[str, ...]:
        """Return the ids of all runs, oldest first; none where nothing was stored.

        Raises:
            InputError: for a line that is no record.
        """
        return tuple(line.record["run"] for line in self._of("run"))

    def load(self, run_id: str | None = None, *, lenient: bool = False) -> Run:
        """Return a run with scores and ranks, its results in the order of its jobs.

        A last line that was cut short (a crash while writing) is left out and told about in
        ``meta["notes"]``; a run that never ended has ``meta["finished"]`` None.

        Arguments:
            run_id: or the beginning of one; None for the latest.
            lenient: leave out lines that are no record of this version, and tell of them in the
                notes, instead of raising; for who only reads.

        Raises:
            InputError: where there is no such run, or a line is no record.
        """
        if not self.path.exists():
            raise InputError("no results", file=self.path, expected="a run stored by `bench run`")
        damage = Damage(lenient)
        lines, notes = self._lines(damage)
        wanted = self._find(lines, run_id, damage)
        meta: dict[str, Any] = {"run": wanted, "finished": None}
        results: dict[tuple[str, str, int, Nominal], JobResult] = {}
        for line in lines:
            if line.record["run"] != wanted:
                continue
            with damage.told():
                if line.record["record"] == "result":
                    found = self._result(line)
                    results[found.case, found.strategy, found.seed, found.nominal] = found
                else:
                    meta.update(self._meta(line))
        reference = meta.get("reference") or None
        check_extent(meta, tuple(results.values()), file=self.path)
        listed = in_order_of_jobs(meta, results.values())
        told = meta.get("notes")
        cases = told if isinstance(told, list) else []
        notes = [*cases, *notes, *damage.notes(self.path)]
        return Run({**meta, "notes": notes}, rank_results(listed, reference, meta.get("baseline")))

    def by_key(self, run_id: str | None = None) -> dict[str, JobResult]:
        """Return the latest result of every job of a run, or of all, that has a key.

        A failure after a result is no later one: what made it fail, such as a shorter time limit,
        is not in the key.
        """
        found: dict[str, JobResult] = {}
        for line in self._of("result"):
            item = self._result(line)
            if run_id not in (None, line.record["run"]):
                continue
            known = found.get(item.key)
            if item.key and (known is None or item.status in DONE or known.status not in DONE):
                found[item.key] = item
        return found

    def latest_of_plan(self, plan: str) -> dict[str, Any] | None:
        """Return the meta data with which the latest run of the same jobs began."""
        begun = (self._meta(line) for line in self._of("run"))
        found = [meta for meta in begun if meta.get("plan") == plan]
        return found[-1] if found else None

    @contextmanager
    def exclusive(self, run_id: str) -> Iterator[None]:
        """Keep a run to this process as long as the block runs.

        Raises:
            InputError: when another process is working on it.
        """
        path = self.folder / f".{run_id}.lock"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            descriptor = held(path)
        except BlockingIOError as error:
            what = f"another process is working on run {run_id}"
            raise InputError(what, file=self.path, expected="one at a time") from error
        except OSError as error:
            what = f"cannot be written: {error.strerror}"
            raise InputError(what, file=self.folder, expected="a folder of yours") from error
        try:
            yield
        finally:
            path.unlink(missing_ok=True)
            os.close(descriptor)

    def _of(self, kind: str) -> list[_Line]:
        """Return the records of a kind, none where nothing was stored."""
        lines = self._lines()[0] if self.path.exists() else []
        return [line for line in lines if line.record["record"] == kind]

    def _result(self, line: _Line) -> JobResult:
        record = line.record.get("result")
        return result_from_json(record, file=self.path, line=line.number, key="result")

    def _find(self, lines: list[_Line], run_id: str | None, damage: Damage) -> str:
        # Of a run whose first line is broken there may be results.
        kinds = _KINDS if damage.lenient else ("run",)
        runs = (line.record["run"] for line in lines if line.record["record"] in kinds)
        known = list(dict.fromkeys(runs))
        if run_id in known:
            return str(run_id)
        matching = [name for name in known if run_id is None or name.startswith(run_id)]
        if not matching:
            what = "no run" if run_id is None else f"no run {run_id!r}"
            what = "; ".join([what, *damage.notes(self.path)])
            stored = (
                f"one of the {len(known)} stored, e.g. {known[-1]}" if known else "a stored run"
            )
            raise InputError(what, file=self.path, expected=stored)
        if run_id is not None and len(matching) > 1:
            what = f"{len(matching)} runs begin with {run_id!r}"
            raise InputError(what, file=self.path, expected=f"more letters, e.g. {matching[0]}")
        return str(matching[-1])

    def _meta(self, line: _Line) -> dict[str, Any]:
        return meta_from_json(line.record.get("meta"), file=self.path, line=line.number)

    def _lines(self, damage: Damage | None = None) -> tuple[list[_Line], list[str]]:
        """Return all records and what has to be told about the file."""
        damage = Damage(False) if damage is None else damage
        *whole, tail = read_bytes(self.path, LARGEST_STORE).split(b"\n")
        number, broken = len(whole) + 1, bool(tail.strip()) and not _is_json(tail)
        found = []
        for place, text in enumerate(whole if broken else [*whole, tail], start=1):
            with damage.told():
                if text.strip():
                    found.append(_Line(place, self._record(text, place)))
        if not broken:
            return found, []
        return found, [f"{self.path}:{number}: the last line is cut short and was left out"]

    def _record(self, text: bytes, number: int) -> dict[str, Any]:
        record = parse_json(text, file=self.path, line=number, expected="one record a line")
        kind = record.get("record") if isinstance(record, dict) else None
        if kind not in _KINDS:
            wrong = "not a record", "record", f"one of {', '.join(_KINDS)}"
        elif record.get("schema") != SCHEMA:
            known = f"{SCHEMA}, as this version writes"
            wrong = f"schema {record.get('schema')!r}", "schema", known
        elif not isinstance(record.get("run"), str):
            wrong = "no run id", "run", "a text"
        else:
            return dict(record)
        what, key, expected = wrong
        raise InputError(what, file=self.path, line=number, key=key, expected=expected)

    def _write(self, record: dict[str, Any]) -> None:
        text = json.dumps(finite({"schema": SCHEMA, **record}), allow_nan=False)
        line = text.encode() + b"\n"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with locked(self.path) as descriptor:
                _add(descriptor, line)
        except OSError as error:
            what = f"a record cannot be written: {error.strerror or error}"
            raise InputError(what, file=self.path, expected="a store with room") from error


def _add(descriptor: int, line: bytes) -> None:
    """Add a line whole or not at all."""
    size = _mend(descriptor)
    try:
        if os.write(descriptor, line) != len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    except OSError:
        with suppress(OSError):
            os.ftruncate(descriptor, size)
        raise


def _mend(descriptor: int) -> int:
    """Let the file end with a whole line and return its size.

    What an interrupted write left behind is cut off: with a record after it, it would be a
    broken line in the middle of the file, which nobody could tell from damage.
    """
    size = os.fstat(descriptor).st_size
    if size == 0 or os.pread(descriptor, 1, size - 1) == b"\n":
        return size
    start, tail = size, b""
    while start > 0 and b"\n" not in tail:
        step = min(start, 65536)
        start -= step
        tail = os.pread(descriptor, step, start) + tail
    last = tail[tail.rfind(b"\n") + 1 :]
    if _is_json(last):
        os.write(descriptor, b"\n")
        return size + 1
    os.ftruncate(descriptor, size - len(last))
    return size - len(last)


def in_order_of_jobs(meta: Mapping[str, Any], results: Iterable[JobResult]) -> list[JobResult]:
    """Return results as a run lists its jobs, since workers end in an order that differs each time.

    Arguments:
        meta: ``cases``, ``seeds`` and ``strategies`` of the run; what they lack comes last.
    """
    listed = (
        *(meta.get("cases") or (), tuple(reversed(NOMINALS))),
        *(meta.get("seeds") or (), meta.get("strategies") or ()),
    )
    places = [{name: place for place, name in enumerate(names)} for names in listed]

    def place(result: JobResult) -> list[int]:
        words = result.case, result.nominal, result.seed, result.strategy
        return [known.get(word, len(known)) for known, word in zip(places, words, strict=True)]

    return sorted(results, key=place)


def _is_json(text: bytes) -> bool:
    try:
        return isinstance(json.loads(text), dict)
    except (ValueError, RecursionError):
        return False
