"""Jobs on the workers of Dask: equal to those of this machine, whatever dies on the way."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil
import pytest
from running import run_jobs

from femubench import FemubenchError, InputError
from femubench.core import errors
from femubench.core.run import cluster
from femubench.core.run.cluster import DaskWorkers, slurm_cluster
from femubench.core.run.executor import LocalProcesses, open_executor
from femubench.core.schema.run_options import Where
from femubench.results import JobResult, Store

sys.path.insert(0, str(Path(__file__).parent / "toys"))
import harness_toys as toys

pytestmark = pytest.mark.slow(40)

JOBS = 200  # of the run with two kills; 10 000 in `make nightly`
ROOT = Path(__file__).parents[1]
QUIET = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}


def stable(results: Any) -> list[JobResult]:
    """Return results without what differs from run to run."""
    return [replace(item, seconds=0.0) for item in results]


@pytest.fixture(scope="module")
def two() -> Iterator[DaskWorkers]:
    with open_executor(Where(cluster="local:2")) as executor:
        assert isinstance(executor, DaskWorkers)
        yield executor


@pytest.fixture
def open_two(two: DaskWorkers, monkeypatch: pytest.MonkeyPatch) -> DaskWorkers:
    """The same without a sandbox: strategies tell of themselves in files, and end their workers."""
    monkeypatch.setattr(two, "sandbox", "off")
    return two


def pids_of(executor: DaskWorkers) -> list[int]:
    return list(executor._client.run(os.getpid).values())


def check_kills(executor: DaskWorkers, jobs: int, folder: Path) -> None:
    """Run jobs, kill a worker twice meanwhile, and compare with a run on this machine."""
    cases = [toys.tiny_case(), toys.tiny_case("other", 80.0e9)]
    runs, file = {}, folder / "stated"
    victims: list[int] = []

    def kill(result: JobResult, done: int, total: int) -> None:
        if done in (total // 4, total // 2):
            victims.append(pids_of(executor)[0])
            os.kill(victims[-1], signal.SIGKILL)

    here = LocalProcesses(2, "off")
    for name, place, progress in (("cluster", executor, kill), ("serial", here, None)):
        runs[name] = run_jobs(
            cases,
            [toys.OnAdvance(str(file))],
            seeds=range(jobs // 2),
            store=Store(folder / name),
            executor=place,
            progress=progress,
        )
        if place is executor:
            # What was on its way to a killed worker, and no other job, is done again.
            assert jobs <= len(file.read_text().splitlines()) <= jobs + 2 * 2 * cluster._AHEAD
    assert len(set(victims)) == 2
    assert [item.status for item in runs["cluster"].results] == jobs * ["ok"]
    stored = {name: Store(folder / name).load().results for name in runs}
    assert stable(stored["cluster"]) == stable(stored["serial"])
    assert stable(runs["cluster"].results) == stable(runs["serial"].results)


@pytest.mark.nightly
def test_a_run_whose_workers_are_killed_twice_ends_like_one_of_this_machine(
    open_two: DaskWorkers, tmp_path: Path
) -> None:
    check_kills(open_two, JOBS, tmp_path)


@pytest.mark.nightly
def test_ten_thousand_jobs_with_two_kills(open_two: DaskWorkers, tmp_path: Path) -> None:
    check_kills(open_two, 10_000, tmp_path)


@pytest.mark.nightly
def test_a_job_that_ends_its_workers_is_crashed_and_the_others_are_not(
    open_two: DaskWorkers,
) -> None:
    strategies = [toys.Unchanged(), toys.Murderous(), toys.Softer()]
    run = run_jobs([toys.tiny_case()], strategies, executor=open_two, seeds=(0,))
    found = {item.strategy: (item.status, item.reason) for item in run.results}
    assert found == {
        "unchanged": ("ok", ""),
        "murderous": ("crashed", "every worker that ran it died"),
        "softer": ("ok", ""),
    }


def test_jobs_end_as_they_end_here(two: DaskWorkers) -> None:
    """Failures, limits and strategies without a module of their own."""
    strategies = [toys.Failing(), toys.Exiting(-9), toys.Looping(), toys.Unsendable()]
    cases = [toys.tiny_case()]
    there, here = (
        run_jobs(cases, strategies, timeout=1.0, jobs=2, executor=place) for place in (two, None)
    )
    assert stable(there.results) == stable(here.results)


def test_the_walls_of_a_worker_stay_for_the_jobs_that_follow(two: DaskWorkers) -> None:
    def servers(at: str) -> list[int]:
        from femubench.core.run.cluster_worker import _THREAD

        workers, _ = _THREAD._processes
        return [id(server) for server in workers._servers.values() if server.alive]

    found = []
    for seeds in (range(4), range(4, 8)):
        run_jobs([toys.tiny_case()], [toys.Unchanged()], executor=two, seeds=seeds)
        there = list(two._client.nthreads())
        asked = [two._client.submit(servers, at, workers=[at], pure=False) for at in there]
        found.append(two._client.gather(asked))
    assert found[0] == found[1]
    assert all(len(own) == 1 for own in found[0])


def test_a_worker_that_is_not_like_this_machine_is_said_in_one_line(
    two: DaskWorkers, monkeypatch: pytest.MonkeyPatch
) -> None:
    strategies = [toys.Unchanged()]
    with pytest.raises(InputError, match=r"^worker tcp://127.* of memory a thread, and a job may"):
        two.admit(strategies, 2**60)
    known = cluster.all_versions

    def older(packages: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
        changed = {"numpy": "1.0", "harness_toys": "0+abc"}
        return tuple((name, changed.get(name, version)) for name, version in known(packages))

    with monkeypatch.context() as patch:
        patch.setattr(cluster, "all_versions", older)
        with pytest.raises(InputError) as stated:
            two.admit(strategies, None)
    text = r"worker tcp://\S+: numpy \S+ there and 1.0 here, harness_toys \S+ there and 0\+abc here"
    assert re.match(text, str(stated.value))
    # One that joins after the others were looked at.
    late, demand = DaskWorkers(two._client, "", waits=False), two._demand
    monkeypatch.setattr(late, "admit", lambda *_: setattr(late, "_demand", demand))
    with pytest.raises(InputError, match=r"numpy .* there and 1\.0 here"):
        run_jobs([toys.tiny_case()], strategies, executor=late)


def listening(process: psutil.Process) -> set[str]:
    """Return the addresses on which a process and those below it wait for third parties."""
    found = set()
    for one in (process, *process.children(recursive=True)):
        listed = [c for c in one.net_connections("inet") if c.status == psutil.CONN_LISTEN]
        found |= {connection.laddr.ip for connection in listed}
    return found


def test_a_local_cluster_listens_to_this_machine_alone(two: DaskWorkers) -> None:
    assert listening(psutil.Process()) == {"127.0.0.1"}


SCRIPT = """
import sys
sys.path.insert(0, {toys!r})
import harness_toys as toys
from femubench.core.run.executor import open_executor
from running import run_jobs
from femubench.core.run.store import Store
from femubench.core.schema.run_options import Where

with open_executor(Where(cluster="local:2")) as executor:
    strategies = [toys.Unchanged(), toys.Looping()]
    store, cases = Store({store!r}), [toys.tiny_case()]
    run_jobs(cases, strategies, store=store, executor=executor)
"""


def test_an_interrupted_run_keeps_what_is_done_and_leaves_nothing_behind(tmp_path: Path) -> None:
    """A script without a main guard, which no worker runs again."""
    store, script = Store(tmp_path / "store"), tmp_path / "script.py"
    toys_folder = str(Path(toys.__file__).parent)
    script.write_text(SCRIPT.format(toys=toys_folder, store=str(store.folder)))
    command = [sys.executable, str(script)]
    quiet = subprocess.Popen(
        command, env=QUIET, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    with quiet as process, ExitStack() as ended:
        below: list[psutil.Process] = []
        stated: list[str] = [""]
        ended.callback(process.kill)  # leaving the block waits for it
        until = time.monotonic() + 120.0
        while process.poll() is None and time.monotonic() < until:
            if any(result.status == "ok" for result in store.by_key().values()):
                below = psutil.Process(process.pid).children(recursive=True)
                # As a terminal does it; the second is for the job that never ends.
                assert process.stderr is not None
                os.killpg(process.pid, signal.SIGINT)
                stated = [process.stderr.readline(), process.stderr.readline()]
                os.killpg(process.pid, signal.SIGINT)
                break
            time.sleep(0.2)
        _, text = process.communicate(timeout=60.0)
    assert process.returncode == -signal.SIGINT
    assert stated[-1].startswith("bench: finishing the jobs that are running")
    assert text.strip().splitlines()[-1] == "KeyboardInterrupt"
    assert "distributed" not in re.sub(r'File "[^"]*"', "", text)
    assert below
    assert psutil.wait_procs(below, timeout=10.0)[1] == []
    run = store.load()
    assert run.meta["interrupted"]
    assert [item.strategy for item in run.results] == ["unchanged"]


@pytest.mark.nightly
def test_workers_that_a_user_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """``dask scheduler`` and ``dask worker`` by hand, and the scheduler lost in the end."""
    file = tmp_path / "scheduler.json"
    plain = ["--scheduler-file", str(file), "--host", "127.0.0.1", "--no-dashboard"]
    environment = {**QUIET, "PYTHONPATH": f"{ROOT}:{Path(toys.__file__).parent}"}
    options: dict[str, Any] = {"env": environment, "cwd": tmp_path, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0"]
    scheduler = subprocess.Popen([*dask, *plain], **options)
    worker = None
    try:
        while not file.exists():
            time.sleep(0.1)
        address = re.findall(r'"(tcp://[^"]*)"', file.read_text())[0]
        monkeypatch.setattr(cluster, "_ANSWER", 1.0)
        there = Where(cluster=address)
        with open_executor(there) as place, pytest.raises(InputError, match="no worker"):
            run_jobs([toys.tiny_case()], [toys.Unchanged()], executor=place)
        monkeypatch.setattr(cluster, "_ANSWER", 60.0)
        dask = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "2"]
        worker = subprocess.Popen([*dask, *plain], **options)

        def end(result: JobResult, done: int, total: int) -> None:
            if done == 4:
                scheduler.kill()

        with open_executor(there) as place:
            top = psutil.Process(worker.pid)
            strategies = [toys.Unchanged(), toys.Looping()]
            first = run_jobs([toys.tiny_case()], strategies[:1], seeds=range(3), executor=place)
            assert place.workers == 2
            idle = {child.pid for child in top.children(recursive=True)}
            with pytest.raises(KeyboardInterrupt):
                run_jobs([toys.tiny_case()], strategies, executor=place, progress=interrupt)
            until = time.monotonic() + 20.0
            while idle != {child.pid for child in top.children(recursive=True)}:
                assert time.monotonic() < until  # the job that runs has 600 s
                time.sleep(0.2)
            store = Store(tmp_path / "store")
            with pytest.raises(FemubenchError, match="the scheduler was lost"):
                run_jobs(
                    [toys.tiny_case()],
                    strategies,
                    seeds=range(6),
                    executor=place,
                    store=store,
                    progress=end,
                    timeout=1.0,
                )
        assert [item.status for item in first.results] == ["ok", "ok", "ok"]
        assert len(store.load().results) >= 4
    finally:
        for process in (scheduler, worker):
            if process is not None:
                process.kill()
                process.wait()


def interrupt(result: JobResult, done: int, total: int) -> None:
    raise KeyboardInterrupt


SUBMIT = """#!/bin/sh
script=$(cat "$1")  # as sbatch does: the file goes as soon as this returns
setsid sh -c "$script" >/dev/null 2>&1 &
echo "Submitted batch job $!"
"""
CANCEL = """#!/bin/sh
kill -9 -- "-$1"
"""


@pytest.mark.nightly
def test_jobs_of_a_stand_in_for_slurm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its `sbatch` runs a job script at once; one of the two jobs is taken away."""
    for name, text in (("sbatch", SUBMIT), ("scancel", CANCEL)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}:{Path(toys.__file__).parent}")
    strategies = [toys.Unchanged(), toys.Softer()]
    options: dict[str, Any] = {"seeds": range(20), "jobs": 2}
    killed: list[int] = []

    def kill(result: JobResult, done: int, total: int) -> None:
        if done == 10:
            killed.append(next(iter(place._client.run(os.getppid).values())))
            os.killpg(os.getpgid(killed[0]), signal.SIGKILL)

    with open_executor(Where(2, cluster="slurm:short")) as place:
        assert isinstance(place, DaskWorkers)
        run = run_jobs([toys.tiny_case()], strategies, **options, executor=place, progress=kill)
    assert killed
    plain = run_jobs([toys.tiny_case()], strategies, **options)
    assert stable(run.results) == stable(plain.results)


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        ({"cluster": "tcp://a"}, r"'tcp://a' is no address \(expected tcp://HOST:PORT\)"),
        ({"cluster": "tcp://127.0.0.1:9"}, "no scheduler of Dask answers at tcp://127.0.0.1:9"),
        ({"cluster": "local:0"}, r"'local:0' is no cluster \(.* slurm:QUEUE or tcp://HOST:PORT\)"),
        ({"cluster": "local"}, "'local' is no cluster"),
        ({"cluster": "local:2", "jobs": 2}, "local:2 tells the number of workers"),
        ({"cluster": "tcp://a:1", "jobs": 2}, "that of the threads of its workers"),
        ({"cluster": "slurm:short"}, "slurm:short needs sbatch, which is not here"),
    ],
)
def test_words_that_mean_no_cluster(
    words: dict[str, Any], stated: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "_ANSWER", 0.5)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(InputError, match=stated) as error, open_executor(Where(**words)):
        pass
    assert "\n" not in str(error.value)


def test_without_the_extra_one_line_tells_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(errors, "find_spec", lambda name: None)
    stated = r"--cluster needs distributed \(expected pip install 'femubench\[cluster\]'\)"
    with pytest.raises(InputError, match=stated), open_executor(Where(cluster="local:2")):
        pass


def test_what_is_submitted_to_slurm() -> None:
    import dask

    with slurm_cluster("short") as queue:
        lines = queue.job_script().splitlines()
    assert {"#SBATCH -p short", "#SBATCH --cpus-per-task=1", "#SBATCH --mem=2G"} <= set(lines)
    assert "--nthreads 1 --memory-limit 2.00GiB" in lines[-1]
    own = {f"jobqueue.slurm.{key}": value for key, value in (("cores", 4), ("memory", "8GiB"))}
    with dask.config.set(own), slurm_cluster("long") as queue:
        assert "--nthreads 4 --memory-limit 8.00GiB" in queue.job_script()
    # dask_jobqueue takes it as it is imported.
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
