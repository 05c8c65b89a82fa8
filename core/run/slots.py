"""The jobs of a run: known by their keys from the start, made when one is asked for."""

from __future__ import annotations

import pickle
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any, overload

from femubench.core.case.case import Case
from femubench.core.roles import StrategyRole
from femubench.core.run.jobs import Job, JobOutcome, one_line, pickle_strategy, seed_words
from femubench.core.run.provenance import comes_along, job_key, provenance, strategy_version
from femubench.core.schema.results import JobName, Nominal

_LASTING = 1.0  # s that a look at the source of a strategy is good for


@dataclass(frozen=True, eq=False)
class Start:
    """A case with the nominal model that its jobs start from."""

    nominal: Nominal
    case: Case


@dataclass(frozen=True)
class Slot:
    """One job of the run: who and what.

    Arguments:
        start: the case and where the job starts from.
        code: the strategy as a worker is given it, or why it cannot be sent to one.
        key: of everything that decides on its result.
        version: of the strategy when the key was made.
        now: returns that of the strategy as its source is now; None where workers import no source
            of it.
    """

    start: Start
    strategy: str
    seed: int
    code: bytes | JobOutcome
    key: str = ""
    version: str = ""
    now: Callable[[], str] | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)

    @property
    def case(self) -> Case:
        """Return the case with the nominal model that is started from."""
        return self.start.case

    @property
    def nominal(self) -> Nominal:
        """Return which nominal model that is."""
        return self.start.nominal

    @property
    def job_name(self) -> JobName:
        """Return what the job is called."""
        return self.case.name, self.strategy, self.seed, self.nominal

    @property
    def job(self) -> Job | JobOutcome:
        """Return what a worker is given, or why it cannot be made."""
        parts = (self.code, _model(self.start), _measurement(self.start, self.seed))
        for part in parts:
            if isinstance(part, JobOutcome):
                return part
        words = seed_words(self.case.drawn_as, self.strategy, self.seed)
        return Job(*parts, words)  # type: ignore[arg-type]

    @property
    def varied(self) -> bool:
        """Tell whether the case is under other conditions than its files say."""
        return bool(self.case.conditions(self.seed))

    @property
    def stale(self) -> bool:
        """Tell whether the source of the strategy has changed since the key was made."""
        return self.now is not None and self.now() != self.version

    @property
    def provenance(self) -> dict[str, Any]:
        """Return where its result comes from, in plain data."""
        companions = (self.meta.get("twins") or {}).get("cases", {})
        digest = {**companions, **self.meta["cases"]}[self.case.name]["digest"]
        found = provenance(self.meta, digest, self.version, self.seed)
        return {**found, **self.case.conditions(self.seed)}


# Jobs go seed after seed, so that every case comes up again and again.
@lru_cache(maxsize=100)
def _model(start: Start) -> bytes | JobOutcome:
    return _pickled(start.case.model)


@lru_cache(maxsize=8)
def _measurement(start: Start, seed: int) -> bytes | JobOutcome:
    return _pickled(start.case.used_measurement(seed))


class Slots(Sequence[Slot]):
    """The jobs of a run, case by case and seed by seed; what holds for all of them exists once.

    Arguments:
        starts: cases, each with a nominal model to start from.
    """

    def __init__(
        self,
        starts: Iterable[tuple[Nominal, Case]],
        strategies: Sequence[StrategyRole],
        seeds: Sequence[int],
    ) -> None:
        self.starts = [Start(*start) for start in starts]
        self.strategies, self.seeds = strategies, seeds
        self.meta: Mapping[str, Any] = {}
        self._codes = [_pickled(strategy, pickle_strategy) for strategy in strategies]
        self._versions = [strategy_version(strategy) for strategy in strategies]
        # Workers have what comes along from the start: it is as it was all the run.
        self._now = [
            None if comes_along(strategy) else _Lately(partial(strategy_version, strategy))
            for strategy in strategies
        ]
        known = list(map(_identity, strategies, self._codes))
        self.keys = [
            job_key(start.case, strategy.name, code, version, seed)
            for start in self.starts
            for seed in self.seeds
            for strategy, code, version in zip(self.strategies, known, self._versions, strict=True)
        ]

    def __len__(self) -> int:
        return len(self.keys)

    @overload
    def __getitem__(self, index: int) -> Slot: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Slot]: ...
    def __getitem__(self, index: int | slice) -> Slot | Sequence[Slot]:
        if isinstance(index, slice):
            return [self[place] for place in range(*index.indices(len(self)))]
        place, which = divmod(range(len(self))[index], len(self.strategies))
        start, seed = self.starts[place // len(self.seeds)], self.seeds[place % len(self.seeds)]
        name, code, key = self.strategies[which].name, self._codes[which], self.keys[index]
        version, now = self._versions[which], self._now[which]
        return Slot(start, name, seed, code, key, version, now, self.meta)


def first_seed(slots: Sequence[Slot]) -> int:
    """Return the lowest seed of jobs, of which none is made for it."""
    return min(slots.seeds if isinstance(slots, Slots) else (s.seed for s in slots), default=0)


def starts_of(slots: Sequence[Slot]) -> Sequence[Start]:
    """Return where jobs start from, in their order; none of them is made for it."""
    return slots.starts if isinstance(slots, Slots) else [*dict.fromkeys(s.start for s in slots)]


class _Lately:
    """A function that looks through files, called once a second at most."""

    def __init__(self, look: Callable[[], str]) -> None:
        self._look, self._at, self._found = look, -_LASTING, ""

    def __call__(self) -> str:
        if time.monotonic() - self._at >= _LASTING:
            self._found, self._at = self._look(), time.monotonic()
        return self._found


def _identity(strategy: StrategyRole, code: bytes | JobOutcome) -> bytes:
    """Return bytes that tell a strategy and its options from others, in this session and later.

    What was typed into a notebook has no file whose digest would tell a later version apart:
    there the code itself is what counts.
    """
    if getattr(sys.modules["__main__"], "__file__", None):
        with suppress(Exception):
            return _bytes(strategy)
    return code if isinstance(code, bytes) else repr(type(strategy)).encode()


_bytes = partial(pickle.dumps, protocol=pickle.HIGHEST_PROTOCOL)


def _pickled(thing: object, turned: Callable[[object], bytes] = _bytes) -> bytes | JobOutcome:
    try:
        return turned(thing)
    except Exception as error:
        reason = f"{type(thing).__name__} cannot be sent to a worker process: {one_line(error)}"
        return JobOutcome("failed", reason, traceback.format_exc())
