"""Results on their way into the store, and those that it has already."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, Literal

from femubench.core.drawing.prediction import keep_drawings
from femubench.core.run.schedule import Show
from femubench.core.run.slots import Slot
from femubench.core.run.store import Store
from femubench.core.schema.results import DONE, JobResult

Progress = Callable[[JobResult, int, int], None]
Overwrite = Literal["always", "missing", "failed"]
OVERWRITE: tuple[Overwrite, ...] = ("always", "missing", "failed")


class Results:
    """Results as they come: into the store, to whoever watches, and back in the order of jobs."""

    def __init__(
        self, slots: Sequence[Slot], store: Store | None, run: str, progress: Progress | None
    ) -> None:
        self._slots, self._store, self._run, self._progress = slots, store, run, progress
        self._found: dict[int, JobResult] = {}
        if store is not None:
            # What is drawn of a case starts from the model that makes the ranks, which comes first.
            drawn = {slot.case.name: slot.case for slot in reversed(slots)}
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
        self._tell(index, result)

    def show(self, slot: Slot, exhibit: Mapping[str, Any]) -> None:
        """Take the exhibit of a result that is about to come."""
        if self._store is not None and not slot.stale:
            self._store.exhibits.put(slot.key, exhibit)

    def keep(self, known: Mapping[str, JobResult]) -> list[int]:
        """Take the results that the store has, of this run or of another; return what is missing.

        Arguments:
            known: by the key of the job.
        """
        missing = []
        own = store.by_key(self._run) if (store := self._store) and known else {}
        for index, slot in enumerate(self._slots):
            result, before = known.get(slot.key), own.get(slot.key)
            if result is None:
                missing.append(index)
                continue
            # A model as drawn that has all that handbooks give is one job from either start.
            result = replace(result, nominal=slot.nominal)
            if before is not None and before.status == result.status:
                result = replace(before, nominal=slot.nominal)
            elif store is not None:
                store.append(self._run, result)
            self._tell(index, result)
        # Seed after seed: what is there early says something of every case and strategy.
        return sorted(missing, key=lambda index: self._slots[index].seed)

    def _tell(self, index: int, result: JobResult) -> None:
        self._found[index] = result
        if self._progress is not None:
            self._progress(result, len(self._found), len(self._slots))

    def in_order(self) -> list[JobResult]:
        """Return the results in the order of the jobs."""
        return [self._found[index] for index in sorted(self._found)]


def recorded(
    stack: ExitStack,
    store: Store | None,
    meta: dict[str, Any],
    overwrite: Overwrite | None,
    resume: bool,
) -> tuple[dict[str, Any], dict[str, JobResult]]:
    """Begin a run in the store or go on with one; return its meta data and results to keep."""
    if store is None:
        return meta, {}
    keep = overwrite or ("failed" if resume else "always")
    before = store.latest_of_plan(meta["plan"]) if resume else None
    if before is not None:
        meta = {**meta, **before, "run": before["run"]}
    stack.enter_context(store.exclusive(meta["run"]))
    known = {} if keep == "always" else store.by_key()
    if before is None:
        store.runs()  # what cannot be read is told before there is more of it
        store.begin(meta)
    if keep == "failed":
        known = {key: item for key, item in known.items() if item.status in DONE}
    return meta, known


@contextmanager
def ended(store: Store | None, run: str) -> Iterator[dict[str, Any]]:
    """Record the end of a run, also of one that is interrupted."""
    ending: dict[str, Any] = {"interrupted": True}
    try:
        yield ending
        ending["interrupted"] = False
    finally:
        ending["finished"] = datetime.now(UTC).isoformat(timespec="seconds")
        if store is not None:
            store.end(run, ending)
