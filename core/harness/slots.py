"""The jobs of a run: who does what, as bytes that a worker can be given."""

from __future__ import annotations

import pickle
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from femubench.core.case.case import Case
from femubench.core.harness.jobs import Job, JobOutcome, one_line, seed_words
from femubench.core.harness.keys import job_key, provenance, strategy_version
from femubench.core.strategy import Strategy


@dataclass(frozen=True)
class Slot:
    """One job of the run: who and what, and the job or why there is none.

    Arguments:
        case, strategy, seed: the job.
        key: of everything that decides on its result.
        provenance: of its result, in plain data.
        job: what a worker is given; None where it could not be made.
        fault: why.
        version: returns that of the strategy as its source is now.
    """

    case: Case
    strategy: str
    seed: int
    key: str
    provenance: Mapping[str, Any]
    job: Job | None
    fault: JobOutcome | None = None
    version: Callable[[], str] | None = None

    @property
    def stale(self) -> bool:
        """Tell whether the source of the strategy has changed since the key was made."""
        return self.version is not None and self.version() != self.provenance["strategy"]

    def made_by(self, meta: Mapping[str, Any]) -> Slot:
        """Return the job with the whole provenance of a run's results."""
        version = str(self.provenance["strategy"])
        return replace(self, provenance=provenance(meta, self.case, version, self.seed))


def slots_of(
    cases: Sequence[Case], strategies: Sequence[Strategy], seeds: Sequence[int]
) -> Iterator[Slot]:
    """Yield the jobs of a run, case by case and seed by seed."""
    pickled: list[bytes | JobOutcome] = [_pickled(strategy) for strategy in strategies]
    versions = [strategy_version(strategy) for strategy in strategies]
    for case in cases:
        model = _pickled(case.model)
        for seed in seeds:
            measurement = _pickled(case.used_measurement(seed))
            for strategy, code, version in zip(strategies, pickled, versions, strict=True):
                parts = (code, model, measurement)
                fault = next((part for part in parts if isinstance(part, JobOutcome)), None)
                words = seed_words(case.name, strategy.name, seed)
                job = None if fault else Job(*parts, words)  # type: ignore[arg-type]
                known = code if isinstance(code, bytes) else repr(type(strategy)).encode()
                key = job_key(case, strategy.name, known, version, seed)
                plain, now = {"strategy": version}, partial(strategy_version, strategy)
                yield Slot(case, strategy.name, seed, key, plain, job, fault, now)


def _pickled(thing: object) -> bytes | JobOutcome:
    try:
        return pickle.dumps(thing, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        reason = f"{type(thing).__name__} cannot be sent to a worker process: {one_line(error)}"
        return JobOutcome("failed", reason, traceback.format_exc())
