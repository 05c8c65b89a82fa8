"""Where the jobs of a run go: worker processes of this machine, or machines of a cluster."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from femubench.core.child.limits import Limits, memory_share
from femubench.core.child.sandbox import Enclosure, Sandbox, enclosure
from femubench.core.display import counted
from femubench.core.errors import InputError, require
from femubench.core.roles import Strategy
from femubench.core.run.schedule import Show, computed
from femubench.core.run.slots import Slot
from femubench.core.schema.results import JobResult
from femubench.core.score.scoring import Reference


class Executor(Protocol):
    """What runs jobs, each in a process of its own, and judges what they hand back in another."""

    @property
    def workers(self) -> int:
        """Return how many jobs run at a time, as far as is known now."""

    @property
    def spoken(self) -> str:
        """Return what a user reads of it, such as ``2 workers``."""

    @property
    def share(self) -> int | None:
        """Return the bytes that a job may take; None where each machine has its own answer."""

    @property
    def sandbox(self) -> Sandbox:
        """Return whether strategies run in a sandbox."""

    def enclosure(self) -> Enclosure:
        """Return how strategies run: in a sandbox, or why not.

        Raises:
            InputError: where one is required and is not possible.
        """

    def admit(self, strategies: Sequence[Strategy], memory: int | None) -> None:
        """Make sure that jobs of these strategies with so much memory each can run.

        Raises:
            InputError: telling where they cannot, and why.
        """

    def computed(
        self,
        slots: Sequence[Slot],
        wanted: Iterable[int],
        references: Mapping[str, Reference],
        limits: Mapping[str, Limits],
        show: Show | None = None,
    ) -> Iterator[tuple[int, JobResult]]:
        """Yield the result of every wanted slot as it comes.

        Arguments:
            wanted: places of slots; the next is asked for when there is room for it.
            limits: by strategy.
            show: takes the exhibit of a job of the first seed, before its result comes.
        """


@dataclass(frozen=True)
class LocalProcesses:
    """Worker processes of this machine.

    Arguments:
        workers: number of them.
        sandbox: whether strategies run in one.
    """

    workers: int
    sandbox: Sandbox = "auto"

    @property
    def spoken(self) -> str:
        """Return the number of workers in words."""
        return counted(self.workers, "worker")

    @property
    def share(self) -> int:
        """Return an even share of the machine's memory in bytes."""
        return memory_share(self.workers)

    def enclosure(self) -> Enclosure:
        """Return how strategies run on this machine."""
        return enclosure(self.sandbox)

    def admit(self, strategies: Sequence[Strategy], memory: int | None) -> None:
        """Find nothing to object to: the workers are copies of this process."""

    def computed(
        self,
        slots: Sequence[Slot],
        wanted: Iterable[int],
        references: Mapping[str, Reference],
        limits: Mapping[str, Limits],
        show: Show | None = None,
    ) -> Iterator[tuple[int, JobResult]]:
        """Yield the result of every wanted slot as it comes."""
        yield from computed(slots, wanted, references, limits, self.workers, show)


@contextmanager
def executor_of(
    jobs: int | None = None,
    scheduler: str | None = None,
    cluster: str | None = None,
    sandbox: Sandbox = "auto",
) -> Iterator[Executor]:
    """Give what runs jobs: worker processes here, unless a scheduler or a cluster is named.

    Arguments:
        jobs: number of worker processes, None for that of the processors; with ``slurm:QUEUE``
            that of the Slurm jobs.
        scheduler: address of a Dask scheduler, ``tcp://HOST:PORT``.
        cluster: one to start, ``local:N`` or ``slurm:QUEUE``.
        sandbox: strategies run in one where that is possible, ``auto``; or ``require``, ``off``.

    Raises:
        InputError: for both, for words that mean neither, or where nobody answers.
    """
    if scheduler is None and cluster is None:
        yield LocalProcesses(worker_count(jobs), sandbox)
        return
    if scheduler is not None and cluster is not None:
        what = "--scheduler and --cluster are two places for the same jobs"
        raise InputError(what, expected="one of them")
    require("distributed", "cluster", f"--{'cluster' if scheduler is None else 'scheduler'}")
    from femubench.core.run.cluster import connected, started

    if scheduler is not None:
        opened = connected(scheduler, jobs, sandbox)
    else:
        opened = started(str(cluster), jobs, sandbox)
    with opened as executor:
        yield executor


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
