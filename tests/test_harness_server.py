"""The process from which workers fork: what it has loaded, and when another takes its place."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest

from femubench.core.run import workers
from femubench.core.run.limits import Limits
from femubench.core.run.preload import own_plugins

sys.path.insert(0, str(Path(__file__).parent / "toys"))
import harness_toys as toys
from loaded_modules import loaded


def answer(pool: workers.Workers[int]) -> list[str]:
    """Return the modules that a worker has before it imports any for its task."""
    assert pool.start(1, loaded, None, Limits(60.0)) is None
    ended: list[tuple[int, workers.Ending]] = []
    while not ended:
        ended = pool.wait()
    return ended[0][1].answer.decode().split()


def test_workers_start_with_what_comes_along_and_with_nothing_of_strangers() -> None:
    assert toys.__name__ in sys.modules  # of the process that asks, and of no worker
    with workers.Workers[int](1).open() as pool:
        modules = set(answer(pool))
    assert set(own_plugins()) <= modules
    assert {"scipy.linalg", "femubench.core.score.scoring"} <= modules
    strangers = {toys.__name__, "pytest", "matplotlib", "pandas", "femubench.core.run.runner"}
    assert not strangers & modules


def test_a_server_of_an_older_source_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    with workers.Workers[int](1).open():
        first = workers._server()
    with workers.Workers[int](1).open():
        assert workers._server() == first
    monkeypatch.setattr(workers, "_source", "as it was before")
    with workers.Workers[int](1).open() as pool:
        assert workers._server() != first
        assert "femubench.core.run.judging" in answer(pool)


def test_a_server_that_starts_does_not_hear_ctrl_c() -> None:
    """A terminal sends it to all; its imports would end in a traceback."""
    workers._end_server()
    workers._server_mark()
    server = workers._server()
    assert server is not None
    for _ in range(20):
        os.kill(server, signal.SIGINT)
    process = workers.forked(_nothing)
    process.join(60.0)
    assert process.exitcode == 0
    assert workers._server() == server
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    mask = (
        next(
            line
            for line in Path(f"/proc/{server}/status").read_text().splitlines()
            if "SigBlk" in line
        )
        if sys.platform == "linux"
        else "SigBlk: 0"
    )
    assert int(mask.split()[1], 16) == 0


def test_whoever_imports_what_the_server_loads_hears_ctrl_c() -> None:
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def _nothing() -> None:
    pass
