"""The process from which workers fork: what it has loaded, and when another takes its place."""

from __future__ import annotations

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
