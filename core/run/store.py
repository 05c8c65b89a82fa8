"""The store of results: one file a run, to which every job adds one record at once."""

from __future__ import annotations

import errno
import os
import re
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property
from itertools import count, islice
from pathlib import Path
from typing import Any

from femubench.core.drawing.files import Exhibits
from femubench.core.errors import InputError, harmless
from femubench.core.garbage import pause_collection
from femubench.core.run.record_file import (
    Record,
    RecordWriter,
    find_faults,
    read_contents,
    read_records,
    write_file,
)
from femubench.core.schema.records import check_extent, compact, encode_result
from femubench.core.schema.results import DONE, NOMINALS, JobName, JobResult, RunData, origins_of
from femubench.core.score.ranking import Scale, rate_results

_MOST_NOTES, _MOST_JOBS = 3, 5
_SUFFIX = ".sqlite"
_STORED = "a run stored by `bench run`"
_RUN_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,199}")


def notes_of(faults: Sequence[InputError], folder: Path) -> list[str]:
    """Return a line for each of the first faults of a store and one for the others."""
    shown = [f"{fault}{': left out' if fault.line else ''}" for fault in faults[:_MOST_NOTES]]
    more = len(faults) - len(shown)
    if more:
        records = "record was" if more == 1 else "records were"
        shown.append(harmless(f"{folder}: {more} more {records} left out"))
    return shown


def hold_lock(path: Path) -> int:
    """Return a descriptor that holds the lock of a file, which its holder removes.

    Raises:
        BlockingIOError: when another process holds it.
    """
    if os.name == "nt":  # the system removes the file when its holder closes it, or ends
        try:
            return os.open(path, os.O_CREAT | os.O_EXCL | getattr(os, "O_TEMPORARY", 0))
        except FileExistsError as error:
            raise BlockingIOError from error
    import fcntl

    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
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


class Store:
    """Results of many runs in one folder, each in a file of its own.

    Several processes may write at the same time. Every record has a checksum; see docs/results.md.
    What is damaged is left out, as the notes of a run say, and never keeps anybody from the rest.

    Arguments:
        folder: created with the first record.

    Attributes:
        working_on: the run that this process began or resumed last.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self._writers: dict[str, RecordWriter] = {}
        self.working_on: str | None = None

    def file_of(self, run_id: str) -> Path:
        """Return the file that holds the records of a run.

        Raises:
            InputError: when an id cannot be the name of a file.
        """
        if not _RUN_ID.fullmatch(run_id):
            expected = "letters, digits, dots, hyphens and underscores"
            raise InputError(f"run id {run_id!r}", file=self.folder, expected=expected)
        return self.folder / f"{run_id}{_SUFFIX}"

    @property
    def files(self) -> tuple[Path, ...]:
        """Return the files that hold records, one a run."""
        found = (file for file in self.folder.glob(f"*{_SUFFIX}") if _RUN_ID.fullmatch(file.stem))
        return tuple(sorted(found))

    @cached_property
    def exhibits(self) -> Exhibits:
        """Return the shelf of pictures that belong to the records."""
        return Exhibits(self.folder)

    def begin(self, meta: Mapping[str, Any]) -> None:
        """Record the start of a run.

        Arguments:
            meta: has the id of the run under ``run``.
        """
        file = self.file_of(meta["run"])
        data = compact({"at": time.time(), "meta": meta}).encode()
        with report_write_errors(file):
            self.folder.mkdir(parents=True, exist_ok=True)
            write_file(file, [Record("run", "", "", data)])

    def append(self, run_id: str, result: JobResult) -> None:
        """Record the result of one job; after a crash it is there whole or not at all."""
        self._add(run_id, Record("result", result.key, result.status, encode_result(result)))

    def end(self, run_id: str, meta: Mapping[str, Any]) -> None:
        """Record the end of a run with what is known only then."""
        data = compact({"meta": meta}).encode()
        self._add(run_id, Record("end", "", "", data), at_once=True)
        self._close(run_id, is_complete=True)

    def runs(self) -> tuple[str, ...]:
        """Return the ids of all runs, oldest first; none where nothing was stored."""
        return tuple(self._starts())

    @pause_collection()
    def load(self, run_id: str | None = None) -> RunData:
        """Return a run with gains and ranks, its results in the order of its jobs.

        What is damaged is left out; ``meta["notes"]`` say so, and which jobs have no result. A run
        that never ended has ``meta["finished"]`` None.

        Arguments:
            run_id: or the beginning of one; None for the latest.

        Raises:
            InputError: where there is no such run, or a file cannot be read.
        """
        wanted = self._find(run_id)
        meta: dict[str, Any] = {"run": wanted, "finished": None}
        results: dict[JobName, JobResult] = {}
        faults: list[InputError] = []
        for _, content in read_contents(self.file_of(wanted), faults):
            if isinstance(content, JobResult):
                r = content
                results[r.case, r.strategy, r.seed, r.nominal] = r
            else:
                meta.update({**content, "run": wanted})
        others = origins_of(meta)
        everything = in_order_of_jobs(meta, results.values())
        listed = [result for result in everything if result.case not in others]
        companions = tuple(result for result in everything if result.case in others)
        check_extent(meta, tuple(listed), file=self.folder)
        known, missing = meta.get("notes"), self.note_missing_jobs(meta, everything)
        notes = [*(known if isinstance(known, list) else []), *notes_of(faults, self.folder)]
        notes += [missing] if missing else []
        rate_results(listed, Scale.of(meta))
        return RunData({**meta, "notes": notes}, tuple(listed), companions)

    @pause_collection()
    def by_key(self) -> dict[str, JobResult]:
        """Return the latest result of every job of any run that has a key and can be read."""
        found: dict[str, JobResult] = {}
        for key, record in self.latest().items():
            with suppress(InputError):
                found[key] = record.result()
        return found

    @pause_collection()
    def latest(self, run_id: str | None = None, *, but: str | None = None) -> dict[str, Record]:
        """Return the record of the latest result of every job that has a key, yet to be decoded.

        A failure after a result is no later one: what made it fail, such as a shorter time limit,
        is not in the key.

        Arguments:
            run_id: whose results; None for those of all runs.
            but: a run whose results are left out.
        """
        found: dict[str, Record] = {}
        for run in (*self.runs(),) if run_id is None else (run_id,):
            with suppress(InputError):
                for record in read_records(self.file_of(run), []) if run != but else ():
                    known = found.get(record.key)
                    if not record.key or record.kind != "result":
                        continue
                    if known is None or record.status in DONE or known.status not in DONE:
                        found[record.key] = record
        return found

    def read_start(self) -> dict[str, Any]:
        """Return the meta data with which the latest run began; errors as for `load`."""
        wanted = self._find(None)
        return {**(self._starts()[wanted] or {}), "run": wanted}

    def latest_of_plan(self, plan: str) -> dict[str, Any] | None:
        """Return the meta data with which the latest run of the same jobs began."""
        found = [m for m in self._starts().values() if m is not None and m.get("plan") == plan]
        return found[-1] if found else None

    @contextmanager
    def exclusive(self, run_id: str) -> Iterator[None]:
        """Keep a run to this process as long as the block runs.

        Raises:
            InputError: when another process is working on it.
        """
        file = self.file_of(run_id)
        path = file.with_name(f".{run_id}.lock")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            descriptor = hold_lock(path)
        except BlockingIOError as error:
            what = f"another process is working on run {run_id}"
            raise InputError(what, file=file, expected="one at a time") from error
        except OSError as error:
            what = f"cannot be written: {error.strerror}"
            raise InputError(what, file=self.folder, expected="a folder of yours") from error
        self.working_on = run_id
        try:
            yield
        finally:
            self._close(run_id)
            path.unlink(missing_ok=True)
            os.close(descriptor)

    def faults(self) -> list[InputError]:
        """Return what is damaged or missing, one error a fault, pictures last."""
        faults = [fault for file in self.files for fault in find_faults(file)]
        return [*faults, *self.exhibits.faults()]

    def repair(self, run_id: str) -> tuple[list[InputError], Path | None]:
        """Write the file of a run anew if it has faults; return these and a copy of it as it was.

        A file in which there is no record is not that of a run: it is left alone, without a copy.

        Raises:
            InputError: when something cannot be written.
        """
        self._close(run_id)
        file, records = self.file_of(run_id), list[Record]()
        if faults := find_faults(file):
            with suppress(InputError):
                records = [record for record, _ in read_contents(file, [])]
        if not records:
            return faults, None
        copy, before = file.with_name(f"{file.name}.damaged"), count(2)
        while copy.exists():
            copy = file.with_name(f"{file.name}.damaged-{next(before)}")
        with report_write_errors(file):
            copy.write_bytes(file.read_bytes())
            write_file(file, records)
        return faults, copy

    def _starts(self) -> dict[str, dict[str, Any] | None]:
        """Return the meta data with which all runs began, oldest first; None where it is lost."""
        found: dict[str, tuple[float, dict[str, Any] | None]] = {}
        for file in self.files:
            found[file.stem] = 0.0, None  # the latest run is no file without records
            with suppress(InputError, OSError):
                for first in islice(read_records(file, []), 1):
                    found[file.stem] = file.stat().st_mtime, None
                    if first.kind == "run":
                        found[file.stem] = first.at, {**first.meta(), "run": file.stem}
        return {run: meta for run, (_, meta) in sorted(found.items(), key=lambda item: item[1][0])}

    def _find(self, run_id: str | None) -> str:
        """Return the id of the run that is meant."""
        known = list(self._starts())
        if run_id in known:
            return str(run_id)
        matching = [name for name in known if run_id is None or name.startswith(run_id)]
        if not matching:
            what = "no results" if not known else f"no run {run_id!r}"
            if old := next(self.folder.glob("*.jsonl"), None):
                what += f"; {old.name} is of before 0.2.0: its `bench store repair` converts it"
            stored = f"one of the {len(known)} stored, e.g. {known[-1]}" if known else _STORED
            raise InputError(what, file=self.folder, expected=stored)
        if run_id is not None and len(matching) > 1:
            what = f"{len(matching)} runs begin with {run_id!r}"
            raise InputError(what, file=self.folder, expected=f"more letters, e.g. {matching[0]}")
        return str(matching[-1])

    def _add(self, run_id: str, record: Record, *, at_once: bool = False) -> None:
        with report_write_errors(self.file_of(run_id)):
            try:
                self._writer(run_id).append(record, at_once=at_once)
            except sqlite3.DatabaseError:
                # What is damaged, of which a full disk is no part, takes no records.
                if not (self.file_of(run_id).exists() and self.repair(run_id)[1]):
                    raise
                self._writer(run_id).append(record, at_once=at_once)

    def _writer(self, run_id: str) -> RecordWriter:
        if run_id not in self._writers:
            self._writers[run_id] = RecordWriter(self.file_of(run_id))
        return self._writers[run_id]

    def _close(self, run_id: str, *, is_complete: bool = False) -> None:
        if run_id in self._writers:
            self._writers.pop(run_id).close(is_complete=is_complete)

    @staticmethod
    def note_missing_jobs(meta: Mapping[str, Any], results: Iterable[JobResult]) -> str | None:
        """Return a line that says which jobs of a run have no result; None where all have one.

        Examples:
            >>> meta = {"cases": {"rod": {}}, "strategies": ["mine"], "seeds": [0]}
            >>> results.Store.note_missing_jobs(meta, ())
            '1 of 1 jobs are missing and count as the model that was given: rod mine seed 0 drawn'
        """
        starts = meta.get("starts") or {}
        models = {case: starts.get(case, NOMINALS[:1]) for case in meta.get("cases") or {}}
        # What runs along with the cases starts from the model that ranks.
        models |= {name: models.get(case, NOMINALS)[:1] for name, case in origins_of(meta).items()}
        starting = dict.fromkeys((case, nominal) for case in models for nominal in models[case])
        seeds, strategies = (dict.fromkeys(meta.get(key) or ()) for key in ("seeds", "strategies"))
        there = {
            (r.case, r.nominal, r.seed, r.strategy)
            for r in results
            if (r.case, r.nominal) in starting and r.seed in seeds and r.strategy in strategies
        }
        # Of what a file claims, which may be without end, so many are made as are named.
        plan = ((*start, seed, who) for start in starting for seed in seeds for who in strategies)
        missing = islice((job for job in plan if job not in there), _MOST_JOBS)
        first = ", ".join(
            f"{case} {who} seed {seed} {nominal}" for case, nominal, seed, who in missing
        )
        planned = len(starting) * len(seeds) * len(strategies)
        lost = planned - len(there)
        if not lost:
            return None
        first += f" and {lost - _MOST_JOBS} more" if lost > _MOST_JOBS else ""
        if "finished" in meta and (meta["finished"] is None or meta.get("interrupted") is True):
            how = "has not ended" if meta["finished"] is None else "was interrupted"
            return f"the run {how}: {len(there)} of {planned} jobs are there; not run: {first}"
        return (
            f"{lost} of {planned} jobs are missing and count as the model that was given: {first}"
        )


@contextmanager
def report_write_errors(file: Path) -> Iterator[None]:
    """Make an error of whatever keeps records from being written."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        is_full = getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
        why = os.strerror(errno.ENOSPC) if is_full else getattr(error, "strerror", None) or error
        what = f"a record cannot be written: {why}"
        raise InputError(what, file=file, expected="a store with room") from error


def in_order_of_jobs(meta: Mapping[str, Any], results: Iterable[JobResult]) -> list[JobResult]:
    """Return results as a run lists its jobs, since workers end in an order that differs each time.

    Arguments:
        meta: ``cases``, ``seeds`` and ``strategies`` of the run; what they lack comes last.
    """
    cases, nominals, seeds, strategies = (
        {name: place for place, name in enumerate(names)}
        for names in (
            (*(meta.get("cases") or ()), *origins_of(meta)),
            tuple(reversed(NOMINALS)),
            meta.get("seeds") or (),
            meta.get("strategies") or (),
        )
    )

    def place(result: JobResult) -> tuple[int, int, int, int]:
        return (
            cases.get(result.case, len(cases)),
            nominals.get(result.nominal, len(nominals)),
            seeds.get(result.seed, len(seeds)),
            strategies.get(result.strategy, len(strategies)),
        )

    return sorted(results, key=place)
