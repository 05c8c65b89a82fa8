"""Where the jobs of a run go: worker processes of this machine, or machines of a cluster."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from femubench.core.child.control_group import delegated
from femubench.core.child.limits import count_processors, memory_share
from femubench.core.child.sandbox import Enclosure, enclosure
from femubench.core.display import count_noun
from femubench.core.errors import InputError, require
from femubench.core.roles import StrategyRole
from femubench.core.run.schedule import Workload, compute_jobs
from femubench.core.schema.results import JobResult
from femubench.core.schema.run_options import Sandbox, Where

if TYPE_CHECKING:
    from femubench.core.run.cluster import DaskWorkers


Executor: TypeAlias = "LocalProcesses | DaskWorkers"


@dataclass(frozen=True)
class LocalProcesses:
    """Worker processes of this machine, each job in one of its own, and judged in another.

    Arguments:
        sandbox: whether strategies run in one.
    """

    workers: int
    sandbox: Sandbox = "auto"

    @property
    def spoken(self) -> str:
        """Return the number of workers, and how their memory is limited, in words."""
        how = "counted twice a second" if delegated() is None else "limited by control groups"
        return f"{count_noun(self.workers, 'worker')}, memory {how}"

    @property
    def share(self) -> int:
        """Return an even share of the machine's memory in bytes."""
        return memory_share(self.workers)

    def enclosure(self) -> Enclosure:
        """Return how strategies run: in a sandbox, or why not.

        Raises:
            InputError: where one is required and is not possible.
        """
        return enclosure(self.sandbox)

    def admit(self, strategies: Sequence[StrategyRole], memory: int | None) -> None:
        """Find nothing to object to: the workers are copies of this process."""

    def compute(self, workload: Workload, wanted: Iterable[int]) -> Iterator[tuple[int, JobResult]]:
        """Yield the result of every wanted job as it comes.

        Arguments:
            wanted: places of jobs; the next is asked for when there is room for it.
        """
        yield from compute_jobs(workload, wanted, self.workers)


def open_executor(where: Where) -> AbstractContextManager[Executor]:
    """Give what runs jobs: worker processes here, unless a cluster is named.

    Raises:
        InputError: for words that mean no cluster, or where nobody answers.
    """
    if where.cluster is None:
        return nullcontext(LocalProcesses(count_workers(where.jobs), where.sandbox))
    require("distributed", "cluster", "--cluster")
    from femubench.core.run.cluster import connect, start_cluster

    return connect(where) if "://" in where.cluster else start_cluster(where)


def count_workers(jobs: int | None) -> int:
    """Return the number of worker processes: that of the processors where none is given.

    Raises:
        InputError: for less than one.
    """
    if jobs is None:
        return count_processors()
    if jobs < 1:
        raise InputError(f"{jobs} worker processes", key="jobs", expected="1 or more")
    return jobs
