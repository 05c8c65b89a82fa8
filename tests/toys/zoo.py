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
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from femubench.core.fem.model import LowRank, Model
from femubench.core.modal.measurement import Measurement
from femubench.core.run import answers
from femubench.core.update.strategy import Strategy, UpdateResult

MARK = "femubench-zoo-animal"


def sleeping(asking: int) -> list[str]:
    """Return the command of a process that sleeps, by which the one that asked for it knows it."""
    return [sys.executable, "-c", f"import time; time.sleep(900)  # {MARK} of {asking}"]


_SLEEPER = sleeping(0)  # of the animal that this process is

ANIMALS: list[type[Animal]] = []
# What the test has put up for burglars: a port, names, words.
TARGET: dict[str, Any] = {}
ESCAPED = ("failed", "RuntimeError: escaped")
_LIBC = ctypes.CDLL(None, use_errno=True)


class Animal(Strategy):
    """Base of the zoo: `harm` does it, `ends` is its status and the beginning of the reason."""

    citation = "none"
    ends: tuple[str, str]
    # The same without a sandbox: None where it would do harm to this machine.
    loose: tuple[str, str] | None
    act: Callable[[Any], Any]

    def __init__(self) -> None:
        self.target = dict(TARGET)

    def harm(self, model: Model) -> Any:
        """Do it; return another model, a result, or None for the model as it is."""
        return self.act(model)

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Do harm."""
        _SLEEPER[:] = sleeping(self.target["process"])
        found = self.harm(model)
        return (
            found
            if isinstance(found, UpdateResult)
            else UpdateResult(model if found is None else found)
        )


class Burglar(Animal):
    """Tries what a sandbox prevents; `act` returns whether it could."""

    def harm(self, model: Model) -> None:
        """Try it."""
        try:
            found = self.act(self.target)
        except OSError:
            found = False
        if found:
            raise RuntimeError(f"escaped: {self.name}")


def animal(
    status: str = "ok",
    reason: str = "",
    *,
    loose: tuple[str, str] | None = ("same", ""),
    base: type[Animal] = Animal,
) -> Callable[[Callable[[Any], Any]], type[Animal]]:
    """Return what makes an animal of a function, whose name it has, for a worker to import.

    Arguments:
        status, reason: with which it ends, the reason by its beginning.
        loose: the same without a sandbox; None where it would do harm to this machine.
    """

    def make(act: Callable[[Any], Any]) -> type[Animal]:
        named = {"name": act.__name__.strip("_").replace("_", "-"), "__module__": __name__}
        ends = {"ends": (status, reason), "loose": loose, "act": staticmethod(act)}
        ANIMALS.append(type(act.__name__, (base,), {**named, **ends}))
        return ANIMALS[-1]

    return make


burglar = partial(animal, loose=ESCAPED, base=Burglar)


@animal("crashed", "the worker process was ended by SIGSEGV")
def segfault(model: Model) -> None:
    ctypes.string_at(0)


@animal("timeout", "no result within ")
def deaf_loop(model: Model) -> None:
    """Does not listen to signals that can be ignored."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGALRM):
        signal.signal(number, signal.SIG_IGN)
    while True:
        time.sleep(0.1)


@animal("timeout", "no result within ")
def sleeper(model: Model) -> None:
    """Stops itself."""
    os.kill(os.getpid(), signal.SIGSTOP)


@animal("failed", "out of memory: ")
def memory_hog(model: Model) -> None:
    kept = []
    while True:
        kept.append(np.empty(2**22))


@animal("crashed", "used ")
def memory_hogs(model: Model) -> None:
    """Shares its hunger among children, each of them modest."""
    for _ in range(8):
        if os.fork() == 0:
            kept = mmap.mmap(-1, 2**27)
            kept.write(b"x" * 2**27)
            time.sleep(60.0)
    time.sleep(60.0)


@animal("crashed", "printed more than ")
def chatterbox(model: Model) -> None:
    """Prints a gigabyte."""
    line = b"x" * 2**20
    for _ in range(1024):
        os.write(1, line)


@animal("failed", "OSError: [Errno 27] File too large")
def disk_filler(model: Model) -> None:
    """Writes one endless file."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, 2**20))  # so that the test is quick
    with open("filler", "wb", buffering=0) as stream:
        while True:
            stream.write(b"x" * 2**18)


class _Bomb:
    """Runs a command in anyone who unpickles it."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {Path.home()}/{MARK}",)


@animal("failed", "the result cannot be read: ")
def trojan(model: Model) -> None:
    """Hands back something that would run a command in the process that reads it."""
    code = pickle.dumps(_Bomb())
    answers._pack = lambda *_: b"o" + code


@animal()
def vandal(model: Model) -> None:
    """Breaks the libraries of its own process for all who come after."""
    import scipy.linalg
    import scipy.sparse.linalg

    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("broken by a vandal")

    for module in (np.linalg, scipy.linalg, scipy.sparse.linalg):
        for name in ("eigh", "eigsh", "svd", "solve", "splu", "lstsq", "eigvalsh"):
            if hasattr(module, name):
                setattr(module, name, broken)
    os.environ["OMP_NUM_THREADS"] = "64"


@animal()
def third_party(model: Model) -> None:
    """Leaves a process behind that has nothing of its environment."""
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            os.execve(_SLEEPER[0], _SLEEPER, {})
        os._exit(0)


# In a sandbox its parent is nobody, number 0, which stands for its own group.
@animal(
    "crashed",
    "the worker process was ended by SIGKILL",
    loose=("crashed", "the process from which all workers are started was ended"),
)
def regicide(model: Model) -> None:
    """Ends the process that started it, and with it all other workers."""
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(900.0)


@animal()
def litterer(model: Model) -> None:
    """Leaves files behind, here and in the temporary folder."""
    import tempfile

    Path(f"{MARK}.txt").write_text("litter")
    tempfile.mkstemp(prefix=MARK)


@animal()
def lingerer(model: Model) -> None:
    """Has a thread that would keep its process alive."""
    threading.Thread(target=time.sleep, args=(900.0,)).start()


@animal("failed", "stiffness is not a valid sparse array")
def wild_indices(model: Model) -> Model:
    """Returns a sparse matrix whose indices point far outside: reading it may end a process."""
    stiffness = model.stiffness.copy()
    stiffness.indices = np.full_like(stiffness.indices, 2**30)
    return replace(model, stiffness=stiffness)


@animal("crashed", "its result is larger than ")
def colossus(model: Model) -> Model:
    """Hands back a model that is far too large."""
    size = 8 * 2**21 // model.size
    return replace(model, mass_change=LowRank(np.zeros((model.size, size)), np.eye(1)))


@animal("failed", "the result cannot be read")
def liar(model: Model) -> None:
    """Writes its own verdict where the worker writes its answer."""
    text = b'{"status": "ok", "gain": 1.0}'
    data = len(text).to_bytes(8, "big") + text
    for descriptor in range(3, 64):
        try:
            os.write(descriptor, len(data).to_bytes(8, "big") + data)
        except OSError:
            continue
    time.sleep(900.0)


@animal("timeout", "no result within ", loose=("ok", ""))
def gaoler(model: Model) -> None:
    """Stops the process from which all workers are forked."""
    os.kill(os.getppid(), signal.SIGSTOP)


@burglar()
def home_reader(target: dict[str, Any]) -> bool:
    return any(path.is_file() for path in Path(target["home"]).iterdir())


@burglar()
def folder_reader(target: dict[str, Any]) -> bool:
    """Reads what is in the folder where the run was started."""
    return any(path.is_file() for path in Path(target["folder"]).iterdir())


@burglar()
def scenario_reader(target: dict[str, Any]) -> bool:
    """Reads the measured values that come with femubench, wherever that may lie."""
    import femubench

    package = Path(femubench.__file__).parent
    for folder in (package / "scenarios", package.resolve().parent / "scenarios"):
        if any(folder.rglob("*.csv")) or any(folder.rglob("case.toml")):
            return True
    return False


@burglar()
def neighbour(target: dict[str, Any]) -> bool:
    """Sees other processes."""
    return len([name for name in os.listdir("/proc") if name.isdigit()]) > 2


@burglar()
def memory_reader(target: dict[str, Any]) -> bool:
    """Reads the memory of the process that asked for the run."""
    with open(f"/proc/{target['process']}/mem", "rb"):
        return True


@burglar(loose=None)
def tracer(target: dict[str, Any]) -> bool:
    """Takes hold of the first process with ptrace."""
    return _LIBC.ptrace(16, 1, None, None) == 0


@animal(loose=None)
def kill_all(model: Model) -> None:
    """Sends every process that it can see a signal that ends it."""
    subprocess.Popen(_SLEEPER)
    os.kill(-1, signal.SIGKILL)
    os.kill(1, signal.SIGKILL)


@animal("failed", "BlockingIOError: [Errno 11]", loose=None)
def fork_bomb(model: Model) -> None:
    for _ in range(4000):
        os.posix_spawn("/bin/sleep", ["sleep", "900"], {})


@animal("failed", "PermissionError: [Errno 1]", loose=("crashed", "used "))
def memory_file(model: Model) -> None:
    """Holds in memory a file that has no name, and in its own memory nothing."""
    descriptor = os.memfd_create("hoard")
    for _ in range(12):
        os.write(descriptor, b"x" * 2**26)
    time.sleep(900.0)


@animal("failed", "OSError: [Errno 28] No space left", loose=None)
def shared_memory_hog(model: Model) -> None:
    """Fills /dev/shm."""
    with open(f"/dev/shm/{MARK}", "wb", buffering=0) as stream:
        for _ in range(64):
            stream.write(b"x" * 2**24)


@animal("failed", "OSError: [Errno 28] No space left", loose=None)
def folder_filler(model: Model) -> None:
    """Fills its temporary folder, no file of which is large."""
    for number in range(1024):
        Path(f"{number}").write_bytes(b"x" * 2**22)


@burglar()
def caller(target: dict[str, Any]) -> bool:
    """Calls a server on this machine."""
    import socket

    socket.create_connection(("127.0.0.1", target["port"]), 2.0).close()
    return True


@burglar()
def abstract_caller(target: dict[str, Any]) -> bool:
    """Calls a socket that has a name and no file."""
    import socket

    with socket.socket(socket.AF_UNIX) as caller:
        caller.connect(target["abstract"])
    return True


@burglar()
def forger(target: dict[str, Any]) -> bool:
    """Writes into a library."""
    made = Path(np.__file__).parent / f"{MARK}.py"
    made.write_text("")
    made.unlink()
    return True


@burglar()
def home_forger(target: dict[str, Any]) -> bool:
    """Writes into the code of femubench itself."""
    import femubench.core.run.judging as judging

    with open(judging.__file__, "r+"):
        return True


@burglar(loose=None)
def mounter(target: dict[str, Any]) -> bool:
    return _LIBC.mount(b"tmpfs", b"/own", b"tmpfs", ctypes.c_ulong(0), None) == 0


@burglar()
def nester(target: dict[str, Any]) -> bool:
    """Makes a namespace of users, in which it would be root."""
    # With unshare, and with clone, which libraries call.
    flags = 0x10000000
    return _LIBC.unshare(flags) == 0


@burglar(loose=None)
def cloner(target: dict[str, Any]) -> bool:
    """The same with clone3 and clone, which return twice."""
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


@burglar(loose=None)
def joiner(target: dict[str, Any]) -> bool:
    """Joins the namespaces of the first process."""
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


@burglar(loose=None)
def climber(target: dict[str, Any]) -> bool:
    """Leaves its root with chroot, the oldest way."""
    os.mkdir("rope")
    os.chroot("rope")
    return True


@animal()
def detached(model: Model) -> None:
    """Leaves a process with nothing: no environment, session, folder or open file of its own."""
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            os.chdir("/")
            os.closerange(0, 256)
            os.execve(_SLEEPER[0], _SLEEPER, {})
        os._exit(0)
    os.wait()
    time.sleep(0.2)


@burglar()
def sharer(target: dict[str, Any]) -> bool:
    """Leaves shared memory of System V behind."""
    found = _LIBC.shmget(0, 4096, 0o1600)
    if found >= 0:
        _LIBC.shmctl(found, 0, None)
    return bool(found >= 0)


@burglar()
def hider(target: dict[str, Any]) -> bool:
    """Shows nobody what it has open."""
    hidden = _LIBC.prctl(4, 0, 0, 0, 0) == 0
    _LIBC.prctl(4, 1, 0, 0, 0)
    return hidden


@burglar(loose=None)
def key_keeper(target: dict[str, Any]) -> bool:
    """Keeps a word in a key ring of the kernel, for the next one."""
    import platform

    add = {"x86_64": 248, "aarch64": 217}[platform.machine()]
    return _LIBC.syscall(add, b"user", MARK.encode(), b"word", 4, -4) >= 0


@burglar(loose=None)
def device_maker(target: dict[str, Any]) -> bool:
    import stat

    os.mknod("disk", stat.S_IFBLK | 0o600, os.makedev(254, 0))
    return True


@burglar(loose=None)
def tuner(target: dict[str, Any]) -> bool:
    """Opens the switches of the kernel for writing."""
    switches = ("sys/kernel/core_pattern", "sysrq-trigger", "sys/kernel/hostname")
    return any(_writable(f"/proc/{switch}") for switch in switches)


def _writable(path: str) -> bool:
    try:
        os.close(os.open(path, os.O_WRONLY))
    except OSError:
        return False
    return True


@animal()
def feller(model: Model) -> None:
    """Removes its folder, and without a sandbox the one above, where those of all jobs are."""
    import shutil

    above = Path.cwd().parent
    for folder in (Path.cwd(), above if above.name.startswith("femubench-") else None):
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)


@burglar()
def environment_reader(target: dict[str, Any]) -> bool:
    """Reads the environment: what it has, and what its first process was given."""
    given = Path("/proc/self/environ").read_bytes()
    return any(target["word"] in text for text in (str(os.environ), str(given)))


@burglar(loose=None)
def ring_maker(target: dict[str, Any]) -> bool:
    """Makes a ring of io_uring, whose calls no filter sees."""
    return _LIBC.syscall(425, 4, ctypes.create_string_buffer(120)) >= 0


@burglar(loose=("ok", ""))
def descriptors(target: dict[str, Any]) -> bool:
    """Finds more open files than the one to answer."""
    found = [int(name) for name in os.listdir("/proc/self/fd")]
    links = [f"/proc/self/fd/{number}" for number in found if number > 2]
    return len([link for link in links if os.path.exists(link)]) > 1


def _objects() -> set[str]:
    """Return the objects of System V on this machine: kind and number."""
    found = set()
    for table in Path("/proc/sysvipc").glob("*"):
        rows = table.read_text().splitlines()[1:]
        found.update(f"{table.name} {row.split()[1]}" for row in rows)
    return found


_BEFORE = _objects()


def leftovers() -> Iterator[str]:
    """Return processes and files that the zoo of this process has left on this machine."""
    import tempfile

    import psutil

    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if process.cmdline() == sleeping(os.getpid()):
                yield f"process {process.pid}"
    # Another zoo on this machine removes its objects at once.
    yield from sorted((_objects() - _BEFORE) & _objects())
    for folder in (Path(tempfile.gettempdir()), Path.cwd(), Path.home()):
        yield from (str(path) for path in folder.glob(f"*{MARK}*"))
    yield from map(str, Path(tempfile.gettempdir()).glob(f"femubench-{os.getpid()}-*"))
