"""Jobs on a cluster of Dask: a few at a time are on their way, and what arrives is let go there."""

from __future__ import annotations

import logging
import pickle
import re
import secrets
import shutil
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from itertools import count, islice
from types import ModuleType
from typing import TYPE_CHECKING, Any

from femubench.core.child.sandbox import OFF, Enclosure, enclosure
from femubench.core.display import count_noun
from femubench.core.errors import FemubenchError, InputError, require
from femubench.core.roles import StrategyRole
from femubench.core.run.cluster_worker import (
    Demand,
    Errand,
    UnfitWorker,
    Yardstick,
    all_versions,
    run_errand,
    unfit,
)
from femubench.core.run.jobs import JobOutcome, one_line
from femubench.core.run.provenance import home_of
from femubench.core.run.schedule import Workload
from femubench.core.run.slots import Start
from femubench.core.run.stopping import interrupts_kept
from femubench.core.schema.results import JobResult
from femubench.core.schema.run_options import Sandbox, Where

if TYPE_CHECKING:
    from distributed import Client, Future
    from distributed.deploy.cluster import Cluster

_AHEAD = 2  # jobs on their way a thread, so that none waits for the next one
_ANSWER = 5.0  # s that a scheduler may take to answer, and its first worker to be there
_COUNTED = 2.0  # s that a count of threads is good for
_SLURM_JOBS = 10
_DASHBOARD = "127.0.0.1:0"
_LEAST_AHEAD = 4  # jobs on their way while nobody works
_MOST_CASES = 100  # that are kept on the cluster
# Else each of its processes looks at itself a hundred times a second, which nobody reads here.
_UNWATCHED = {"distributed.worker.profile.enabled": False, "distributed.admin.tick.interval": "1s"}


class DaskWorkers:
    """The workers of a Dask scheduler, each of which runs one job a thread.

    Arguments:
        waits: whether workers may come later, as those of a queue do.
        sandbox: whether strategies run in one; each machine finds out for itself.
    """

    share = None

    def __init__(
        self, client: Client, where: str, *, waits: bool, sandbox: Sandbox = "auto"
    ) -> None:
        self._client, self._where, self._waits = client, where, waits
        self.sandbox: Sandbox = sandbox
        self._demand = Demand((), (), None)

    @property
    def workers(self) -> int:
        """Return the number of threads of all workers that are there."""
        return sum(self._client.nthreads().values())

    @property
    def spoken(self) -> str:
        """Return the number of jobs at a time, and where."""
        return f"{count_noun(self.workers, 'worker')} of {self._where}"

    def admit(self, strategies: Sequence[StrategyRole], memory: int | None) -> None:
        """Make sure that every worker has the versions that are here, and enough memory and cores.

        Raises:
            InputError: naming the first one that has not, or where there is none.
        """
        if not self._waits:
            try:
                self._client.wait_for_workers(1, timeout=_ANSWER)
            except TimeoutError as error:
                what = f"the scheduler at {self._where} has no worker"
                expected = f"one or more: dask worker {self._where}"
                raise InputError(what, expected=expected) from error
        homes = {home_of(strategy)[0] for strategy in strategies}
        packages = tuple(sorted({"femubench", *homes} - {"__main__"}))
        self._demand = Demand(all_versions(packages), packages, memory, self.sandbox)
        found = self._client.run(unfit, self._demand, on_error="return")
        for worker, reason in found.items():
            if reason is not None:
                text = one_line(reason) if isinstance(reason, Exception) else reason
                raise _unlike(f"worker {worker}: {text}")

    def enclosure(self) -> Enclosure:
        """Return how strategies run on the workers: in a sandbox where each of them has one."""
        if self.sandbox != "auto":
            return Enclosure(*(("namespaces",) if self.sandbox == "require" else ("none", OFF)))
        found: Mapping[str, Enclosure] = self._client.run(enclosure, self.sandbox)
        for worker, how in found.items():
            if how.sandbox == "none":
                return replace(how, reason=f"worker {worker}: {how.reason}")
        if not found:
            return Enclosure("none", "no worker is there yet; every result says how it ran")
        return Enclosure("namespaces")

    def compute(self, workload: Workload, wanted: Iterable[int]) -> Iterator[tuple[int, JobResult]]:
        """Yield the result of every wanted job as it comes.

        Raises:
            InputError: where the scheduler is lost, or a worker joined that is not like this
                machine; results that came before stay.
        """
        flight = _Flight(self._client, self._demand, workload)
        counted, threads = -_COUNTED, 0

        def capacity() -> int:
            nonlocal counted, threads
            if time.monotonic() - counted > _COUNTED:
                counted, threads = time.monotonic(), self.workers
            return max(_AHEAD * threads, _LEAST_AHEAD)

        try:
            yield from flight.yield_results(wanted, capacity)
        finally:
            flight.call_off()


def _unlike(what: str) -> InputError:
    return InputError(what, expected="the same installation, a core and memory a thread")


class _Flight:
    """Jobs on their way to workers and back."""

    def __init__(self, client: Client, demand: Demand, workload: Workload) -> None:
        from distributed import as_completed

        self._client, self._demand, self._load = client, demand, workload
        self._name = f"femubench-{secrets.token_hex(4)}"
        self._numbers = count()
        self._places: dict[str, int] = {}
        # What did not come back is tried once more, last and one at a time.
        self._again: set[int] = set()
        self._lonely: list[int] = []
        self._yardsticks: dict[Start, Future[Yardstick]] = {}
        self._coming = as_completed(loop=client.loop, with_results=True, raise_errors=False)

    def yield_results(
        self, wanted: Iterable[int], capacity: Callable[[], int]
    ) -> Iterator[tuple[int, JobResult]]:
        """Yield results as they arrive; a job is made when there is room for it on the way."""
        waiting = iter(wanted)
        while True:
            room = max(capacity() - len(self._places), 0)
            for index in islice(waiting, room):
                yield from self._sent(index)
            if not self._places:
                if not self._lonely:
                    break
                yield from self._sent(self._lonely.pop())
            if self._places:
                future, found = next(self._coming)
                yield from self._taken(future, found)

    def _sent(self, index: int) -> Iterator[tuple[int, JobResult]]:
        """Send a job to the cluster, unless it could not be made."""
        slot = self._load.slots[index]
        if isinstance(slot.code, JobOutcome):
            yield index, self._load.make_unjudged(index, slot.code)
            return
        limits, shown = self._load.limits[slot.strategy], self._load.is_shown(slot)
        errand = Errand(slot.strategy, slot.seed, slot.code, limits, shown)
        key = f"{self._name}-{next(self._numbers)}"
        case = self._case(slot.start)
        future = self._client.submit(run_errand, case, errand, self._demand, key=key, pure=False)
        self._places[key] = index
        self._coming.add(future)

    def _case(self, start: Start) -> Future[Yardstick]:
        """Return the case on the cluster, to which it goes once unless there are very many.

        It is the result of a task, not scattered data: what a worker takes along as it dies can
        be made again. Jobs go seed after seed, so that every case comes up again and again.
        """
        known = self._yardsticks.pop(start, None)
        if known is None or known.status in ("error", "cancelled", "lost"):
            pair = start, self._load.references[start.case.name]
            data = pickle.dumps(pair, protocol=pickle.HIGHEST_PROTOCOL)
            key = f"{self._name}-case-{next(self._numbers)}"
            known = self._client.submit(pickle.loads, data, key=key, pure=False)
        self._yardsticks[start] = known  # the last one used stands last
        if len(self._yardsticks) > _MOST_CASES:
            del self._yardsticks[next(iter(self._yardsticks))]
        return known

    def _taken(self, future: Future[Any], found: Any) -> Iterator[tuple[int, JobResult]]:  # noqa: ANN401
        """Yield the result of a job that came back, unless it is tried again."""
        from distributed.scheduler import KilledWorker

        index, status = self._places.pop(future.key), future.status
        future.release()
        if status == "finished":
            result, exhibit = found
            if self._load.show is not None and exhibit is not None:
                self._load.show(self._load.slots[index], exhibit)
            yield index, result
            return
        fault = found[1] if status == "error" else found
        if isinstance(fault, UnfitWorker):
            raise _unlike(str(fault))
        if status != "error" and self._client.status != "running":
            raise FemubenchError("the scheduler was lost; what was done is kept, for --resume")
        if index not in self._again:
            # It may have been on the worker of a job that ended it.
            self._again.add(index)
            self._lonely.append(index)
            return
        killed = isinstance(fault, KilledWorker)
        reason = "every worker that ran it died" if killed else one_line(fault)
        yield index, self._load.make_unjudged(index, JobOutcome("crashed", reason))

    def call_off(self) -> None:
        """End what is still on its way."""
        left = list(self._coming.futures)
        if left and self._client.status == "running":
            self._client.cancel(left, force=True)
        self._coming.clear()
        self._places.clear()
        self._yardsticks.clear()


@contextmanager
def connect(where: Where) -> Iterator[DaskWorkers]:
    """Give the workers of a scheduler that runs somewhere.

    Its address is ``tcp://HOST:PORT``, or ``tls://`` with certificates in Dask's configuration.

    Raises:
        InputError: where nobody answers there, or for a number of jobs.
    """
    address = str(where.cluster)
    if where.jobs is not None:
        what = "the number of jobs at a time is that of the threads of its workers"
        raise InputError(what, key="cluster", expected="no --jobs with it")
    if not re.fullmatch(r"[a-z]+://[^\s/]+:\d{1,5}", address):
        expected = "tcp://HOST:PORT"
        raise InputError(f"{address!r} is no address", key="cluster", expected=expected)
    with _quiet(), _client(address) as client:
        yield DaskWorkers(client, address, waits=False, sandbox=where.sandbox)


@contextmanager
def start_cluster(where: Where) -> Iterator[DaskWorkers]:
    """Give the workers of a cluster that is started here and ended with the block.

    It is ``local:N``, which says the number of workers, or ``slurm:QUEUE``.

    Raises:
        InputError: for other words, or where it cannot be started.
    """
    words, jobs = str(where.cluster), where.jobs
    rest = words.partition(":")[2]
    queued = words.startswith("slurm:")
    if re.fullmatch(r"local:[1-9]\d{0,3}", words):
        if jobs is not None:
            what = f"{words} tells the number of workers"
            raise InputError(what, key="cluster", expected="no --jobs with it")
        make, jobs = partial(_local, int(rest)), int(rest)
    elif queued and re.fullmatch(r"[\w.,-]+", rest):
        require("dask_jobqueue", "cluster", "--cluster slurm")
        if shutil.which("sbatch") is None:
            what = f"{words} needs sbatch, which is not here"
            raise InputError(what, key="cluster", expected="a machine that submits to Slurm")
        make, jobs = partial(slurm_cluster, rest), jobs or _SLURM_JOBS
    else:
        expected = "local:N, such as local:4, slurm:QUEUE or tcp://HOST:PORT"
        raise InputError(f"{words!r} is no cluster", key="cluster", expected=expected)
    with _quiet(), ExitStack() as stack:
        try:
            cluster = stack.enter_context(make())
        except (OSError, RuntimeError, ValueError, TimeoutError) as error:
            what = f"{words} cannot be started: {one_line(error)}"
            raise InputError(what, key="cluster", expected="machines to run on") from error
        size = {"jobs": jobs} if queued else {"n": jobs}
        scale = partial(cluster.scale, **size)
        scale()
        # A nanny gives up a worker that dies as it starts.
        stack.enter_context(_repeat(scale, _COUNTED))
        client = stack.enter_context(_client(cluster))
        yield DaskWorkers(client, words, waits=queued, sandbox=where.sandbox)


@contextmanager
def _repeat(action: Callable[[], object], seconds: float) -> Iterator[None]:
    """Call a function every so many seconds, in another thread, while the block runs."""
    done = threading.Event()

    def watch() -> None:
        while not done.wait(seconds):
            action()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


_hiding = threading.Lock()
_hidden: list[ModuleType] = []


@contextmanager
def _no_script() -> Iterator[None]:
    """Hide the script or notebook from a worker that starts, which would run it once more."""
    with _hiding:
        _hidden.append(sys.modules["__main__"])
        sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        with _hiding:
            # Blocks of several threads overlap; what the first of them found comes back last.
            script = _hidden.pop()
            if not _hidden:
                sys.modules["__main__"] = script


def _local(count: int) -> Cluster:
    """Start a scheduler in this process and workers, which listen to this machine alone."""
    from distributed import LocalCluster, Nanny

    class SilentNanny(Nanny):  # type: ignore[misc]
        """Starts its worker, also in place of one that died, without the user's script."""

        async def instantiate(self) -> Any:  # noqa: ANN401 - a distributed.Status
            # An interrupt is for the process that has the cluster: one that meets a worker while
            # it imports would print its traceback. The thread of the loop handles no signal.
            if hasattr(signal, "pthread_sigmask"):  # not on Windows
                signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            with _no_script():
                return await super().instantiate()

    return LocalCluster(
        n_workers=count,
        threads_per_worker=1,
        host="127.0.0.1",
        worker_class=SilentNanny,
        dashboard_address=_DASHBOARD,
        silence_logs=logging.CRITICAL,
        scheduler_kwargs={"allowed_failures": 1},
    )


def slurm_cluster(queue: str) -> Cluster:
    """Return a cluster that has no Slurm job yet.

    What ``jobqueue.yaml`` says under ``jobqueue.slurm`` holds; a core and 2 GiB a job where it
    says nothing.

    Arguments:
        queue: the partition.
    """
    import dask

    with interrupts_kept():
        from dask_jobqueue import SLURMCluster

    own = {"cores": 1, "processes": 1, "memory": "2GiB"}
    missing = {
        key: value
        for key, value in own.items()
        if dask.config.get(f"jobqueue.slurm.{key}", None) is None
    }
    known = dask.config.get("jobqueue.slurm.scheduler-options", None) or {}
    return SLURMCluster(
        queue=queue,
        scheduler_options={"dashboard_address": _DASHBOARD, **known},
        silence_logs=logging.CRITICAL,
        **missing,
    )


@contextmanager
def _client(address: str | Cluster) -> Iterator[Client]:
    """Give a client of a scheduler; raises InputError where nobody answers."""
    from distributed import Client

    try:
        client = Client(address, timeout=_ANSWER, set_as_default=False)
    except (OSError, TimeoutError, ValueError, ImportError) as error:
        what = f"no scheduler of Dask answers at {address}"
        raise InputError(what, key="scheduler", expected="one that runs: dask scheduler") from error
    try:
        yield client
    finally:
        client.close()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what Dask mutters of lost workers to itself: a run tells of its jobs, whole or not."""
    import dask
    import distributed  # noqa: F401 - sets the levels that are changed here

    # The second has a level of its own.
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    # What an interrupt keeps from being awaited is collected later than here.
    warnings.filterwarnings("ignore", ".* never awaited", RuntimeWarning, "distributed")
    try:
        with dask.config.set(_UNWATCHED), warnings.catch_warnings():
            # Versions are compared here, where a difference is an error.
            warnings.filterwarnings("ignore", module="distributed")
            yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)
