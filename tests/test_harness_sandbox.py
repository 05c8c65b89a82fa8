"""What a strategy finds that looks everywhere: in the sandbox nothing, without it what is there."""

from __future__ import annotations

import fcntl
import json
import os
import re
import secrets
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import harness_toys as toys
import hoards
import psutil
import pytest
import scanner
import zoo
from running import run_jobs

import femubench
from femubench.core.child import guarded_child, sandbox, server, syscall_filter
from femubench.core.child.guarded_child import Ending
from femubench.core.child.limits import MIB, Limits
from femubench.core.child.sandbox import Enclosure, enclosure, walls_around
from femubench.core.child.workers import Workers, run_apart
from femubench.core.errors import InputError
from femubench.core.run import cluster_worker
from femubench.core.run.executor import LocalProcesses
from femubench.core.schema.results import JobResult
from femubench.core.schema.run_options import Sandbox
from tests.command import call_bench

needed = pytest.mark.skipif(sandbox.missing() is not None, reason=f"{sandbox.missing()}")


def scanned(mode: Sandbox, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[JobResult, str]:
    """Plant a word that nobody knows everywhere; return what a scanner says that looks for it."""
    word = f"{scanner.HEAD}{secrets.token_hex(8)}"
    case = folder / "case"
    case.mkdir()
    (case / "case.toml").write_text(f'[case]\nname = "{word}"\n')
    (case / "modes.csv").write_text(f"mode,frequency\n1,{word}\n")
    monkeypatch.setenv("FEMUBENCH_PLANTED", word)
    held = [word.encode() * 1000]
    server.end_server()  # it has the environment from when it was started
    with Served(word) as port:
        strategy = scanner.Scanner(port, os.getpid(), scanner.digest_of(word))
        run = run_jobs(
            [replace(toys.tiny_case(), folder=case)],
            [strategy],
            timeout=200.0,
            executor=LocalProcesses(1, mode),
        )
    assert held
    server.end_server()
    assert run.meta["sandbox"] == ("none" if mode == "off" else "namespaces")
    return run.results[0], word


class Served:
    """A server on this machine that tells a word to everybody who calls."""

    def __init__(self, word: str) -> None:
        self._socket, self._word = socket.create_server(("127.0.0.1", 0)), word

    def __enter__(self) -> int:
        threading.Thread(target=self._answer, daemon=True).start()
        return int(self._socket.getsockname()[1])

    def _answer(self) -> None:
        with suppress(OSError):
            while True:
                caller, _ = self._socket.accept()
                with caller:
                    caller.sendall(self._word.encode())

    def __exit__(self, *_: object) -> None:
        self._socket.close()


@pytest.mark.slow(40)
@needed
def test_a_scanner_finds_nothing_in_the_sandbox(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, _ = scanned("require", tmp_path, monkeypatch)
    assert (result.status, result.reason) == ("ok", "")
    assert result.provenance["sandbox"] == "namespaces"


@pytest.mark.nightly
def test_the_same_scanner_finds_what_was_planted_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, word = scanned("off", tmp_path, monkeypatch)
    assert result.status == "failed"
    for place in ("disk", "environment", "network"):
        assert f"{place}: {word}" in result.reason
    scope = Path("/proc/sys/kernel/yama/ptrace_scope")
    if os.geteuid() == 0 or not scope.exists() or scope.read_text().strip() == "0":
        assert f"memory: {word}" in result.reason
    assert result.provenance["sandbox"] == "none"


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without namespaces."""
    monkeypatch.setattr(sandbox, "missing", lambda: "this machine has none")


def test_where_there_is_none_a_run_says_so_once(
    nowhere: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["run", "frame", "-s", "unchanged", "-j1", "--json", "run.json"]
    done = call_bench(*words)
    assert done.stderr == "strategies run without a sandbox: this machine has none\n"
    kept = json.loads(Path("run.json").read_text())
    assert kept["meta"]["sandbox"] == "none"
    assert kept["meta"]["sandbox_reason"] == "this machine has none"
    # The mark stands at the rank, and the reason in what is kept.
    assert "^" in done.stdout.partition("unchanged")[0]
    (report,) = Path("femubench-results").glob("*.md")
    assert "ran without a sandbox (this machine has none)" in report.read_text()
    assert "| =^ | unchanged |" in report.read_text().replace("\\", "")


def test_a_quiet_run_says_what_its_ranks_lack(nowhere: None, tmp_path: Path) -> None:
    words = ["run", "frame", "-s", "unchanged", "-q", "-j1", "--store", str(tmp_path / "s")]
    done = call_bench(*words, code=None)
    assert done.stdout == ""
    assert done.stderr.splitlines() == [
        "bench: no twins ran, so that memory of the cases is not excluded",
        "bench: strategies ran without a sandbox (this machine has none) and could read what they "
        "were not given",
    ]


def test_one_that_is_required_and_missing_is_wrong_input(
    nowhere: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["run", "frame", "-s", "unchanged", "--sandbox", "require"]
    done = call_bench(*words, code=None)
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "no sandbox: this machine has none" in done.stderr


def test_modes_and_machines() -> None:
    assert enclosure("off") == Enclosure("none", sandbox.OFF)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sandbox, "missing", lambda: None)
        assert enclosure("auto") == enclosure("require") == Enclosure("namespaces")
        patch.setattr(sandbox, "missing", lambda: "why")
        assert enclosure("auto") == Enclosure("none", "why")
        with pytest.raises(InputError, match="no sandbox: why"):
            enclosure("require")


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ({"platform": "darwin"}, "namespaces are of Linux"),
        ({"release": "5.4.0-generic"}, "Linux 5.4.0-generic is older than 5.14"),
        ({"machine": "riscv64"}, "the system calls of riscv64 are not known"),
    ],
)
def test_why_there_is_none(
    where: dict[str, str], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in where.items():
        if name == "platform":
            monkeypatch.setattr(sys, name, value)
        else:
            monkeypatch.setattr(f"platform.{name}", lambda value=value: value)
    found = sandbox.missing()
    assert found is not None
    assert found.startswith(said)


@needed
def test_a_machine_that_refuses_says_what(monkeypatch: pytest.MonkeyPatch) -> None:
    walls = sandbox.Walls(("/no/such/folder",))
    monkeypatch.setattr(sandbox, "walls_around", lambda _: walls)
    sandbox._tried.cache_clear()
    try:
        found = sandbox.missing()
    finally:
        sandbox._tried.cache_clear()
    assert found is not None
    assert found.startswith("mount of ")
    assert found.endswith("/no/such/folder: No such file or directory")


class TestWalls:
    def test_code_is_there_and_data_is_not(self) -> None:
        walls = walls_around(())
        package = Path(femubench.__file__).parent
        assert _sees(walls, package / "core" / "run" / "jobs.py")
        assert _sees(walls, (package / "core").resolve() / "errors.py")
        for data in ("scenarios", "papers"):
            for folder in (package / data, (package / data).resolve()):
                assert not _sees(walls, folder / "frame" / "case.toml")
        clone = (package / "core").resolve().parent
        for name in ("docs", "benchmarks", "examples", ".git"):
            assert not _sees(walls, clone / name / "index.md")
        assert not _sees(walls, Path.home() / ".bash_history")

    def test_of_a_folder_on_the_search_path_what_can_be_imported(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for name in ("own.py", "package/__init__.py", "package/part.py", "plain/part.py"):
            _made(tmp_path / name)
        for name in ("modes.csv", "case/case.toml", "plain/case/case.toml", "package/c/case.toml"):
            _made(tmp_path / name)
        monkeypatch.syspath_prepend(str(tmp_path))
        walls = walls_around((str(tmp_path / "package" / "c"),))
        for name in ("own.py", "package/part.py", "plain/part.py"):
            assert _sees(walls, tmp_path / name), name
        for name in ("modes.csv", "case/case.toml", "plain/case/case.toml", "package/c/case.toml"):
            assert not _sees(walls, tmp_path / name), name

    def test_a_case_with_code_in_it_is_not_shown_for_its_code(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        _made(tmp_path / "__init__.py")
        _made(tmp_path / "case.toml")
        monkeypatch.syspath_prepend(str(tmp_path))
        assert not _sees(walls_around((str(tmp_path),)), tmp_path / "case.toml")

    def test_data_are_hidden_under_every_name_of_a_folder(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """An environment shows its lib as lib64 too; a project may be reached through a link."""
        site = tmp_path / "env/lib/python3.11/site-packages"
        for name in ("femubench/scenarios/frame/modes.csv", "femubench/core/errors.py"):
            _made(site / name)
        (tmp_path / "env/lib64").symlink_to("lib")
        _made(tmp_path / "project/package/__init__.py")
        _made(tmp_path / "project/package/case/case.toml")
        (tmp_path / "linked").symlink_to("project")
        monkeypatch.setattr(sys, "prefix", str(tmp_path / "env"))
        monkeypatch.syspath_prepend(str(tmp_path / "linked"))
        walls = walls_around((str(tmp_path / "project/package/case"),))
        other = tmp_path / "env/lib64/python3.11/site-packages"
        assert _sees(walls, tmp_path / "linked/package/__init__.py")
        assert not _sees(walls, tmp_path / "linked/package/case/case.toml")
        for place in (site, other):
            assert _sees(walls, place / "femubench/core/errors.py")
            assert not _sees(walls, place / "femubench/scenarios/frame/modes.csv")


@needed
def test_the_first_process_leads_to_nothing_outside() -> None:
    """A strategy of the same user may follow its folder, whatever root it has itself."""
    with Workers[int](1).open() as pool:
        limits = Limits(60.0, 400 * MIB, sandbox="require")
        assert pool.start(1, scanner.ready_and_waiting, None, limits) is None
        ((_, child),) = pool._running
        until = time.monotonic() + 30.0
        while not (child._printed or time.monotonic() > until):
            pool.wait()
        inside = guarded_child.processes_of(child.pid, child.first)
        assert len(inside) == 2
        for process in inside:
            home = Path(f"/proc/{process.pid}")
            assert Path(os.readlink(home / "cwd")) in (Path("/"), Path("/own"))
            assert os.path.samefile(home / "cwd/..", home / "root")


@needed
def test_a_job_sees_nothing_of_another_within_the_same_walls() -> None:
    limits = Limits(60.0, 400 * MIB, sandbox="require")
    with Workers[int](2).open() as pool:
        own = ended(scanner.leave_traces, limits, "end", pool).answer.decode()
        # Where code is shown that lies in /tmp, that is no other name of its own folder.
        assert own.replace("/tmp/left, ", "") == (
            "/own/left, module, variable, process, socket of family 2, socket of family 1"
        )
        assert ended(scanner.seen_traces, limits, None, pool).answer == b""
        assert pool.start(2, scanner.leave_traces, "stay", limits) is None
        ((_, stays),) = pool._running
        while not stays._printed:
            assert pool.wait() == []
        seen = ended(scanner.seen_traces, limits, None, pool)
        assert (seen.how, seen.answer) == ("answer", b"")
        assert len(pool._servers) == 1
        assert stays.alive
    assert not psutil.pid_exists(stays.first)


@needed
def test_jobs_start_again_when_what_has_raised_their_walls_was_ended() -> None:
    limits = Limits(60.0, 400 * MIB, sandbox="require")
    with Workers[int](1).open() as pool:
        assert pool.start(1, scanner.ready_and_waiting, None, limits) is None
        ((_, child),) = pool._running
        (walled,) = {psutil.Process(number).ppid() for number in (child.pid, child.first)}
        os.kill(walled, signal.SIGKILL)
        found: list[tuple[int, Ending]] = []
        while not found:
            found = pool.wait()
        assert [(key, ending.how) for key, ending in found] == [(1, "orphaned")]
        missed = pool.start(2, bytes, b"", limits)
        assert missed is not None
        assert missed.how == "no-start"
        assert ended(bytes, limits, b"here", pool).answer == b"here"


@needed
def test_what_has_raised_walls_ends_with_who_asked_and_says_nothing() -> None:
    code = """
import os
from femubench.core.child.limits import Limits
from femubench.core.child.workers import Workers
with Workers(1, Limits.__module__).open() as pool:
    assert pool.start(1, bytes, b"", Limits(60.0, sandbox="require")) is None
    os.kill(os.getpid(), 9)
"""
    # The output has ended when nobody has it open any more.
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=120.0)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, b"")


@needed
def test_devices_and_sockets_of_the_machine_are_out_of_reach() -> None:
    ending = ended(scanner.reached_outside, Limits(60.0, 400 * MIB, sandbox="require"))
    assert (ending.how, ending.answer) == ("answer", b"")


def _made(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("")


def _sees(walls: sandbox.Walls, path: Path) -> bool:
    shown, hidden = (
        any(path.is_relative_to(f) for f in part) for part in (walls.shown, walls.hidden)
    )
    return shown and not hidden


def ended(
    function: object, limits: Limits, argument: object = None, among: Workers[int] | None = None
) -> Ending:
    with nullcontext(among) if among else Workers[int](1).open() as pool:
        assert pool.start(1, function, argument, limits) is None  # type: ignore[arg-type]
        found: list[tuple[int, Ending]] = []
        while not found:
            found = pool.wait()
    return found[0][1]


@pytest.mark.parametrize("mode", ["require", "off"])
def test_more_processes_than_allowed_end_a_job(mode: Sandbox) -> None:
    if mode == "require" and sandbox.missing() is not None:
        pytest.skip("no sandbox here")
    limits = Limits(60.0, 400 * MIB, processes=12, sandbox=mode)
    ending = ended(scanner.many_processes, limits, 20)
    # As another user than root the system refuses the processes before anybody counts them.
    assert (ending.how, ending.reason[:4]) == ("memory", "has ") or b"Errno 11" in ending.answer


@needed
def test_no_namespace_and_no_process_is_left_when_a_worker_is_killed() -> None:
    before = _namespaces()
    for _ in range(3):
        limits = Limits(1.5, 400 * MIB, sandbox="require")
        assert ended(scanner.sleeping_family, limits, os.getpid()).how == "timeout"
    assert _namespaces() <= before
    assert list(zoo.leftovers()) == []


def _namespaces() -> set[str]:
    """Return the namespaces of processes that this one and those below it are in."""

    def found() -> Iterator[str]:
        own = psutil.Process()
        for process in (own, *own.children(recursive=True)):
            with suppress(OSError):
                yield os.readlink(f"/proc/{process.pid}/ns/pid")

    return set(found())


def test_a_worker_of_a_cluster_without_one_is_refused_where_it_is_required(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cluster_worker, "missing", lambda: "why")
    there = SimpleNamespace(
        state=SimpleNamespace(nthreads=1), memory_manager=SimpleNamespace(memory_limit=0)
    )
    found = {
        mode: cluster_worker.unfit(cluster_worker.Demand((), (), None, mode), there)
        for mode in ("require", "auto", "off")
    }
    assert found == {"require": "no sandbox: why", "auto": None, "off": None}


def test_the_numbers_of_refused_calls_are_those_of_the_kernel() -> None:
    folder = Path("/usr/include")
    headers = {
        "x86_64": sorted(folder.glob("*/asm/unistd_64.h")),
        "aarch64": sorted(folder.glob("asm-generic/unistd.h")),
    }
    for machine, found in headers.items():
        if not found:
            pytest.skip(f"no header of Linux for {machine}")
        known = dict(re.findall(r"#define __NR(?:3264)?_(\w+)\s+(\d+)", found[0].read_text()))
        _, judged, own = syscall_filter._OWN[machine]
        looked_at = dict(zip(("clone", "prctl", "socket", "socketpair"), judged, strict=True))
        for name, number in {**own, **syscall_filter._COMMON, **looked_at}.items():
            assert int(known[name]) == number, (machine, name)


@needed
@pytest.mark.slow(10)
@pytest.mark.parametrize(
    ("hoard", "how"),
    [(hoards.in_sockets, "memory"), (hoards.in_waiting_sockets, "memory"),
     (hoards.in_none, "answer")],
)  # fmt: skip
def test_memory_of_sockets_counts(
    hoard: Callable[[float], bytes], how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guarded_child, "put_in_group", lambda *_: None)
    limits = Limits(120.0, 64 * MIB, sandbox="require")
    ending = run_apart({0: (hoard, 1.5)}, limits, 1)[0]
    assert ending.how == how, ending
    assert ending.reason.startswith("used ") == (how == "memory")


def test_memory_of_pipes_and_sockets_is_that_of_who_has_them_open() -> None:
    here = [psutil.Process()]
    before = guarded_child.memory_of(here, None)
    reads, writes = os.pipe()
    one, other = socket.socketpair()
    try:
        fcntl.fcntl(writes, fcntl.F_SETPIPE_SZ, MIB)
        sent = one.send(bytes(2**16))
        after = guarded_child.memory_of(here, None)
        # Another thread may hold something now that it did not hold before.
        assert after - before > MIB + sent - 2**15
    finally:
        os.close(reads)
        os.close(writes)
        one.close()
        other.close()


@needed
def test_a_strategy_from_a_folder_on_the_path_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As that of an editable clone below home does, whose other files are not there."""
    project = tmp_path / "project"
    project.mkdir()
    code = "from harness_toys import Unchanged\n\n\nclass Mine(Unchanged):\n    name = 'mine'\n"
    (project / "own_strategy.py").write_text(code)
    monkeypatch.syspath_prepend(str(project))
    import own_strategy  # type: ignore[import-not-found]

    executor = LocalProcesses(1, "require")
    run = run_jobs([toys.tiny_case()], [own_strategy.Mine()], executor=executor)
    assert [result.status for result in run.results] == ["ok"]
