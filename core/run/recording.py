"""Results on their way into the store, and those that it has already."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

from femubench.core.drawing.prediction import keep_drawings
from femubench.core.errors import InputError
from femubench.core.garbage import pause_collection
from femubench.core.pace import Advance, OnAdvance
from femubench.core.run.jobs_left import JobsLeft
from femubench.core.run.record_file import Record
from femubench.core.run.schedule import Show
from femubench.core.run.slots import Slot, starts_of
from femubench.core.run.store import Store
from femubench.core.schema.results import DONE, JobResult
from femubench.core.schema.run_options import Overwrite

Progress = Callable[[JobResult, int, int], None]


@dataclass(frozen=True)
class StoredResults:
    """Records of results that are in the store, by the key of their job.

    Arguments:
        found: those to keep, of this run or of another.
    """

    found: dict[str, Record] = field(default_factory=dict)
    own: dict[str, Record] = field(default_factory=dict)

    def take(self, key: str) -> tuple[JobResult | None, bool]:
        """Return a result to keep, if there is one, and whether this run has it; let go of it."""
        record, before = self.found.pop(key, None), self.own.pop(key, None)
        if record is None:
            return None, False
        there = before is not None and before.status == record.status
        try:
            return (before if before and there else record).result(), there
        except InputError:
            return None, False


class Results:
    """Results as they come: into the store, to who watches, and back in the order of jobs."""

    def __init__(
        self,
        slots: Sequence[Slot],
        store: Store | None,
        run: str,
        progress: Progress | None,
        report: OnAdvance | None = None,
    ) -> None:
        self._slots, self._store, self._run, self._progress = slots, store, run, progress
        self._report, self._left = report, JobsLeft((), (), 1)
        self._found: dict[int, JobResult] = {}
        if store is not None:
            # What is drawn of a case starts from the model that makes the ranks, which comes first.
            drawn = {start.case.name: start.case for start in reversed(starts_of(slots))}
            # Under other conditions nothing of it looks otherwise.
            own = [case for case in drawn.values() if not case.conditions(0)]
            keep_drawings(store.exhibits, own)

    @property
    def shelf(self) -> Show | None:
        """Return what takes exhibits; None without a store."""
        return None if self._store is None else self.show

    def add(self, index: int, result: JobResult) -> None:
        """Take a result that was just computed."""
        slot = self._slots[index]
        key, provenance = slot.key, {**slot.provenance, **result.provenance}
        if slot.stale:
            # Workers import a strategy when they need it: this may be the result of either source.
            key, provenance["strategy"] = "", f"{provenance['strategy']}, changed during the run"
        result = replace(result, key=key, provenance=provenance)
        if self._store is not None:
            self._store.append(self._run, result)
        self._take(index, result)
        if self._report is not None:
            self._report(self._left.after(result))

    def show(self, slot: Slot, exhibit: Mapping[str, Any]) -> None:
        """Take the exhibit of a result that is about to come."""
        if self._store is not None and not slot.stale:
            self._store.exhibits.put(slot.key, exhibit)

    @pause_collection()
    def keep(self, known: StoredResults, workers: int) -> list[int]:
        """Take the results that the store has, which lets go of them; return what is missing.

        That alone counts for how much is left.
        """
        missing = []
        taken: dict[str, tuple[JobResult | None, bool]] = {}
        for index, slot in enumerate(self._slots):
            # A model as drawn that has all that handbooks give is one job from either start.
            if slot.key not in taken:
                taken[slot.key] = known.take(slot.key)
            result, there = taken[slot.key]
            if result is None:
                missing.append(index)
                continue
            if result.nominal != slot.nominal:
                result = replace(result, nominal=slot.nominal)
            if self._store is not None and not there:
                self._store.append(self._run, result)
            self._take(index, result)
        # Seed after seed: what is there early says something of every case and strategy.
        missing = sorted(missing, key=lambda index: self._slots[index].seed)
        if self._report is not None:
            jobs = ((slot.case.name, slot.strategy) for slot in (self._slots[i] for i in missing))
            self._left = JobsLeft(jobs, self._found.values(), workers)
            self._report(Advance(0, len(missing)))
        return missing

    def _take(self, index: int, result: JobResult) -> None:
        self._found[index] = result
        if self._progress is not None:
            self._progress(result, len(self._found), len(self._slots))

    def in_order(self) -> list[JobResult]:
        """Return the results in the order of the jobs."""
        return [self._found[index] for index in sorted(self._found)]


def begin_run(
    stack: ExitStack,
    store: Store | None,
    meta: dict[str, Any],
    overwrite: Overwrite | None,
    resume: bool,
) -> tuple[dict[str, Any], StoredResults]:
    """Begin a run in the store or go on with one; return its meta data and results to keep."""
    if store is None:
        return meta, StoredResults()
    keep = overwrite or ("failed" if resume else "always")
    before = store.latest_of_plan(meta["plan"]) if resume else None
    if before is not None:
        meta = {**meta, **before, "run": before["run"]}
    stack.enter_context(store.exclusive(meta["run"]))
    if before is None:
        store.begin(meta)
    if keep == "always":
        return meta, StoredResults()
    own = store.latest(meta["run"])
    found = store.latest(but=meta["run"])
    # A failure is no later result.
    found |= {key: r for key, r in own.items() if r.status in DONE or key not in found}
    if keep == "failed":
        found = {key: record for key, record in found.items() if record.status in DONE}
    return meta, StoredResults(found, own)


@contextmanager
def record_end(store: Store | None, run: str) -> Iterator[dict[str, Any]]:
    """Record the end of a run, also of one that is interrupted."""
    ending: dict[str, Any] = {"interrupted": True}

    def record() -> None:
        ending["finished"] = datetime.now(UTC).isoformat(timespec="seconds")
        if store is not None:
            store.end(run, ending)

    try:
        yield ending
    except BaseException:
        with suppress(InputError):  # why the run ends counts, not what follows from it
            record()
        raise
    ending["interrupted"] = False
    record()
