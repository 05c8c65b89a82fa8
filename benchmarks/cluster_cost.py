"""What a cluster costs around jobs: the processor time of null jobs, of scheduler and of workers.

    python benchmarks/cluster_cost.py [--jobs 200] [--workers 1 2] [--wait 0.33]

All but the work of a job itself is in the process of `bench run`, with the scheduler in it, and in
the workers, which are processes of this machine here; what a worker forks for a job is counted
apart. The first gives how many jobs a second the scheduler can feed, and so how many workers at the
mean of the jobs of a board. Every run follows one that starts what the workers need.

With `--wait` the jobs wait for that long instead, as if each worker had a machine of its own, and
the seconds of the whole run are printed, from the start of the cluster to its end.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import psutil
from run_cost import null_plan

from femubench import Measurement, Model, UpdateResult, rank
from femubench.core.run.cluster import start_cluster
from femubench.core.run.executor import Executor
from femubench.core.run.runner import Plan
from femubench.core.schema.run_options import Where

BOARD = Path(__file__).parents[1] / "docs" / "figures" / "board-suite.json"
AHEAD = 8  # jobs of the run before, at most


class Waiting:
    """Return the model that was given, some time later."""

    name = "waiting"
    citation = "none: it stands for a job that another machine computes"

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Wait, and change nothing."""
        time.sleep(self.seconds)
        return UpdateResult(model)


def time_waiting(jobs: int, seconds: float, workers: int) -> float:
    """Return the seconds that a run of jobs takes each of which waits for `seconds`."""
    start = time.perf_counter()
    rank("frame", Waiting(seconds), seeds=jobs, nominal="drawn", cluster=f"local:{workers}")
    return time.perf_counter() - start


def _seconds() -> tuple[float, float, float]:
    """Return the processor time of this process, of the workers, and of what these started."""
    own = psutil.Process()
    found = [sum(own.cpu_times()[:2]), 0.0, 0.0]
    for worker in own.children():
        for process in (worker, *worker.children(recursive=True)):
            times = process.cpu_times()
            found[1 + (process != worker)] += times.user + times.system
            found[2] += times.children_user + times.children_system
    return found[0], found[1], found[2]


def cost_of(plan: Plan, place: Executor) -> list[float]:
    """Return the processor time of a run in ms a job: scheduler, workers, what they started."""
    before = _seconds()
    jobs = len(plan.run(place).results)
    return [1e3 * (b - a) / jobs for a, b in zip(before, _seconds(), strict=True)]


def main(words: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=200)
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--wait", type=float, help="seconds that a job waits for")
    asked = parser.parse_args(words)
    if asked.wait:
        for workers in asked.workers:
            taken = time_waiting(asked.jobs, asked.wait, workers)
            print(f"{workers} workers: {asked.jobs} jobs of {asked.wait:g} s in {taken:.1f} s")
        return
    mean = statistics.fmean(one["seconds"] for one in json.loads(BOARD.read_text())["results"])
    for workers in asked.workers:
        with start_cluster(Where(cluster=f"local:{workers}")) as place:
            null_plan(min(AHEAD, asked.jobs) * workers).run(place)
            scheduler, around, within = cost_of(null_plan(asked.jobs), place)
        print(
            f"{workers} workers: scheduler {scheduler:.1f}, around a job on its worker "
            f"{around:.1f}, the job and its judge {within:.1f} ms; one scheduler feeds "
            f"{1e3 / scheduler:.0f} jobs/s: {1e3 * mean / scheduler:.0f} workers "
            f"at {mean:.2g} s a job"
        )


if __name__ == "__main__":
    main()
