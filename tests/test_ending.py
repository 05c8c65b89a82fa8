"""A run that ends early shows what there is, what is missing, and the command that goes on."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from femubench.core.cli import outputs
from femubench.core.cli.ending import INTERRUPTED, UNFINISHED, resuming
from femubench.core.errors import FemubenchError, OutputError
from femubench.core.run import runner
from femubench.core.run.executor import LocalProcesses
from femubench.core.run.stopping import stopping
from femubench.core.run.store import Store
from femubench.core.schema.results import JobResult
from tests.command import call_bench

RUN = ("run", "frame", "-s", "unchanged", "-s", "baruch", "-j", "1")
JOBS = 4  # two nominal models


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[JobResult]:
    """The results of the run when nothing happens to it."""
    folder = tmp_path_factory.mktemp("whole")
    call_bench(*RUN, "--store", folder)
    return list(Store(folder).load().results)


@pytest.fixture(autouse=True)
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run_until(
    happens: Callable[[], object], after: int, monkeypatch: pytest.MonkeyPatch, *words: str
) -> Result:
    """Run in this process; something happens once some results are in the store."""
    plain = LocalProcesses.compute

    def compute(self: LocalProcesses, *given: Any) -> Iterator[tuple[int, JobResult]]:
        for number, one in enumerate(plain(self, *given), start=1):
            yield one
            if number == after:
                happens()

    monkeypatch.setattr(LocalProcesses, "compute", compute)
    result = call_bench(*words or RUN, code=None)
    monkeypatch.undo()
    return result


def lost() -> None:
    raise FemubenchError("the scheduler was lost")


def broken() -> None:
    raise ZeroDivisionError("a fault of ours")


def full() -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "results.jsonl")


def pressed() -> None:
    signal.raise_signal(signal.SIGINT)


CAUSES = {
    "broken": (broken, UNFINISHED, "bench: a fault of ours"),
    "full": (full, UNFINISHED, "bench: [Errno 28] No space left on device: 'results.jsonl'"),
    "pressed": (pressed, INTERRUPTED, "bench: interrupted"),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_the_board_so_far_and_the_command_that_goes_on(
    cause: str, monkeypatch: pytest.MonkeyPatch, whole: list[JobResult], tmp_path: Path
) -> None:
    happens, code, reason = CAUSES[cause]
    monkeypatch.chdir(tmp_path)
    result = run_until(happens, 2, monkeypatch)
    monkeypatch.chdir(tmp_path)
    assert result.exit_code == code
    assert "strategy" in result.stdout
    assert f"2 of {JOBS} jobs are there" in result.stdout
    *_, stated, last = result.stderr.splitlines()
    assert stated == reason
    done, _, command = last.partition("; to go on: ")
    assert done == f"bench: 2 of {JOBS} jobs are done"
    assert ("Traceback" in result.stderr) is (cause == "broken")
    call_bench(*command.split()[1:])
    store = Store("femubench-results")
    assert len(store.runs()) == 1
    kept = ("case", "strategy", "nominal", "status", "blocks", "gain", "rank")
    found = [[getattr(one, name) for name in kept] for one in store.load().results]
    assert found == [[getattr(one, name) for name in kept] for one in whole]


def test_what_ends_before_the_run_begins_is_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "begin_run", lambda *_: lost())
    result = call_bench(*RUN, code=None)
    assert (result.exit_code, result.stderr) == (1, "bench: the scheduler was lost\n")


@pytest.mark.parametrize(
    ("words", "command"),
    [
        (["run", "my case", "--overwrite", "always"], "bench run 'my case' --resume"),
        (["run", "--overwrite=missing", "-j", "2"], "bench run -j 2 --resume"),
        (["run", "--seeds", "5", "--resume"], "bench run --resume"),
        (["run", "--store", "a;b"], "bench run --store 'a;b' --resume"),
    ],
)
def test_the_command_that_goes_on(words: list[str], command: str) -> None:
    assert resuming(words, ["--resume"], ["--overwrite", "--seeds"]) == command


def test_once_finishes_what_is_running_and_twice_stops() -> None:
    def jobs() -> Iterator[int]:
        for job in range(10):
            if job == 3:
                signal.raise_signal(signal.SIGINT)
            yield job

    taken: list[int] = []

    def drained() -> None:
        with stopping() as stop:
            taken.extend(stop.until(jobs()))
            taken.append(-1)

    def stopped() -> None:
        with stopping():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
            taken.append(-2)

    with pytest.raises(KeyboardInterrupt):
        drained()
    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert taken == [0, 1, 2, -1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_pressed_when_no_job_is_left_nothing_is_interrupted() -> None:
    with stopping() as stop:
        assert list(stop.until([1, 2])) == [1, 2]
        signal.raise_signal(signal.SIGINT)


def test_a_thread_and_other_handlers_are_left_alone() -> None:
    seen: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: seen.append(number))
    try:
        with stopping() as stop:
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (seen, stop.asked) == ([signal.SIGINT], False)

    def in_thread() -> None:
        with stopping() as found:
            seen.append(len(list(found.until([1]))))

    thread = threading.Thread(target=in_thread)
    thread.start()
    thread.join()
    assert seen[1:] == [1]


def test_a_report_that_cannot_be_written_keeps_nobody_from_the_ranking(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plain = outputs.write_atomically

    def write(path: Path, content: str | bytes) -> None:
        if path.suffix in (".html", ".json"):
            raise OutputError(path, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
        plain(path, content)

    monkeypatch.setattr(outputs, "write_atomically", write)
    result = call_bench(*RUN, "--json", "r.json", code=1)
    assert "strategy" in result.stdout
    (page,) = Path().rglob("*.md")
    assert "strategy" in page.read_text(encoding="utf-8")
    first, second = result.stderr.splitlines()
    assert first == "bench: r.json: cannot be written: No space left on device"
    assert second.endswith(".html: cannot be written: No space left on device")


def can_mount() -> bool:
    words = ["unshare", "-Urm", "mount", "-t", "tmpfs", "none", "/mnt"]
    return bool(shutil.which("unshare")) and subprocess.run(words, check=False).returncode == 0


@pytest.mark.slow(5)
@pytest.mark.skipif(not can_mount(), reason="no user namespaces to mount a small disk in")
@pytest.mark.parametrize(
    ("kib", "code", "stated"),
    [
        (110, UNFINISHED, "a record cannot be written"),
        pytest.param(200, 1, "html: cannot be written", marks=pytest.mark.nightly),
    ],
)
def test_a_disk_that_is_full(kib: int, code: int, stated: str, tmp_path: Path) -> None:
    """A real one: too small for the results, or for the report."""
    (tmp_path / "disk").mkdir()
    script = f'mount -t tmpfs -o size={kib}k none disk && exec "$0" "$@"'
    words = [sys.executable, "-m", "femubench", *RUN, "--seeds", "3", "--store", "disk"]
    done = subprocess.run(
        ["unshare", "-Urm", "sh", "-c", script, *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code
    # Lines of progress come after 10 s, which a busy machine needs.
    lines = [line for line in done.stderr.splitlines() if not line.endswith(" left")]
    first, *rest = lines
    assert first.startswith("bench: disk/")
    assert stated in first
    assert "No space left on device" in first
    assert "strategy" in done.stdout
    if code == UNFINISHED:
        assert "; to go on: bench run frame" in rest[-1]


def test_links_that_lead_back_to_themselves_are_said(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    result = call_bench("publish", "loop", "x", code=2)
    what = "loop: is a link that leads back to itself (expected a file or a folder)"
    assert result.stderr == f"bench: {what}\n"
