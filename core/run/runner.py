"""Runs every (case, strategy, seed) in a process of its own and judges what comes back."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, Literal

from threadpoolctl import threadpool_limits

from femubench.core.case.case import Case
from femubench.core.errors import InputError
from femubench.core.roles import Strategy
from femubench.core.run.limits import Limits, memory_share
from femubench.core.run.provenance import plan_digest, run_meta
from femubench.core.run.recording import Overwrite, Progress, Results, ended, recorded
from femubench.core.run.schedule import computed, slots_of
from femubench.core.run.store import Store
from femubench.core.schema.results import Nominal, Run
from femubench.core.score.scoring import rank_results, reference_of


def run_jobs(
    cases: Sequence[Case],
    strategies: Sequence[Strategy],
    *,
    seeds: Sequence[int] = (0,),
    jobs: int | None = None,
    timeout: float | None = 600.0,
    timeouts: Mapping[str, float] | None = None,
    memory: int | None = None,
    store: Store | None = None,
    overwrite: Overwrite | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    run_seed: int = 0,
    request: Mapping[str, Any] | None = None,
    textbook: Mapping[str, Case] | None = None,
    nominal: Nominal | Literal["both"] = "both",
    classes: Mapping[str, Sequence[str]] | None = None,
) -> Run:
    """Run every strategy on every case with every seed, each job in a process of its own.

    What a strategy returns is judged in another process. On Ctrl-C what is done stays in the store.

    Arguments:
        seeds: 0 is the data as recorded, every other one a draw of measurement noise.
        jobs: number of workers; None for the number of processors.
        timeout: seconds that one job may take; None for no limit.
        timeouts: the same for single strategies, by name.
        memory: bytes that one job may take; None for an even share of the machine's.
        store: where each result goes as soon as it is there.
        overwrite: which stored results of the same jobs are computed anew: ``always`` all,
            ``missing`` none, ``failed`` the failures. Default: all, of a resumed run the failures.
        resume: go on with the latest stored run of these jobs.
        progress: called with (result, jobs done, jobs in all).
        run_seed, request: seed of the run's own statistics, and what was asked for in plain data.
        textbook: the cases with their textbook models by name, which all errors are measured
            against; as they are where the drawing has all that handbooks give. None measures
            against the cases as given and starts from them.
        nominal: which of the two models strategies start from.
        classes: kinds of structure and truth by case.

    Raises:
        InputError: for two of one name, no worker, or a run that another process works on.
        ModelError: when the nominal model of a case cannot be solved.

    Examples:
        >>> results.run_jobs([case], [nominal]).results[0].status
        'ok'
    """
    workers = worker_count(jobs)
    _check_names(case=cases, strategy=strategies)
    share = memory_share(workers) if memory is None else memory
    limits = {s.name: Limits((timeouts or {}).get(s.name, timeout), share) for s in strategies}
    settings: dict[str, Any] = {"seed": run_seed, "jobs": workers, "timeout": timeout}
    settings |= {"memory": share, "request": dict(request or {})}
    with threadpool_limits(1), ExitStack() as stack:
        yardstick = {case.name: (textbook or {}).get(case.name, case) for case in cases}
        references = {name: reference_of(case) for name, case in yardstick.items()}
        starts = [start for case in cases for start in _starts(case, textbook, nominal)]
        slots = list(slots_of(starts, strategies, seeds))
        about = _about(starts, textbook, classes)
        settings["plan"] = plan_digest(slot.key for slot in slots)
        meta = run_meta(cases, strategies, references, seeds, settings, about)
        slots = [slot.made_by(meta) for slot in slots]
        meta, known = recorded(stack, store, meta, overwrite, resume)
        ending = stack.enter_context(ended(store, meta["run"]))
        results = Results(slots, store, meta["run"], progress)
        for one in computed(slots, results.keep(known), references, limits, workers, results.shelf):
            results.add(*one)
    return Run({**meta, **ending}, rank_results(results.in_order(), meta["reference"]))


def _starts(
    case: Case, textbook: Mapping[str, Case] | None, nominal: Nominal | Literal["both"]
) -> Iterator[tuple[Nominal, Case]]:
    """Yield the nominal models of a case, the one that makes the ranks first."""
    if textbook is None:
        yield "drawn", case
        return
    other = textbook.get(case.name)
    if nominal != "drawn":
        yield "textbook", other or case
    if nominal == "drawn" or (nominal == "both" and other is not None):
        yield "drawn", case


def _about(
    starts: Iterable[tuple[Nominal, Case]],
    textbook: Mapping[str, Case] | None,
    classes: Mapping[str, Sequence[str]] | None,
) -> dict[str, Any]:
    """Return what a run tells of its cases: from where they start, and what they are."""
    names: dict[str, list[Nominal]] = {}
    drawings: dict[str, str] = {}
    for nominal, case in starts:
        names.setdefault(case.name, []).append(nominal)
        drawings.setdefault(case.name, case.digest)
    alike = [name for name in names if textbook is not None and name not in textbook]
    kinds = {name: list(words) for name, words in (classes or {}).items() if name in names}
    yardstick = "drawn" if textbook is None else "textbook"
    told = {"yardstick": yardstick, "starts": names, "alike": alike}
    return {**told, "drawings": drawings, "classes": kinds}


def worker_count(jobs: int | None) -> int:
    """Return the number of worker processes: that of the processors where none is given.

    Raises:
        InputError: for less than one.
    """
    if jobs is None:
        return len(os.sched_getaffinity(0))
    if jobs < 1:
        raise InputError(f"{jobs} worker processes", key="jobs", expected="1 or more")
    return jobs


def _check_names(**given: Sequence[Case] | Sequence[Strategy]) -> None:
    for kind, things in given.items():
        names = [thing.name for thing in things]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"{kind} {twice[0]!r} occurs twice", expected="every name once")
