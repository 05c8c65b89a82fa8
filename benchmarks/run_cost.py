"""What a run costs next to its eigenvalue solutions, and what a job costs that does nothing.

    python benchmarks/run_cost.py [CASE ...] [-s STRATEGY ...] [--sandbox off]

Without cases the default set, without strategies all but `diagnosed`, whose search has a benchmark
of its own. Prints the processor time of the run in this process, in the server of its workers and
in the workers, against that of its eigenvalue solutions: each job is run and judged once more in
this process, and its solutions of whole models are timed where they are made. Before that the same
of jobs of `unchanged`, by job.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import psutil
from threadpoolctl import threadpool_limits

from femubench.core.child.server import fork_server
from femubench.core.library.cases import usable_plugins
from femubench.core.library.rank import plan_run
from femubench.core.modal import eigen
from femubench.core.run.answers import pack_outcome, unpack_outcome
from femubench.core.run.executor import LocalProcesses
from femubench.core.run.jobs import Job, perform_job
from femubench.core.run.judging import judge_outcome
from femubench.core.run.runner import Plan, Receivers
from femubench.core.run.slots import Slots
from femubench.core.run.store import Store
from femubench.core.schema.run_options import Sandbox
from femubench.core.score.scoring import reference_of

NULL_JOBS = 60
FIVE, THIRTY = 5.0, 30.0  # times its eigenvalue solutions, ms a job: what is asked for


@dataclass(frozen=True)
class Cost:
    """Processor time of a run in s, and its wall time.

    Arguments:
        jobs: of the run.
        parent: of the process that asks for it.
        server: from which workers fork, without its start.
        workers: all of them, strategies and judges, and what has raised the walls around them.
        wall: from the first job to the last.
    """

    jobs: int
    parent: float
    server: float
    workers: float
    wall: float

    @property
    def whole(self) -> float:
        """Return all of it."""
        return self.parent + self.server + self.workers


def run_cost(plan: Plan, workers: int = 1, sandbox: Sandbox = "auto") -> Cost:
    """Run a plan in workers, the server started before, and return what it cost."""
    place = LocalProcesses(workers, sandbox)
    with tempfile.TemporaryDirectory() as folder:
        before, clock = _times(), time.perf_counter()
        run = plan.run(place, Receivers(Store(folder)))
        wall, after = time.perf_counter() - clock, _times()
    parent, server, below = (b - a for a, b in zip(before, after, strict=True))
    return Cost(len(run.results), parent, server, below, wall)


def _times() -> tuple[float, float, float]:
    """Return the processor time of this process, the server and its workers so far."""
    found = psutil.Process(fork_server().process.pid).cpu_times()
    below = found.children_user + found.children_system
    return time.process_time(), found.user + found.system, below


def start_server() -> None:
    """Start the process from which workers fork: it is started once a session."""
    null_plan(1).run(LocalProcesses(1))


@dataclass
class Solutions:
    """Eigenvalue solutions of whole models, and their processor time in s."""

    count: int = 0
    seconds: float = 0.0

    def timed(self, solve: Callable[..., Any]) -> Callable[..., Any]:
        """Return a solver that is counted here."""

        def solved(*arguments: Any, **options: Any) -> Any:  # noqa: ANN401 - of any solver
            start = time.process_time()
            try:
                return solve(*arguments, **options)
            finally:
                self.count += 1
                self.seconds += time.process_time() - start

        return solved


def solutions(plan: Plan) -> Solutions:
    """Return the solutions that the strategies of a plan make, and the judging of their models.

    A solution in a reduced basis counts for nothing.
    """
    found = Solutions()
    references = {case.name: reference_of(plan.starts.yardstick(case)) for case in plan.cases}
    pairs = (one for case in plan.cases for one in plan.starts.of(case))
    with ExitStack() as stack:
        stack.enter_context(threadpool_limits(1))
        for name in ("solve_dense", "lowest_eigenpairs"):
            timed = found.timed(getattr(eigen, name))
            stack.enter_context(patch.object(eigen, name, timed))
        for slot in Slots(pairs, plan.strategies, plan.options.all_seeds):
            if isinstance(slot.job, Job):
                # By way of its bytes: the strategy's model has modes that the judge's has not.
                outcome, given = perform_job(slot.job)
                outcome = unpack_outcome(pack_outcome(outcome, given), slot.case.model)
                names = slot.strategy, slot.seed, slot.nominal
                judge_outcome(slot.case, references[slot.case.name], names, outcome)
    return found


def null_plan(jobs: int) -> Plan:
    """Return a run whose strategy does nothing, without pictures: seeds on `frame`."""
    return plan_run("frame", "unchanged", usable_plugins(), {"seeds": jobs, "nominal": "drawn"})


def null_job(jobs: int = NULL_JOBS, workers: int = 1, sandbox: Sandbox = "auto") -> Cost:
    """Return what a run of null jobs costs."""
    return run_cost(null_plan(jobs), workers, sandbox)


def main(words: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*")
    parser.add_argument("-s", "--strategies", nargs="*", default=[])
    parser.add_argument("--null-jobs", type=int, default=NULL_JOBS)
    parser.add_argument("--sandbox", choices=["auto", "require", "off"], default="auto")
    asked = parser.parse_args(words)
    plugins = usable_plugins()
    chosen = asked.strategies or [name for name in plugins.strategies if name != "diagnosed"]
    start_server()
    costs = [null_job(asked.null_jobs, sandbox=asked.sandbox) for _ in range(3)]
    for name in ("parent", "server", "workers", "whole", "wall"):
        least = min(getattr(cost, name) / cost.jobs for cost in costs)
        print(f"null job, {name:8}{1000.0 * least:8.1f} ms")
    spread = statistics.pstdev(1000.0 * cost.whole / cost.jobs for cost in costs)
    print(f"asked for {THIRTY:g} ms; repetitions differ by {spread:.1f} ms")
    plan = plan_run(asked.cases, chosen, plugins, {})
    cost = run_cost(plan, sandbox=asked.sandbox)
    found = solutions(plan)
    print(f"{cost.jobs} jobs, {found.count} eigenvalue solutions of {found.seconds:.1f} s together")
    for name in ("parent", "server", "workers", "whole", "wall"):
        value = getattr(cost, name)
        print(
            f"run, {name:8}{value:8.1f} s {value / found.seconds:6.1f} solutions (asked: {FIVE:g})"
        )


if __name__ == "__main__":
    main()
