"""The process from which workers fork: what it has loaded, and when another takes its place."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import harness_toys as toys
import pytest
from loaded_modules import loaded, variables

from femubench.core.child import server, workers
from femubench.core.child.guarded_child import Ending
from femubench.core.child.limits import Limits
from femubench.core.run.preload import own_plugins


def answer(pool: workers.Workers[int], ask: Callable[[Any], bytes] = loaded) -> list[str]:
    """Return the modules that a worker has before it imports any for its task."""
    assert pool.start(1, ask, None, Limits(60.0)) is None
    ended: list[tuple[int, Ending]] = []
    while not ended:
        ended = pool.wait()
    return ended[0][1].answer.decode().split()


def test_workers_start_with_what_comes_along_and_with_nothing_of_others() -> None:
    assert toys.__name__ in sys.modules  # of the process that asks, and of no worker
    with workers.Workers[int](1).open() as pool:
        modules = set(answer(pool))
    assert set(own_plugins()) <= modules
    assert {"scipy.linalg", "femubench.core.score.scoring"} <= modules
    third_parties = {toys.__name__, "pytest", "matplotlib", "pandas", "femubench.core.run.runner"}
    assert not third_parties & modules


@pytest.mark.slow(20)  # servers of other tests are reaped here
def test_a_server_of_an_older_source_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    with workers.Workers[int](1).open():
        first = server.fork_server()
    with workers.Workers[int](1).open():
        assert server.fork_server() is first
    monkeypatch.setattr(first, "source", "as it was before")
    with workers.Workers[int](1).open() as pool:
        assert server.fork_server() is not first
        assert not first.alive
        assert "femubench.core.run.judging" in answer(pool)


@pytest.mark.slow(20)  # it ends a server, and is charged what others ran in it
def test_a_server_that_starts_does_not_hear_ctrl_c() -> None:
    """A terminal sends it to all; its imports would end in a traceback."""
    server.end_server()
    fork = server.fork_server()
    for _ in range(20):
        os.kill(fork.process.pid, signal.SIGINT)
    (ending,) = workers.run_apart({1: (bytes, b"here")}, Limits(60.0), 1).values()
    assert ending.answer == b"here"
    assert server.fork_server() is fork
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    mask = (
        next(
            line
            for line in Path(f"/proc/{fork.process.pid}/status").read_text().splitlines()
            if "SigBlk" in line
        )
        if sys.platform == "linux"
        else "SigBlk: 0"
    )
    assert int(mask.split()[1], 16) == 0


def test_children_have_one_thread_and_their_parent_keeps_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.setenv("FEMUBENCH_TEST", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    with workers.Workers[int](1).open() as pool:
        found = dict(line.split("=", 1) for line in answer(pool, variables))
    assert found["FEMUBENCH_TEST"] == "7"
    assert found["OMP_NUM_THREADS"] == found["MKL_NUM_THREADS"] == "1"
    assert os.environ["OMP_NUM_THREADS"] == "3"
    assert "MKL_NUM_THREADS" not in os.environ
