"""Runs every (case, strategy, seed) in worker processes and judges what comes back."""

from __future__ import annotations

import os
import pickle
import signal
import traceback
import warnings
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from multiprocessing import get_context
from typing import Any

from pebble import ProcessExpired, ProcessPool
from threadpoolctl import threadpool_limits

from femubench.core.case.case import Case
from femubench.core.errors import FemubenchError, InputError
from femubench.core.harness.checks import check_model
from femubench.core.harness.jobs import Job, JobOutcome, one_line, seed_words
from femubench.core.harness.meta import run_meta
from femubench.core.harness.results import JobResult, Run
from femubench.core.harness.scoring import Reference, judge, rank_results, reference_of, score_of
from femubench.core.harness.store import Store
from femubench.core.harness.worker import prepare, run_in_worker, single_threaded_environment
from femubench.core.strategy import Strategy

Progress = Callable[[JobResult, int, int], None]
_ATTEMPTS = 3  # for jobs that were under way when their pool broke down


@dataclass(frozen=True)
class _Slot:
    """One job of the run: who and what, and the job or why there is none."""

    case: Case
    strategy: str
    seed: int
    job: Job | None
    fault: JobOutcome | None = None


def run_jobs(
    cases: Sequence[Case],
    strategies: Sequence[Strategy],
    *,
    seeds: Sequence[int] = (0,),
    jobs: int | None = None,
    timeout: float | None = 600.0,
    store: Store | None = None,
    progress: Progress | None = None,
    run_seed: int = 0,
) -> Run:
    """Run every strategy on every case with every seed, in worker processes.

    A strategy gets the model and the used modes, nothing else. Workers are started afresh
    (`spawn`), so a script needs the usual ``if __name__ == "__main__":`` around its call. On
    Ctrl-C the workers are stopped; what is done stays in the store.

    Arguments:
        seeds: 0 is the data as recorded, every other one a draw of measurement noise.
        jobs: number of worker processes; None for the number of processors.
        timeout: seconds that one job may take; None for no limit.
        store: where each result goes as soon as it is there.
        progress: called with (result, jobs done, jobs in all).
        run_seed: seed of the run's own statistics.

    Raises:
        InputError: for two cases or strategies of one name, or fewer than one worker.
        ModelError: when the nominal model of a case cannot be solved.
    """
    workers = _worker_count(jobs)
    _check_names("case", [case.name for case in cases])
    _check_names("strategy", [strategy.name for strategy in strategies])
    with threadpool_limits(1):
        references = {case.name: reference_of(case) for case in cases}
        meta = run_meta(
            cases,
            strategies,
            references,
            seeds=seeds,
            jobs=workers,
            timeout=timeout,
            run_seed=run_seed,
        )
        slots = list(_slots(cases, strategies, seeds))
        results: dict[int, JobResult] = {}
        with _recorded(store, meta) as ending, closing(_outcomes(slots, workers, timeout)) as done:
            for index, outcome in done:
                result = _judged(slots[index], outcome, references[slots[index].case.name])
                results[index] = result
                if store is not None:
                    store.append(meta["run"], result)
                if progress is not None:
                    progress(result, len(results), len(slots))
    ordered = [results[index] for index in sorted(results)]
    return Run({**meta, **ending}, rank_results(ordered, meta["reference"]))


def _worker_count(jobs: int | None) -> int:
    if jobs is None:
        return len(os.sched_getaffinity(0))
    if jobs < 1:
        raise InputError(f"{jobs} worker processes", key="jobs", expected="1 or more")
    return jobs


def _check_names(kind: str, names: Sequence[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"{kind} {twice[0]!r} is there twice", expected="every name once")


@contextmanager
def _recorded(store: Store | None, meta: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Record start and end of a run, also of one that is interrupted."""
    ending: dict[str, Any] = {"interrupted": True}
    if store is not None:
        store.begin(meta)
    try:
        yield ending
        ending["interrupted"] = False
    finally:
        ending["finished"] = datetime.now(UTC).isoformat(timespec="seconds")
        if store is not None:
            store.end(meta["run"], ending)


def _slots(
    cases: Sequence[Case], strategies: Sequence[Strategy], seeds: Sequence[int]
) -> Iterator[_Slot]:
    pickled: list[bytes | JobOutcome] = [_pickled(strategy) for strategy in strategies]
    for case in cases:
        model = _pickled(case.model)
        for seed in seeds:
            measurement = _pickled(case.used_measurement(seed))
            for strategy, code in zip(strategies, pickled, strict=True):
                parts = (code, model, measurement)
                fault = next((part for part in parts if isinstance(part, JobOutcome)), None)
                words = seed_words(case.name, strategy.name, seed)
                job = None if fault else Job(*parts, words)  # type: ignore[arg-type]
                yield _Slot(case, strategy.name, seed, job, fault)


def _pickled(thing: object) -> bytes | JobOutcome:
    try:
        return pickle.dumps(thing, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        reason = f"{type(thing).__name__} cannot be sent to a worker process: {one_line(error)}"
        return JobOutcome("failed", reason, traceback.format_exc())


def _outcomes(
    slots: Sequence[_Slot], workers: int, timeout: float | None
) -> Generator[tuple[int, JobOutcome], None, None]:
    """Yield the outcome of every slot as it comes.

    A pool breaks down when a worker dies so soon that the pool does not yet know what it was
    doing; the jobs that were under way are then tried again, since most of them are innocent.
    Where a pool breaks down before any job is done, no worker can start: trying on is no use.
    """
    waiting = deque(index for index, slot in enumerate(slots) if slot.job is not None)
    for index, slot in enumerate(slots):
        if slot.fault is not None:
            yield index, slot.fault
    done, losses = 0, Counter[int]()
    while waiting:
        lost: list[int] = []
        before = len(waiting)
        with closing(_pool(slots, waiting, min(workers, before), timeout)) as outcomes:
            for index, outcome in outcomes:
                if outcome is None:
                    lost.append(index)
                else:
                    done += 1
                    yield index, outcome
        losses.update(lost)
        if len(waiting) == before or (done == 0 and max(losses.values()) >= _ATTEMPTS):
            for index in (*lost, *waiting):
                yield index, JobOutcome("crashed", "no worker process could start")
            return
        for index in lost:
            if losses[index] < _ATTEMPTS:
                waiting.append(index)
            else:
                yield index, JobOutcome("crashed", "the worker process died at once")


def _pool(
    slots: Sequence[_Slot], waiting: deque[int], workers: int, timeout: float | None
) -> Generator[tuple[int, JobOutcome | None], None, None]:
    """Yield outcomes from one pool until nothing is waiting; None for a job lost with the pool.

    Few jobs are under way at a time, so that neither models nor results pile up.
    """
    running: dict[Future[bytes], int] = {}
    with single_threaded_environment():
        pool: Any = ProcessPool(workers, initializer=prepare, context=get_context("spawn"))
        try:
            while running or (waiting and pool.active):
                with suppress(RuntimeError):  # the pool broke down meanwhile
                    while waiting and len(running) < 2 * workers:
                        job = slots[waiting[0]].job
                        future = pool.schedule(run_in_worker, args=[job], timeout=timeout)
                        running[future] = waiting.popleft()
                finished, _ = wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
                if not finished and not pool.active:
                    finished = set(running)
                for future in finished:
                    yield running.pop(future), _outcome(future, timeout)
        finally:
            pool.stop()
            pool.join()


def _outcome(future: Future[bytes], timeout: float | None) -> JobOutcome | None:
    """Return what a finished job gave; None where its pool broke down."""
    if not future.done():
        return None
    try:
        outcome = pickle.loads(future.result())
    except BrokenProcessPool:
        return None
    except TimeoutError:
        limit = timeout or 0.0
        return JobOutcome("timeout", f"no result within {limit:g} s", seconds=limit)
    except ProcessExpired as error:
        return JobOutcome("crashed", _ending(int(error.exitcode)))
    except Exception as error:
        reason = f"the result cannot be read: {one_line(error)}"
        return JobOutcome("failed", reason, traceback.format_exc())
    assert isinstance(outcome, JobOutcome)
    return outcome


def _ending(code: int) -> str:
    if code >= 0:
        return f"the worker process ended with exit code {code}"
    with suppress(ValueError):
        return f"the worker process was ended by {signal.Signals(-code).name}"
    return f"the worker process was ended by signal {-code}"


def _judged(slot: _Slot, outcome: JobOutcome, reference: Reference) -> JobResult:
    """Return the result of a job: its model checked and scored; a model that fails has failed."""
    result = JobResult(
        case=slot.case.name,
        strategy=slot.strategy,
        seed=slot.seed,
        status=outcome.status,
        reason=outcome.reason,
        seconds=outcome.seconds,
        rigid_body_modes_expected=reference.rigid.shape[1],
        parameter_count=outcome.parameter_count,
        evaluations=outcome.evaluations,
        parameters=outcome.parameters,
        history=outcome.history,
        diagnostics=outcome.diagnostics,
        traceback=outcome.traceback,
    )
    if outcome.model is not None:
        result = _scored(result, slot, outcome, reference)
    return replace(result, score=score_of(result, reference.rms_percent))


def _scored(result: JobResult, slot: _Slot, outcome: JobOutcome, reference: Reference) -> JobResult:
    assert outcome.model is not None
    try:
        with warnings.catch_warnings():
            # An ill-conditioned model shows in its figures.
            warnings.simplefilter("ignore")
            check_model(outcome.model, slot.case.model)
            judgement = judge(slot.case, outcome.model, reference)
    except Exception as error:
        reason = str(error) if isinstance(error, FemubenchError) else one_line(error)
        return replace(result, status="failed", reason=reason, traceback=traceback.format_exc())
    return replace(
        result,
        blocks=judgement.blocks,
        rigid_body_modes=judgement.rigid_body_modes,
        negative_eigenvalues=judgement.negative_eigenvalues,
    )
