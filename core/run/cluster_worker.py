"""What runs in a worker of Dask: one job after the other, each in processes of its own."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

from threadpoolctl import threadpool_limits

from femubench.core.child.limits import LEAST, Limits, count_processors, format_bytes, memory_share
from femubench.core.child.sandbox import enclosure, missing
from femubench.core.errors import FemubenchError
from femubench.core.run.jobs import JobOutcome
from femubench.core.run.provenance import blas_name, cpu_name, package_version, versions
from femubench.core.run.schedule import Processes, Workload, compute_jobs, open_processes
from femubench.core.run.slots import Slot, Start
from femubench.core.schema.results import JobResult
from femubench.core.schema.run_options import Sandbox
from femubench.core.score.scoring import Reference


class UnfitWorker(FemubenchError):  # noqa: N818 - a fact about a machine
    """A worker on which jobs would end otherwise than here; the text says why."""


@dataclass(frozen=True)
class Demand:
    """What a worker must have.

    Arguments:
        versions: names and versions, from `all_versions`.
        packages: of those, the packages that strategies are imported from.
        memory: bytes that one job may take; None for a share of what the worker has.
        sandbox: whether strategies run in one.
    """

    versions: tuple[tuple[str, str], ...]
    packages: tuple[str, ...]
    memory: int | None
    sandbox: Sandbox = "auto"


@dataclass(frozen=True)
class Errand:
    """One job on its way to a worker, without its case.

    Arguments:
        strategy, seed, code: of the `Slot`.
        limits: on the job; a worker puts its own share where there is none on memory.
        shown: whether the exhibit of the result is wanted too.
    """

    strategy: str
    seed: int
    code: bytes | JobOutcome
    limits: Limits
    shown: bool


Yardstick = tuple[Start, Reference]
Arrived = tuple[JobResult, Mapping[str, Any] | None]


def all_versions(packages: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """Return names and versions of Python, of what results depend on, and of more packages.

    Arguments:
        packages: names; their version has a digest of their source.
    """
    own = {name: package_version(name) for name in packages}
    return tuple({**versions("distributed"), **own}.items())


def unfit(demand: Demand, dask_worker: Any) -> str | None:  # noqa: ANN401 - a distributed.Worker
    """Return why a worker cannot run the jobs, None where it can."""
    found = dict(all_versions(demand.packages))
    there = [
        f"{name} {found[name]} there and {version} here"
        for name, version in demand.versions
        if found[name] != version
    ]
    if there:
        return ", ".join(there)
    lacking = missing() if demand.sandbox == "require" else None
    if lacking is not None:
        return f"no sandbox: {lacking}"
    threads, cores = dask_worker.state.nthreads, count_processors()
    if threads > cores:
        return f"{threads} threads on {cores} cores, and every job takes a core"
    memory = dask_worker.memory_manager.memory_limit
    needed = LEAST if demand.memory is None else demand.memory
    if memory and needed * threads > memory:
        room = format_bytes(memory / threads)
        return f"{room} of memory a thread, and a job may take {format_bytes(needed)}"
    return None


def run_errand(yardstick: Yardstick, errand: Errand, demand: Demand) -> Arrived:
    """Return the result of a job and its exhibit.

    Raises:
        UnfitWorker: where this worker joined late and is not like the others.
    """
    from distributed import get_worker
    from distributed.worker import thread_state

    worker, key = get_worker(), thread_state.key
    processes = _THREAD.processes_for(demand, worker)

    def wanted() -> None:
        """End a job that nobody waits for any more."""
        task = worker.state.tasks.get(key)
        if task is None or task.state == "cancelled" or worker.status.name != "running":
            raise UnfitWorker(f"worker {worker.address} is closing, or its job was called off")

    start, reference = yardstick
    name, limits = errand.strategy, errand.limits
    if limits.memory is None:
        share = memory_share(worker.state.nthreads, worker.memory_manager.memory_limit)
        limits = replace(limits, memory=share)
    slots, references = [Slot(start, name, errand.seed, errand.code)], {start.case.name: reference}
    exhibits: list[Mapping[str, Any]] = []
    show = (lambda _, exhibit: exhibits.append(exhibit)) if errand.shown else None
    workload = Workload(slots, references, {name: limits}, show)
    ((_, result),) = compute_jobs(workload, [0], 1, wanted, processes)
    how = {"cpu": cpu_name(), "blas": blas_name(), "sandbox": enclosure(limits.sandbox).sandbox}
    return replace(result, provenance=how), exhibits[0] if exhibits else None


class _Thread(threading.local):
    """The processes of a thread, in which one job after the other of a run is done."""

    def __init__(self) -> None:
        self._open = ExitStack()
        self._demand: Demand | None = None
        atexit.register(self._open.close)

    def processes_for(self, demand: Demand, worker: Any) -> Processes:  # noqa: ANN401
        """Return them, started anew for another run: that may have other sources."""
        if demand != self._demand:
            reason = unfit(demand, worker)
            if reason is not None:
                raise UnfitWorker(f"worker {worker.address}: {reason}")
            threadpool_limits(1)
            self._open.close()
            self._demand, self._processes = demand, self._open.enter_context(open_processes(1))
        return self._processes


_THREAD = _Thread()
