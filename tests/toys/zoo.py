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
        answers._sealed = lambda *_: b"o" + code
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
    ends = ("crashed", "the process from which all workers are started was ended")

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
    ends = ("ok", "")

    def harm(self, model: Model) -> Model:
        os.kill(os.getppid(), signal.SIGSTOP)
        return model


ANIMALS: tuple[type[Animal], ...] = (
    *(Segfault, Exit, EndlessLoop, DeafLoop, Sleeper, MemoryHog, MemoryHogs, Chatterbox),
    *(DiskFiller, UnpicklableError, Trojan, Vandal, Deserter, Daemon, Litterer, Lingerer),
    *(Gaoler, NotFinite, Skewed, WildIndices, Colossus, Liar),
    *(Stranger, Regicide, Babbler, Boaster),
)


def leftovers() -> Iterator[str]:
    """Return processes and files that the zoo has left on this machine."""
    import tempfile

    import psutil

    for process in psutil.process_iter(["cmdline"]):
        if any(MARK in word for word in process.info["cmdline"] or ()):
            yield f"process {process.pid}"
    for folder in (Path(tempfile.gettempdir()), Path.cwd(), Path.home()):
        yield from (str(path) for path in folder.glob(f"*{MARK}*"))
    yield from map(str, Path(tempfile.gettempdir()).glob(f"femubench-{os.getpid()}-*"))
