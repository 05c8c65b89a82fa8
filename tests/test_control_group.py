"""Which of the two counts memory: a control group where one is delegated, else this process."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import hoards
import pytest

from femubench.core.child import control_group
from femubench.core.child.control_group import delegated, put_in_group, was_full
from femubench.core.child.limits import MIB, Limits
from femubench.core.child.workers import run_apart
from femubench.core.run.executor import LocalProcesses

SCOPE = delegated()
needed = pytest.mark.skipif(
    SCOPE is None, reason="none is delegated: systemd-run --user --scope -p Delegate=yes make test"
)


@pytest.fixture
def scope(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder in place of the control group of this process."""
    own, made = tmp_path / "cgroup", tmp_path / "run.scope"
    made.mkdir()
    own.write_text("1:cpu:/elsewhere\n0::/run.scope\n")
    (made / "cgroup.procs").write_text(f"{os.getpid()}\n")
    monkeypatch.setattr(control_group, "_OWN", own)
    monkeypatch.setattr(control_group, "_ROOT", tmp_path)
    delegated.cache_clear()
    yield made
    delegated.cache_clear()


def test_memory_is_counted_unless_a_group_is_delegated(scope: Path) -> None:
    """The folder has none of the files of a control group but those that are written here."""
    assert delegated() is None
    assert [path.name for path in scope.iterdir()] == ["cgroup.procs"]
    assert LocalProcesses(2).spoken == "2 workers, memory counted twice a second"
    try:
        os.setxattr(scope, "user.delegate", b"1")
    except OSError:
        pytest.skip("files have no attributes of users here")
    delegated.cache_clear()
    assert delegated() == scope
    assert (scope / "cgroup.subtree_control").read_text() == "+memory"
    assert (scope / "femubench" / "cgroup.procs").read_text() == str(os.getpid())
    assert LocalProcesses(1).spoken == "1 worker, memory limited by control groups"
    group = put_in_group(7, MIB)
    assert group == scope / f"femubench-{os.getpid()}-7"
    for name, written in {"cgroup.procs": "7", "memory.max": str(MIB), "oom.group": "1"}.items():
        assert next(group.glob(f"*{name}")).read_text() == written
    (group / "memory.events").write_text("low 0\nmax 3\noom 1\noom_kill 2\noom_group_kill 1\n")
    assert was_full(group)
    (group / "memory.events").write_text("low 0\nmax 3\noom 1\noom_kill 0\n")
    assert not was_full(group)


@needed
@pytest.mark.slow(5)
def test_a_full_group_ends_its_job_and_is_removed() -> None:
    assert SCOPE is not None
    limits = Limits(120.0, 64 * MIB, sandbox="off")
    for hoard, how in ((hoards.in_sockets, "memory"), (hoards.in_none, "answer")):
        ending = run_apart({0: (hoard, 5.0)}, limits, 1)[0]
        assert ending.how == how, ending
        assert not list(SCOPE.glob("femubench-*"))
