"""What the benchmarks are run on: the built-in frame, and the same frame on finer meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits

from femubench.core.case.case import Case
from femubench.core.case.reader import read_case
from femubench.core.fem.frame import Frame


@pytest.fixture(scope="session", autouse=True)
def one_thread() -> Iterator[None]:
    """Keep linear algebra to one thread, as the harness does."""
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="session")
def case() -> Case:
    """Return the scenario of the first paper's frame, 81 dofs."""
    return read_case(Path(str(files("femubench.scenarios") / "frame")))


@pytest.fixture(scope="session")
def refined(case: Case) -> Callable[[int], Frame]:
    """Return the frame with a given number of elements a member, 21 dofs for each of them."""
    frame = case.model.frame_structure.frame

    def build(elements: int) -> Frame:
        members = tuple(replace(member, elements=elements) for member in frame.members)
        return replace(frame, members=members)

    return build
