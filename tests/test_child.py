"""Children where the system refuses something, where they go on and on, and where a start fails."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import psutil
import pytest

from femubench.core.child import guarded_child, sandbox, server, workers
from femubench.core.child.confinement import Confinement
from femubench.core.child.guarded_child import GuardedChild
from femubench.core.child.limits import Limits
from femubench.core.plugin import apart

sys.path.insert(0, str(Path(__file__).parent / "toys"))
import children

needed = pytest.mark.skipif(sandbox.missing() is not None, reason=f"{sandbox.missing()}")
LIGHT = "femubench.core.child.limits"
# Root of a namespace of users without these rights may make another, and not write its map.
WITHOUT = ("unshare", "--map-root-user", "setpriv", "--bounding-set")
NO_MAP, NO_RAISE = "-setfcap,-sys_admin", "-sys_resource"


def called(*launcher: str) -> list[Any]:
    """Return what a process with fewer rights says of a call in a child, and of the sandbox."""
    code = f"""
import json
from femubench.core.child import sandbox, workers
from femubench.core.errors import InputError
ending = workers.call_apart(str.encode, "beam", 60.0, 2**31, {LIGHT!r})
try:
    required = sandbox.enclosure("require").sandbox
except InputError as error:
    required = str(error)
print(json.dumps([ending.answer.decode(), sandbox.enclosure("auto").reason, required]))
"""
    done = subprocess.run(
        [*launcher, sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return list(json.loads(done.stdout))


@pytest.mark.slow(10)
@needed
def test_where_the_map_of_users_is_refused_there_is_no_namespace() -> None:
    """As on Ubuntu 24.04: unshare succeeds, and what it gave is good for nothing."""
    answer, reason, required = called(*WITHOUT, NO_MAP, "--")
    assert answer == "beam"
    assert reason == "write of /proc/self/uid_map: Operation not permitted"
    assert required.startswith(f"sandbox: no sandbox: {reason} (expected ")
    assert "\n" not in required


@pytest.mark.slow(10)
@needed
def test_a_limit_that_is_lower_already_stays() -> None:
    lower = ("prlimit", "--nproc=511:511")
    assert called(*WITHOUT, NO_RAISE, "--", *lower)[0] == "beam"
    task = (children.lowered, (100, 500))
    (ending,) = workers.run_apart({1: task}, Limits(60.0), 1, LIGHT).values()
    assert json.loads(ending.answer) == [100, 500]


@needed
def test_a_question_to_a_plugin_has_a_namespace_without_the_sandbox(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sandbox, "missing", lambda: "there is none in this test")
    question = {"do": "children:namespace", "origin": ["x", "x", "x 1.0"]}
    outside = children.namespace()
    for found in apart.ask([question, {**question, "walled": True}], 60.0):
        assert found.keys() == outside.keys()
        assert found != outside


@pytest.mark.slow(10)
def test_a_call_in_a_child_leaves_the_folders_of_its_callers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with workers.Workers[int](1, LIGHT).open() as pool:
        ending = workers.call_apart(children.call_again, str(tmp_path), 60.0, 2**31, LIGHT)
        how, reason, left = json.loads(ending.answer)
        assert (how, reason) == ("answer", "")
        assert pool._root.name in left
        assert len(left) == 2
    assert list(tmp_path.iterdir()) == []


def test_folders_of_dead_processes_are_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    dead, elsewhere = (tmp_path / f"femubench-{2**30}-{name}" for name in ("dead", "elsewhere"))
    dead.mkdir()
    elsewhere.mkdir()
    with workers._locked(elsewhere), workers._scratch_root() as own:
        assert set(tmp_path.iterdir()) == {elsewhere, own}


@pytest.fixture
def silent() -> Iterator[GuardedChild]:
    """A child that sleeps, of which its server says nothing."""
    status, said = os.pipe()
    os.set_blocking(status, False)
    with subprocess.Popen(["sleep", "900"], start_new_session=True) as sleeper:
        limits = Limits(1.0, output=2**36)
        yield GuardedChild(sleeper.pid, -1, -1, -1, status, Confinement(limits, ()), limits)
        sleeper.kill()
    os.close(said)


def test_output_without_end_does_not_keep_a_limit_on_time_from_it(silent: GuardedChild) -> None:
    silent.output = os.open("/dev/zero", os.O_RDONLY)  # its next byte is always there
    silent._ready = silent._started - 2.0
    ending = silent.progress(look=False)
    silent.kill()
    assert ending is not None
    assert (ending.how, ending.reason) == ("timeout", "no result within 1 s")


def test_waiting_for_the_end_of_a_child_has_an_end(
    silent: GuardedChild, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where what it left starts others faster than they end."""
    status = silent.status
    clock = 0.0

    def pass_time(*_: object) -> tuple[list[int], list[int], list[int]]:
        nonlocal clock
        clock += 1.0
        assert clock < 1000.0, "it waits for ever"
        return [], [], []

    monkeypatch.setattr(guarded_child, "time", SimpleNamespace(monotonic=lambda: clock))
    monkeypatch.setattr(guarded_child, "select", SimpleNamespace(select=pass_time))
    silent.kill()
    silent.bury()
    assert clock > 0.0
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(status)


class TestDescriptors:
    """As many are open after a failed start as before it."""

    @pytest.fixture
    def start(self) -> Any:
        server.fork_server()
        confinement = Confinement(Limits(), server.search_path())
        return lambda: GuardedChild.start(confinement, LIGHT)

    @staticmethod
    def count() -> int:
        return psutil.Process().num_fds()

    @pytest.mark.parametrize("after", [0, 3])
    def test_where_there_are_no_more_pipes(
        self, start: Any, after: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        before, plain = self.count(), os.pipe
        pipes = iter([plain] * after)

        def few() -> tuple[int, int]:
            for pipe in pipes:
                return pipe()
            raise OSError(24, "Too many open files")

        monkeypatch.setattr(os, "pipe", few)
        with pytest.raises(OSError, match="Too many open files"):
            start()
        assert self.count() == before

    def test_where_no_server_starts(self, start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        def refuse() -> None:
            raise OSError("no server")

        before = self.count()
        monkeypatch.setattr(guarded_child, "fork_server", refuse)
        with pytest.raises(OSError, match="no server"):
            start()
        assert self.count() == before

    @pytest.mark.slow(20)  # a server that other tests used is reaped here
    def test_where_a_server_takes_nothing(
        self, start: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(*_: object) -> None:
            raise BrokenPipeError

        before = self.count()
        monkeypatch.setattr(server.ForkServer, "ask", refuse)
        with pytest.raises(BrokenPipeError):
            start()
        assert self.count() == before - 1  # that of the server, which was ended

    def test_where_an_argument_cannot_be_sent(self) -> None:
        server.fork_server()
        before = self.count()
        with (
            pytest.raises((AttributeError, TypeError), match="pickle"),
            workers.Workers[int](1, LIGHT).open() as pool,
        ):
            pool.start(1, bytes, lambda: b"", Limits())
        assert self.count() == before
