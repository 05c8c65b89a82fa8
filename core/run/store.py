"""The store of results: one file a run, to which every job adds one line at once."""

from __future__ import annotations

import fcntl
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from femubench.core.drawing.files import Exhibits
from femubench.core.errors import InputError
from femubench.core.garbage import uncollected
from femubench.core.run.sealed_file import Syncing, add, sync
from femubench.core.run.stored import (
    OLD_FILE,
    AnyRecord,
    Record,
    begun,
    done,
    ended,
    records_of,
)
from femubench.core.schema.records import check_extent
from femubench.core.schema.results import (
    DONE,
    NOMINALS,
    JobResult,
    Nominal,
    Run,
    origins_of,
    rate,
)
from femubench.core.score.ranking import scores_and_ranks

_MOST_NOTES = 3
_SUFFIX = ".jsonl"
_RUN_ID = re.compile(r"(?!results$)[A-Za-z0-9][A-Za-z0-9._-]{0,199}")


def notes_of(faults: Sequence[InputError], folder: Path) -> list[str]:
    """Return a line for each of the first faults of a store and one for the others."""
    shown = [f"{' '.join(str(fault).split())}: left out" for fault in faults[:_MOST_NOTES]]
    more = len(faults) - len(shown)
    if more:
        lines = "line was" if more == 1 else "lines were"
        shown.append(f"{folder}: {more} more {lines} left out")
    return shown


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


class Store:
    """Results of many runs in one folder, each in a file of its own.

    Several processes may write at the same time. Every record is a line of JSON that ends with its
    checksum; see docs/results.md. What is damaged is left out and told in the notes of a run, and
    never keeps anybody from the rest.

    Arguments:
        folder: created with the first record.

    Attributes:
        working_on: the run that this process began or resumed last.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self._syncing = Syncing()
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
        """Return the files that hold records, that of earlier versions first."""
        own = (file for file in self.folder.glob(f"*{_SUFFIX}") if _RUN_ID.fullmatch(file.stem))
        old = self.folder / OLD_FILE
        return (*([old] if old.exists() else []), *sorted(own))

    @cached_property
    def exhibits(self) -> Exhibits:
        """Return the shelf of pictures beside the records."""
        return Exhibits(self.folder)

    def begin(self, meta: Mapping[str, Any]) -> None:
        """Record the start of a run, twice: without it the run could not be continued.

        Arguments:
            meta: has the id of the run under ``run``.
        """
        for _ in range(2):
            self._write(meta["run"], partial(begun, meta), at_once=True)

    def append(self, run_id: str, result: JobResult) -> None:
        """Record the result of one job; after a crash it is there whole or not at all."""
        self._write(run_id, partial(done, result))

    def end(self, run_id: str, meta: Mapping[str, Any]) -> None:
        """Record the end of a run with what is known only then."""
        self._write(run_id, partial(ended, meta), at_once=True)

    def runs(self) -> tuple[str, ...]:
        """Return the ids of all runs, oldest first; none where nothing was stored."""
        return tuple(self._begun([]))

    @uncollected()
    def load(self, run_id: str | None = None) -> Run:
        """Return a run with scores and ranks, its results in the order of its jobs.

        What is damaged or was cut short (a crash while writing) is left out and told about in
        ``meta["notes"]``; a run that never ended has ``meta["finished"]`` None.

        Arguments:
            run_id: or the beginning of one; None for the latest.

        Raises:
            InputError: where there is no such run, or a file cannot be read.
        """
        wanted = self._find(run_id)
        meta: dict[str, Any] = {"run": wanted, "finished": None}
        results: dict[tuple[str, str, int, Nominal], JobResult] = {}
        faults: list[InputError] = []
        for record in self.records(wanted, faults):
            try:
                if record.kind == "result":
                    r = record.result()
                    results[r.case, r.strategy, r.seed, r.nominal] = r
                else:
                    meta.update({**record.meta(), "run": wanted})
            except InputError as fault:
                faults.append(fault)
        others = origins_of(meta)
        everything = in_order_of_jobs(meta, results.values())
        listed = [result for result in everything if result.case not in others]
        beside = tuple(result for result in everything if result.case in others)
        check_extent(meta, tuple(listed), file=self.folder)
        told = meta.get("notes")
        notes = [*(told if isinstance(told, list) else []), *notes_of(faults, self.folder)]
        reference = meta.get("reference") or None
        found = scores_and_ranks(listed, reference, meta.get("baseline"))
        for result, score, rank in zip(listed, *found, strict=True):
            rate(result, score, rank)
        return Run({**meta, "notes": notes}, tuple(listed), beside)

    @uncollected()
    def by_key(self) -> dict[str, JobResult]:
        """Return the latest result of every job of any run that has a key and can be read."""
        found: dict[str, JobResult] = {}
        for key, record in self.latest().items():
            with suppress(InputError):
                found[key] = record.result()
        return found

    @uncollected()
    def latest(self, run_id: str | None = None, *, but: str | None = None) -> dict[str, AnyRecord]:
        """Return the record of the latest result of every job that has a key, yet to be decoded.

        A failure after a result is no later one: what made it fail, such as a shorter time limit,
        is not in the key.

        Arguments:
            run_id: whose results; None for those of all runs.
            but: a run whose results are left out.
        """
        found: dict[str, AnyRecord] = {}
        for run in (*self.runs(),) if run_id is None else (run_id,):
            for record in self.records(run, []) if run != but else ():
                known = found.get(record.key)
                if not record.key or record.kind != "result":
                    continue
                if known is None or record.status in DONE or known.status not in DONE:
                    found[record.key] = record
        return found

    def begun(self, run_id: str | None = None) -> dict[str, Any]:
        """Return the meta data with which a run began; arguments and errors as for `load`."""
        wanted = self._find(run_id)
        return {**(self._begun([])[wanted] or {}), "run": wanted}

    def latest_of_plan(self, plan: str) -> dict[str, Any] | None:
        """Return the meta data with which the latest run of the same jobs began."""
        found = [m for m in self._begun([]).values() if m is not None and m.get("plan") == plan]
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
            descriptor = held(path)
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
            path.unlink(missing_ok=True)
            os.close(descriptor)

    def records(self, run_id: str, faults: list[InputError]) -> Iterator[AnyRecord]:
        """Yield the records of a run, those of earlier versions first.

        Arguments:
            run_id: the whole id.
            faults: takes an error for every line that is no record.

        Raises:
            InputError: when a file cannot be read.
        """
        old = self.folder / OLD_FILE
        if old.exists():
            yield from (r for r in records_of(old, faults) if r.run == run_id)
        # What an earlier version called a run may be no name of a file.
        if _RUN_ID.fullmatch(run_id) and self.file_of(run_id).exists():
            yield from records_of(self.file_of(run_id), faults)

    def _begun(self, faults: list[InputError]) -> dict[str, dict[str, Any] | None]:
        """Return the meta data with which all runs began, oldest first; None where it is lost."""
        found: dict[str, dict[str, Any] | None] = {}
        times: dict[str, float] = {}
        for file in self.files:
            if file.name == OLD_FILE:
                for record in records_of(file, faults):
                    found.setdefault(record.run, None)
                    if record.kind == "run":
                        found[record.run] = _meta_of(record)
            elif file.stem not in found:
                first = next(records_of(file, faults), None)
                if isinstance(first, Record) and first.kind == "run":
                    found[file.stem], times[file.stem] = _meta_of(first), first.at
                else:
                    found[file.stem], times[file.stem] = None, file.stat().st_mtime
        return {run: found[run] for run in sorted(found, key=lambda run: times.get(run, 0.0))}

    def _find(self, run_id: str | None) -> str:
        """Return the id of the run that is meant."""
        if not self.files:
            expected = "a run stored by `bench run`"
            raise InputError("no results", file=self.folder, expected=expected)
        faults: list[InputError] = []
        known = list(self._begun(faults))
        if run_id in known:
            return str(run_id)
        matching = [name for name in known if run_id is None or name.startswith(run_id)]
        if not matching:
            what = "no run" if run_id is None else f"no run {run_id!r}"
            what = "; ".join([what, *notes_of(faults, self.folder)])
            stored = (
                f"one of the {len(known)} stored, e.g. {known[-1]}" if known else "a stored run"
            )
            raise InputError(what, file=self.folder, expected=stored)
        if run_id is not None and len(matching) > 1:
            what = f"{len(matching)} runs begin with {run_id!r}"
            raise InputError(what, file=self.folder, expected=f"more letters, e.g. {matching[0]}")
        return str(matching[-1])

    def _write(
        self, run_id: str, line_after: Callable[[bytes], bytes], *, at_once: bool = False
    ) -> None:
        path = self.file_of(run_id)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            add(path, line_after)
            if at_once:
                sync(path)
                sync(self.folder)
            else:
                self._syncing.soon(path)
        except OSError as error:
            what = f"a record cannot be written: {error.strerror or error}"
            raise InputError(what, file=path, expected="a store with room") from error


def _meta_of(record: AnyRecord) -> dict[str, Any] | None:
    """Return the meta data of a run's first record; None where they are wrong."""
    with suppress(InputError):
        return {**record.meta(), "run": record.run}
    return None


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
