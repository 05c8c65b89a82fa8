"""What runs in a worker process: bytes in, bytes out, so that nothing can fail in between."""

from __future__ import annotations

import os
import pickle
import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

from femubench.core.harness.jobs import Job, JobOutcome, execute, one_line

_THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)

_EXIT_INSIDE_A_JOB = 70


@contextmanager
def single_threaded_environment() -> Iterator[None]:
    """Set the thread counts that processes started meanwhile inherit; restore them afterwards."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def prepare() -> None:
    """Pin a fresh worker process to one BLAS thread and load what every job needs.

    Loading here keeps imports out of the first job's time limit.
    """
    # Ctrl-C goes to the whole foreground group; it is the parent that stops the workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _take_children_along()
    import scipy.linalg
    import scipy.optimize
    import scipy.sparse.linalg  # noqa: F401 - loaded for its threads and its time
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    _leave_visibly()


def _take_children_along() -> None:
    """Let the end of a worker that is told to stop be that of the processes it started, too."""
    os.setpgrp()
    signal.signal(signal.SIGTERM, lambda *_: os.killpg(0, signal.SIGKILL))


def _leave_visibly() -> None:
    """Let a strategy's own exit never have code 0, which the pool takes for an idle worker's."""
    leave = os._exit

    def leave_visibly(status: int) -> NoReturn:
        leave(status or _EXIT_INSIDE_A_JOB)

    os._exit = leave_visibly


def run_in_worker(job: Job) -> bytes:
    """Return the pickled outcome of a job; an outcome that cannot be pickled has failed."""
    outcome = execute(job)
    try:
        return pickle.dumps(outcome, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        reason = f"the result cannot be sent back: {one_line(error)}"
        failed = JobOutcome("failed", reason, traceback.format_exc(), outcome.seconds)
        return pickle.dumps(failed, protocol=pickle.HIGHEST_PROTOCOL)
