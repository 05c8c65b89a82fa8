"""Runs every (case, strategy, seed) in a process of its own and judges what comes back."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import Any

from threadpoolctl import threadpool_limits

from femubench.core.case.case import Case
from femubench.core.errors import InputError
from femubench.core.pace import Told
from femubench.core.roles import Strategy
from femubench.core.run.executor import Executor, LocalProcesses, worker_count
from femubench.core.run.limits import Limits
from femubench.core.run.provenance import home_of, plan_digest, run_meta
from femubench.core.run.recording import Overwrite, Progress, Results, begin_run, record_end
from femubench.core.run.slots import Slots
from femubench.core.run.starts import Starts
from femubench.core.run.stopping import stopping
from femubench.core.run.store import Store
from femubench.core.schema.results import Run, origins_of
from femubench.core.score.repeatability import unsteady
from femubench.core.score.scoring import Reference, rank_results, reference_of

_AS_GIVEN = Starts()


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
    told: Told | None = None,
    run_seed: int = 0,
    request: Mapping[str, Any] | None = None,
    starts: Starts = _AS_GIVEN,
    executor: Executor | None = None,
) -> Run:
    """Run every strategy on every case with every seed, each job in a process of its own.

    Ctrl-C lets the jobs that run come to their end, once more stops them; what is done is kept.

    Arguments:
        seeds: 0 is the data as recorded, every other one a draw of measurement noise.
        jobs, executor: number of workers, None for that of processors; or what runs the jobs.
        timeout, timeouts, memory: seconds of a job, None for no limit; of single strategies; bytes.
        store, overwrite, resume, progress: as for `femubench.rank`.
        told: how far that is which is not in the store, and how long the rest takes.
        run_seed, request: seed of the run's own statistics, and what was asked for in plain data.
        starts: the nominal models, the cases as given where left out; what runs beside them.

    Raises:
        InputError: for two of one name, no worker, or a run that another process works on.
        ModelError: when the nominal model of a case cannot be solved.

    Examples:
        >>> results.run_jobs([case], [nominal]).results[0].status
        'ok'
    """
    _check_names(case=[*cases, *starts.beside.twins], strategy=strategies)
    place = executor or LocalProcesses(worker_count(jobs))
    place.admit(strategies, memory)
    share = place.share if memory is None else memory
    how = place.enclosure()
    why = {"sandbox_reason": how.reason} if how.reason else {}
    where = {"jobs": place.workers, "sandbox": how.sandbox, **why}
    asked: dict[str, Any] = {"seed": run_seed, "timeout": timeout, "memory": share, **where}
    own = {s.name: (timeouts or {}).get(s.name, timeout) for s in strategies}
    # The module of a strategy may be in no folder of code.
    names = {home_of(strategy)[1] for strategy in strategies} - {"__main__"}
    files = {getattr(sys.modules.get(name), "__file__", None) for name in names}
    code = tuple(sorted(os.path.abspath(file) for file in files if file))
    # No strategy is to see the folders of the cases and of the results.
    folders = {case.folder.absolute() for case in cases if (case.folder / "case.toml").is_file()}
    folders |= {store.folder.absolute()} if store else set()
    hidden = tuple(sorted(map(str, folders)))
    sight = partial(replace, sandbox=place.sandbox, hidden=hidden, shown=code)
    limits = {name: sight(Limits(seconds, share)) for name, seconds in own.items()}
    with threadpool_limits(1), ExitStack() as stack:
        # What the yardstick of every case gives, solved once for those that share it.
        solved: dict[tuple[int, int, int], Reference] = {}
        given = {}
        for case in map(starts.yardstick, (*cases, *starts.beside.twins)):
            same = id(case.model), id(case.measurement), id(case.modifications)
            if same not in solved:
                solved[same] = reference_of(case)
            given[case.name] = solved[same]
        references = starts.beside.repeated(given)
        slots = Slots(starts.of_all(cases), strategies, seeds)
        asked |= {"request": dict(request or {}), "plan": plan_digest(slots.keys)}
        who, about = slots.strategies, {**starts.about(cases), **starts.beside.about(references)}
        yardsticks = {case.name: references[case.name] for case in cases}
        slots.meta = run_meta(cases, who, yardsticks, seeds, asked, about)
        meta, known = begin_run(stack, store, slots.meta, overwrite, resume)
        ending = stack.enter_context(record_end(store, meta["run"]))
        results = Results(slots, store, meta["run"], progress, told)
        wanted = stack.enter_context(stopping()).until(results.keep(known, place.workers))
        for one in place.computed(slots, wanted, references, limits, results.shelf):
            results.add(*one)
        others, done = origins_of(meta), results.in_order()
        ranked = rank_results([r for r in done if r.case not in others], meta["reference"])
        found = Run(meta, ranked, tuple(result for result in done if result.case in others))
        if origins_of(meta, "again"):
            ending["unsteady"] = unsteady(found)
    return replace(found, meta={**meta, **ending})


def _check_names(**given: Sequence[Case] | Sequence[Strategy]) -> None:
    for kind, things in given.items():
        names = [thing.name for thing in things]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"{kind} {twice[0]!r} occurs twice", expected="every name once")
