"""Results on their way into the store, and those that it has already."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, Literal

from femubench.core.harness.results import JobResult
from femubench.core.harness.slots import Slot
from femubench.core.harness.store import Store

Progress = Callable[[JobResult, int, int], None]
Overwrite = Literal["always", "missing", "failed"]
OVERWRITE: tuple[Overwrite, ...] = ("always", "missing", "failed")
# A result, though there may be no model; everything else is a failure and no result.
_DONE = frozenset({"ok", "not-applicable"})


class Results:
    """Results as they come: into the store, to whoever watches, and back in the order of jobs."""

    def __init__(
        self, slots: Sequence[Slot], store: Store | None, run: str, progress: Progress | None
    ) -> None:
        self._slots, self._store, self._run, self._progress = slots, store, run, progress
        self._found: dict[int, JobResult] = {}
        self._stored = set() if store is None else store.keys(run)

    def add(self, index: int, result: JobResult) -> None:
        """Take a result that was just computed."""
        slot = self._slots[index]
        result = replace(result, key=slot.key, provenance=slot.provenance)
        if self._store is not None:
            self._store.append(self._run, result)
        self._tell(index, result)

    def keep(self, known: Mapping[str, JobResult]) -> list[int]:
        """Take the results that the store has, of this run or of another; return what is missing.

        Arguments:
            known: by the key of the job.
        """
        missing = []
        for index, slot in enumerate(self._slots):
            result = known.get(slot.key)
            if result is None:
                missing.append(index)
                continue
            if self._store is not None and slot.key not in self._stored:
                self._store.append(self._run, result)
            self._tell(index, result)
        return missing

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
    overwrite: Overwrite,
    resume: bool,
) -> tuple[dict[str, Any], dict[str, JobResult]]:
    """Begin a run in the store or go on with one; return its meta data and results to keep."""
    if store is None:
        return meta, {}
    keep = "failed" if resume and overwrite == "always" else overwrite
    before = store.latest_of_plan(meta["plan"]) if resume else None
    if before is not None:
        meta = {**meta, **before, "run": before["run"]}
    stack.enter_context(store.exclusive(meta["run"]))
    known = {} if keep == "always" else store.by_key()
    if before is None:
        store.begin(meta)
    if keep == "failed":
        known = {key: item for key, item in known.items() if item.status in _DONE}
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
