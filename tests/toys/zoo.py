"""Strategies that do harm, each in its own way, and what a run has to say of each."""

from __future__ import annotations

import ctypes
import mmap
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from femubench.core.fem.model import LowRank, Model
from femubench.core.modal.measurement import Measurement
from femubench.core.run import answers
from femubench.core.update.strategy import Strategy, UpdateResult

MARK = "femubench-zoo-animal"
_SLEEPER = [sys.executable, "-c", f"import time; time.sleep(900)  # {MARK}"]


class Animal(Strategy):
    """Base of the zoo: `harm` does it, `ends` tells status and the beginning of the reason."""

    citation = "none"
    ends = ("ok", "")
    # The same without a sandbox: None where it would do harm to this machine.
    loose: tuple[str, str] | None = ("same", "")

    def harm(self, model: Model) -> Model:
        """Do it; return a model."""
        return model

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Do harm."""
        return UpdateResult(self.harm(model))


class Segfault(Animal):
    name = "segfault"
    ends = ("crashed", "the worker process was ended by SIGSEGV")

    def harm(self, model: Model) -> Model:
        ctypes.string_at(0)
        return model


class Exit(Animal):
    name = "exit"
    ends = ("crashed", "the worker process ended with exit code 0")

    def harm(self, model: Model) -> Model:
        os._exit(0)


class EndlessLoop(Animal):
    name = "endless-loop"
    ends = ("timeout", "no result within ")

    def harm(self, model: Model) -> Model:
        while True:
            pass


class DeafLoop(Animal):
    """Does not listen to signals that can be ignored."""

    name = "deaf-loop"
    ends = ("timeout", "no result within ")

    def harm(self, model: Model) -> Model:
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGALRM):
            signal.signal(number, signal.SIG_IGN)
        while True:
            time.sleep(0.1)


class Sleeper(Animal):
    """Stops itself."""

    name = "sleeper"
    ends = ("timeout", "no result within ")

    def harm(self, model: Model) -> Model:
        os.kill(os.getpid(), signal.SIGSTOP)
        return model


class MemoryHog(Animal):
    name = "memory-hog"
    ends = ("failed", "out of memory: ")

    def harm(self, model: Model) -> Model:
        kept = []
        while True:
            kept.append(np.ones(2**22))


class MemoryHogs(Animal):
    """Shares its hunger among children, each of them modest."""

    name = "memory-hogs"
    ends = ("crashed", "used ")

    def harm(self, model: Model) -> Model:
        for _ in range(8):
            if os.fork() == 0:
                kept = mmap.mmap(-1, 2**27)
                kept.write(b"x" * 2**27)
                time.sleep(60.0)
        time.sleep(60.0)
        return model


class Chatterbox(Animal):
    """Prints a gigabyte."""

    name = "chatterbox"
    ends = ("crashed", "printed more than ")

    def harm(self, model: Model) -> Model:
        line = b"x" * 2**20
        for _ in range(1024):
            os.write(1, line)
        return model


class DiskFiller(Animal):
    """Writes one endless file."""

    name = "disk-filler"
    ends = ("failed", "OSError: [Errno 27] File too large")

    def harm(self, model: Model) -> Model:
        resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, 2**20))  # so that the test is quick
        with open("filler", "wb", buffering=0) as stream:
            while True:
                stream.write(b"x" * 2**18)


class _Payload(Exception):  # noqa: N818
    def __init__(self, first: object, second: object) -> None:
        super().__init__(first)
        self.payload = (lambda: second, threading.Lock())

    def __reduce__(self) -> Any:
        raise RuntimeError("not for you")


class UnpicklableError(Animal):
    name = "unpicklable-error"
    ends = ("failed", "_Payload: 1")

    def harm(self, model: Model) -> Model:
        raise _Payload(1, 2)


class _Bomb:
    """Runs a command in whoever unpickles it."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {Path.home()}/{MARK}",)


class Trojan(Animal):
    """Hands back something that would run a command in the process that reads it."""

    name = "trojan"
    ends = ("failed", "the result cannot be read: ")

    def harm(self, model: Model) -> Model:
        code = pickle.dumps(_Bomb())
        answers._pack = lambda *_: b"o" + code
        return model


class Vandal(Animal):
    """Breaks the libraries of its own process for all who come after."""

    name = "vandal"
    ends = ("ok", "")

    def harm(self, model: Model) -> Model:
        import scipy.linalg
        import scipy.sparse.linalg

        def broken(*_: object, **__: object) -> None:
            raise RuntimeError("broken by a vandal")

        for module in (np.linalg, scipy.linalg, scipy.sparse.linalg):
            for name in ("eigh", "eigsh", "svd", "solve", "splu", "lstsq", "eigvalsh"):
                if hasattr(module, name):
                    setattr(module, name, broken)
        os.environ["OMP_NUM_THREADS"] = "64"
        return model


class Deserter(Animal):
    """Leaves a process behind that has left its session."""

    name = "deserter"
    ends = ("ok", "")

    def harm(self, model: Model) -> Model:
        subprocess.Popen(_SLEEPER, start_new_session=True)
        return model


class Daemon(Animal):
    """Leaves a process behind by forking twice, which keeps its output open."""

    name = "daemon"
    ends = ("ok", "")

    def harm(self, model: Model) -> Model:
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                os.execv(_SLEEPER[0], _SLEEPER)
            os._exit(0)
        return model


class Stranger(Animal):
    """Leaves a process behind that has nothing of its environment."""

    name = "stranger"

    def harm(self, model: Model) -> Model:
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                os.execve(_SLEEPER[0], _SLEEPER, {})
            os._exit(0)
        return model


class Regicide(Animal):
    """Ends the process that started it, and with it all other workers."""

    name = "regicide"
    # In a sandbox its parent is nobody, number 0, which stands for its own group.
    ends = ("crashed", "the worker process was ended by SIGKILL")
    loose = ("crashed", "the process from which all workers are started was ended")

    def harm(self, model: Model) -> Model:
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(900.0)
        return model


class Babbler(Animal):
    """Raises a text that is none in UTF-8."""

    name = "babbler"
    ends = ("failed", "ValueError: ")

    def harm(self, model: Model) -> Model:
        raise ValueError("\ud800")


class Boaster(Animal):
    """Says that it has fewer unknowns than none."""

    name = "boaster"
    ends = ("failed", "ValueError: parameter_count is -1")

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        return UpdateResult(model, parameter_count=-1)


class Litterer(Animal):
    """Leaves files behind, here and in the temporary folder."""

    name = "litterer"
    ends = ("ok", "")

    def harm(self, model: Model) -> Model:
        import tempfile

        Path(f"{MARK}.txt").write_text("litter")
        tempfile.mkstemp(prefix=MARK)
        return model


class Lingerer(Animal):
    """Has a thread that would keep its process alive."""

    name = "lingerer"
    ends = ("ok", "")

    def harm(self, model: Model) -> Model:
        threading.Thread(target=time.sleep, args=(900.0,)).start()
        return model


class NotFinite(Animal):
    name = "not-finite"
    ends = ("failed", "stiffness has 1 entries that are not finite")

    def harm(self, model: Model) -> Model:
        stiffness = model.stiffness.copy()
        stiffness.data[0] = np.nan
        return replace(model, stiffness=stiffness)


class Skewed(Animal):
    name = "skewed"
    ends = ("failed", "stiffness is not symmetric")

    def harm(self, model: Model) -> Model:
        stiffness = model.stiffness.tolil()
        stiffness[0, 1] += 1e3 + abs(stiffness[0, 1])
        return replace(model, stiffness=stiffness.tocsc())


class WildIndices(Animal):
    """Returns a sparse matrix whose indices point far outside: reading it may end a process."""

    name = "wild-indices"
    ends = ("failed", "stiffness is not a valid sparse array")

    def harm(self, model: Model) -> Model:
        stiffness = model.stiffness.copy()
        stiffness.indices = np.full_like(stiffness.indices, 2**30)
        return replace(model, stiffness=stiffness)


class Colossus(Animal):
    """Hands back a model that is far too large."""

    name = "colossus"
    ends = ("crashed", "its result is larger than ")

    def harm(self, model: Model) -> Model:
        size = 8 * 2**21 // model.size
        return replace(model, mass_change=LowRank(np.zeros((model.size, size)), np.eye(1)))


class Liar(Animal):
    """Writes its own verdict where the worker writes its answer."""

    name = "liar"
    ends = ("failed", "the result cannot be read")

    def harm(self, model: Model) -> Model:
        text = b'{"status": "ok", "score": 0.0}'
        data = len(text).to_bytes(8, "big") + text
        for descriptor in range(3, 64):
            try:
                os.write(descriptor, len(data).to_bytes(8, "big") + data)
            except OSError:
                continue
        time.sleep(900.0)
        return model


class Gaoler(Animal):
    """Stops the process from which all workers are forked."""

    name = "gaoler"
    ends = ("timeout", "no result within ")
    loose = ("ok", "")

    def harm(self, model: Model) -> Model:
        os.kill(os.getppid(), signal.SIGSTOP)
        return model


ESCAPED = ("failed", "RuntimeError: escaped")
# What the test has put up for burglars: a port, names, words.
TARGET: dict[str, Any] = {}
_LIBC = ctypes.CDLL(None, use_errno=True)


class Burglar(Animal):
    """Tries what a sandbox prevents; `tries` returns whether it could."""

    loose = ESCAPED

    def __init__(self) -> None:
        self.target = dict(TARGET)

    def tries(self) -> bool:
        """Try it."""
        raise NotImplementedError

    def harm(self, model: Model) -> Model:
        try:
            found = self.tries()
        except OSError:
            found = False
        if found:
            raise RuntimeError(f"escaped: {self.name}")
        return model


class HomeReader(Burglar):
    name = "home-reader"

    def tries(self) -> bool:
        return any(path.is_file() for path in Path(self.target["home"]).iterdir())


class FolderReader(Burglar):
    """Reads what is in the folder where the run was started."""

    name = "folder-reader"

    def tries(self) -> bool:
        return any(path.is_file() for path in Path(self.target["folder"]).iterdir())


class ScenarioReader(Burglar):
    """Reads the measured values that come with femubench, wherever that may lie."""

    name = "scenario-reader"

    def tries(self) -> bool:
        import femubench

        package = Path(femubench.__file__).parent
        for folder in (package / "scenarios", package.resolve().parent / "scenarios"):
            if any(folder.rglob("*.csv")) or any(folder.rglob("case.toml")):
                return True
        return False


class PaperReader(Burglar):
    name = "paper-reader"

    def tries(self) -> bool:
        import femubench

        package = Path(femubench.__file__).parent
        places = (package / "papers", package.resolve().parent / "papers")
        return any(any(folder.rglob("*.toml")) for folder in places)


class Neighbour(Burglar):
    """Sees other processes."""

    name = "neighbour"

    def tries(self) -> bool:
        return len([name for name in os.listdir("/proc") if name.isdigit()]) > 2


class MemoryReader(Burglar):
    """Reads the memory of the process that asked for the run."""

    name = "memory-reader"

    def tries(self) -> bool:
        with open(f"/proc/{self.target['process']}/mem", "rb"):
            return True


class Tracer(Burglar):
    """Takes hold of the first process with ptrace."""

    name = "tracer"
    loose = None

    def tries(self) -> bool:
        return _LIBC.ptrace(16, 1, None, None) == 0


class KillAll(Animal):
    """Sends every process that it can see a signal that ends it."""

    name = "kill-all"
    loose = None

    def harm(self, model: Model) -> Model:
        subprocess.Popen(_SLEEPER)
        os.kill(-1, signal.SIGKILL)
        os.kill(1, signal.SIGKILL)
        return model


class ForkBomb(Animal):
    name = "fork-bomb"
    ends = ("failed", "BlockingIOError: [Errno 11]")
    loose = None

    def harm(self, model: Model) -> Model:
        for _ in range(4000):
            os.posix_spawn("/bin/sleep", ["sleep", "900"], {})
        return model


class MemoryFile(Animal):
    """Holds in memory a file that has no name, and in its own memory nothing."""

    name = "memory-file"
    ends = ("failed", "PermissionError: [Errno 1]")
    loose = ("crashed", "used ")

    def harm(self, model: Model) -> Model:
        descriptor = os.memfd_create("hoard")
        for _ in range(12):
            os.write(descriptor, b"x" * 2**26)
        time.sleep(900.0)
        return model


class SharedMemoryHog(Animal):
    """Fills /dev/shm."""

    name = "shared-memory-hog"
    ends = ("failed", "OSError: [Errno 28] No space left")
    loose = None

    def harm(self, model: Model) -> Model:
        with open(f"/dev/shm/{MARK}", "wb", buffering=0) as stream:
            for _ in range(64):
                stream.write(b"x" * 2**24)
        return model


class FolderFiller(Animal):
    """Fills its temporary folder, no file of which is large."""

    name = "folder-filler"
    ends = ("failed", "OSError: [Errno 28] No space left")
    loose = None

    def harm(self, model: Model) -> Model:
        for number in range(1024):
            Path(f"{number}").write_bytes(b"x" * 2**22)
        return model


class Caller(Burglar):
    """Calls a server on this machine."""

    name = "caller"

    def tries(self) -> bool:
        import socket

        socket.create_connection(("127.0.0.1", self.target["port"]), 2.0).close()
        return True


class AbstractCaller(Burglar):
    """Calls a socket that has a name and no file."""

    name = "abstract-caller"

    def tries(self) -> bool:
        import socket

        with socket.socket(socket.AF_UNIX) as caller:
            caller.connect(self.target["abstract"])
        return True


class Forger(Burglar):
    """Writes into a library."""

    name = "forger"

    def tries(self) -> bool:
        made = Path(np.__file__).parent / f"{MARK}.py"
        made.write_text("")
        made.unlink()
        return True


class HomeForger(Burglar):
    """Writes into the code of femubench itself."""

    name = "home-forger"

    def tries(self) -> bool:
        import femubench.core.run.judging as judging

        with open(judging.__file__, "r+"):
            return True


class Mounter(Burglar):
    name = "mounter"
    loose = None

    def tries(self) -> bool:
        return _LIBC.mount(b"tmpfs", b"/own", b"tmpfs", ctypes.c_ulong(0), None) == 0


class Unmounter(Burglar):
    name = "unmounter"
    loose = None

    def tries(self) -> bool:
        return _LIBC.umount2(b"/usr", 2) == 0 or _LIBC.umount2(b"/own", 2) == 0


class Nester(Burglar):
    """Makes a namespace of users, in which it would be root."""

    name = "nester"

    def tries(self) -> bool:
        # With unshare, and with clone, which libraries call.
        flags = 0x10000000
        return _LIBC.unshare(flags) == 0


class Cloner(Burglar):
    """The same with clone3 and clone, which return twice."""

    name = "cloner"
    loose = None

    def tries(self) -> bool:
        import platform

        clone = {"x86_64": 56, "aarch64": 220}[platform.machine()]
        made = _LIBC.syscall(clone, ctypes.c_ulong(0x10000000 | signal.SIGCHLD), 0, 0, 0, 0)
        if made == 0:
            os._exit(0)
        words = (ctypes.c_uint64 * 11)(0x10000000, 0, 0, 0, signal.SIGCHLD)
        again = _LIBC.syscall(435, words, ctypes.sizeof(words))
        if again == 0:
            os._exit(0)
        return bool(made > 0 or again > 0)


class Joiner(Burglar):
    """Joins the namespaces of the first process."""

    name = "joiner"
    loose = None

    def tries(self) -> bool:
        kinds = ("user", "mnt", "pid", "net")
        return any(_joined(f"/proc/1/ns/{kind}") for kind in kinds)


def _joined(path: str) -> bool:
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        return bool(_LIBC.setns(descriptor, 0) == 0)
    finally:
        os.close(descriptor)


class Climber(Burglar):
    """Leaves its root with chroot, the oldest way."""

    name = "climber"
    loose = None

    def tries(self) -> bool:
        os.mkdir("rope")
        os.chroot("rope")
        return True


class Detached(Animal):
    """Leaves a process with nothing: no environment, session, folder or open file of its own."""

    name = "detached"

    def harm(self, model: Model) -> Model:
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                os.chdir("/")
                os.closerange(0, 256)
                os.execve(_SLEEPER[0], _SLEEPER, {})
            os._exit(0)
        os.wait()
        time.sleep(0.2)
        return model


class Sharer(Burglar):
    """Leaves shared memory of System V behind."""

    name = "sharer"

    def tries(self) -> bool:
        found = _LIBC.shmget(0, 4096, 0o1600)
        if found >= 0:
            _LIBC.shmctl(found, 0, None)
        return bool(found >= 0)


class Messenger(Burglar):
    """Leaves a queue of messages behind."""

    name = "messenger"

    def tries(self) -> bool:
        found = _LIBC.msgget(0, 0o1600)
        if found >= 0:
            _LIBC.msgctl(found, 0, None)
        return bool(found >= 0)


class KeyKeeper(Burglar):
    """Keeps a word in a key ring of the kernel, for the next one."""

    name = "key-keeper"
    loose = None

    def tries(self) -> bool:
        import platform

        add = {"x86_64": 248, "aarch64": 217}[platform.machine()]
        return _LIBC.syscall(add, b"user", MARK.encode(), b"word", 4, -4) >= 0


class Spectator(Animal):
    """Watches files."""

    name = "spectator"

    def harm(self, model: Model) -> Model:
        watch = _LIBC.inotify_init()
        _LIBC.inotify_add_watch(watch, b"/", 0xFFF)
        return model


class DeviceMaker(Burglar):
    name = "device-maker"
    loose = None

    def tries(self) -> bool:
        import stat

        os.mknod("disk", stat.S_IFBLK | 0o600, os.makedev(254, 0))
        return True


class Tuner(Burglar):
    """Opens the switches of the kernel for writing."""

    name = "tuner"
    loose = None

    def tries(self) -> bool:
        switches = ("sys/kernel/core_pattern", "sysrq-trigger", "sys/kernel/hostname")
        return any(_writable(f"/proc/{switch}") for switch in switches)


def _writable(path: str) -> bool:
    try:
        os.close(os.open(path, os.O_WRONLY))
    except OSError:
        return False
    return True


class Renamer(Burglar):
    """Gives the machine another name, or knows its own."""

    name = "renamer"
    loose = None

    def tries(self) -> bool:
        return os.uname().nodename == self.target["host"] or _LIBC.sethostname(b"x", 1) == 0


class Feller(Animal):
    """Removes its folder, and without a sandbox the one above, where those of all jobs are."""

    name = "feller"

    def harm(self, model: Model) -> Model:
        import shutil

        above = Path.cwd().parent
        for folder in (Path.cwd(), above if above.name.startswith("femubench-") else None):
            if folder is not None:
                shutil.rmtree(folder, ignore_errors=True)
        return model


class EnvironmentReader(Burglar):
    """Reads the environment: what it has, and what its first process was given."""

    name = "environment-reader"

    def tries(self) -> bool:
        given = Path("/proc/self/environ").read_bytes()
        return any(self.target["word"] in text for text in (str(os.environ), str(given)))


class RingMaker(Burglar):
    """Makes a ring of io_uring, whose calls no filter sees."""

    name = "ring-maker"
    loose = None

    def tries(self) -> bool:
        return _LIBC.syscall(425, 4, ctypes.create_string_buffer(120)) >= 0


class Descriptors(Burglar):
    """Finds more open files than the one to answer."""

    name = "descriptors"
    loose = ("ok", "")

    def tries(self) -> bool:
        found = [int(name) for name in os.listdir("/proc/self/fd")]
        links = [f"/proc/self/fd/{number}" for number in found if number > 2]
        return len([link for link in links if os.path.exists(link)]) > 1


class SelfKiller(Animal):
    name = "self-killer"
    ends = ("crashed", "the worker process was ended by SIGKILL")

    def harm(self, model: Model) -> Model:
        os.kill(os.getpid(), signal.SIGKILL)
        return model


class Aborter(Animal):
    """Ends with a core, which would be large."""

    name = "aborter"
    ends = ("crashed", "the worker process was ended by SIGABRT")

    def harm(self, model: Model) -> Model:
        os.abort()


class ExitThree(Animal):
    name = "exit-three"
    ends = ("crashed", "the worker process ended with exit code 3")

    def harm(self, model: Model) -> Model:
        os._exit(3)


BURGLARS: tuple[type[Animal], ...] = (
    *(HomeReader, FolderReader, ScenarioReader, PaperReader, Neighbour, MemoryReader, Tracer),
    *(KillAll, ForkBomb, MemoryFile, SharedMemoryHog, FolderFiller, Caller, AbstractCaller),
    *(Forger, HomeForger, Mounter, Unmounter, Nester, Cloner, Joiner, Climber, Detached, Sharer),
    *(Messenger, KeyKeeper, Spectator, DeviceMaker, Tuner, Renamer, Feller, EnvironmentReader),
    *(RingMaker, Descriptors, SelfKiller, Aborter, ExitThree),
)
ANIMALS: tuple[type[Animal], ...] = (
    *(Segfault, Exit, EndlessLoop, DeafLoop, Sleeper, MemoryHog, MemoryHogs, Chatterbox),
    *(DiskFiller, UnpicklableError, Trojan, Vandal, Deserter, Daemon, Litterer, Lingerer),
    *(Gaoler, NotFinite, Skewed, WildIndices, Colossus, Liar),
    *(Stranger, Regicide, Babbler, Boaster),
    *BURGLARS,
)


def _objects() -> set[str]:
    """Return the objects of System V on this machine: kind and number."""
    found = set()
    for table in Path("/proc/sysvipc").glob("*"):
        rows = table.read_text().splitlines()[1:]
        found.update(f"{table.name} {row.split()[1]}" for row in rows)
    return found


_BEFORE = _objects()


def leftovers() -> Iterator[str]:
    """Return processes and files that the zoo has left on this machine."""
    import tempfile

    import psutil

    for process in psutil.process_iter(["cmdline"]):
        if any(MARK in word for word in process.info["cmdline"] or ()):
            yield f"process {process.pid}"
    yield from sorted(_objects() - _BEFORE)
    for folder in (Path(tempfile.gettempdir()), Path.cwd(), Path.home()):
        yield from (str(path) for path in folder.glob(f"*{MARK}*"))
    yield from map(str, Path(tempfile.gettempdir()).glob(f"femubench-{os.getpid()}-*"))
