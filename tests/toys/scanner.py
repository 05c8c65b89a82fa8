"""A strategy that looks for a word everywhere, and what else a sandbox has to hold."""

from __future__ import annotations

import hashlib
import json
import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from femubench.core.fem.model import Model
from femubench.core.modal.measurement import Measurement
from femubench.core.update.strategy import Strategy, UpdateResult

HEAD = "zoo-" + "planted-"
_WORD = re.compile(HEAD.encode() + rb"[0-9a-f]{16}")
_CHUNK = 2**22
_LARGEST = 2**20  # bytes of a file that is read
_PATIENCE = 40.0  # s of processor on the disk, and as much on memory
_SKIPPED = {"proc", "sys", "dev", "usr", "lib", "lib64", "bin", "sbin", "boot", "snap"}


class Scanner(Strategy):
    """Fails with every place where it has found the word."""

    name = "scanner"
    citation = "none"

    def __init__(self, port: int, asking: int, digest: str) -> None:
        self.port, self.asking, self.digest = port, asking, digest

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Look."""
        places = {
            "disk": _disk(),
            "environment": _environments(),
            "network": _network(self.port),
            "descriptors": _descriptors(),
            "memory": _memory(self.asking),
        }
        found = {place: self._first(words) for place, words in places.items()}
        said = [f"{place}: {word}" for place, word in found.items() if word is not None]
        if said:
            raise RuntimeError("; ".join(said))
        return UpdateResult(model)

    def _first(self, words: Iterator[str]) -> str | None:
        """Return the word that was planted now, not one of an earlier test."""
        return next((word for word in words if digest_of(word) == self.digest), None)


def digest_of(word: str) -> str:
    """Return what tells a word to somebody who has it, and to nobody else."""
    return hashlib.sha256(word.encode()).hexdigest()


def _words(data: bytes) -> Iterator[str]:
    for match in _WORD.finditer(data):
        yield match.group().decode()


def _disk() -> Iterator[str]:
    until = time.process_time() + _PATIENCE
    tops = sorted(set(os.listdir("/")) - _SKIPPED, key=lambda name: name != "tmp")
    for top in tops:
        for folder, folders, names in os.walk(f"/{top}"):
            folders.sort(key=lambda name, at=folder: -_changed(os.path.join(at, name)))
            for name in names:
                if time.process_time() > until:
                    return
                yield from _in_file(os.path.join(folder, name))


def _changed(path: str) -> float:
    """Return when something was last put into a folder: what is new is read first."""
    try:
        return os.stat(path, follow_symlinks=False).st_mtime
    except OSError:
        return 0.0


def _in_file(path: str) -> Iterator[str]:
    with suppress(OSError):
        if os.path.isfile(path) and os.path.getsize(path) <= _LARGEST:
            with open(path, "rb") as stream:
                yield from _words(stream.read())


def _processes() -> list[str]:
    return [name for name in os.listdir("/proc") if name.isdigit()]


def _environments() -> Iterator[str]:
    yield from _words(str(dict(os.environ)).encode())
    for process in _processes():
        for name in ("environ", "cmdline"):
            with suppress(OSError):
                yield from _words(Path(f"/proc/{process}/{name}").read_bytes())


def _network(port: int) -> Iterator[str]:
    with suppress(OSError), socket.create_connection(("127.0.0.1", port), 2.0) as caller:
        yield from _words(caller.recv(1000))


def _descriptors() -> Iterator[str]:
    for process in _processes():
        with suppress(OSError):
            for name in os.listdir(f"/proc/{process}/fd"):
                yield from _in_file(f"/proc/{process}/fd/{name}")


def _memory(asking: int) -> Iterator[str]:
    """Look through the memory of this process, of the one that asked, and of all others."""
    until = time.process_time() + _PATIENCE
    for process in dict.fromkeys(["self", str(asking), *_processes()]):
        with suppress(OSError), open(f"/proc/{process}/mem", "rb", buffering=0) as memory:
            for start, end in _regions(process):
                if time.process_time() > until:
                    return
                for at in range(start, end, _CHUNK):
                    with suppress(OSError, ValueError, OverflowError):
                        memory.seek(at)
                        yield from _words(memory.read(min(_CHUNK, end - at)))


def _regions(process: str) -> list[tuple[int, int]]:
    lines = Path(f"/proc/{process}/maps").read_text().splitlines()
    writable = [line.split()[0] for line in lines if line.split()[1].startswith("rw")]
    return [(int(a, 16), int(b, 16)) for a, b in (words.split("-") for words in writable)]


def many_processes(count: int) -> bytes:
    """Start processes and wait."""
    try:
        for _ in range(count):
            os.posix_spawn("/bin/sleep", ["sleep", "900"], {})
        time.sleep(900.0)
    except OSError as error:
        return str(error).encode()
    return b""


def ready_and_waiting(_: object) -> bytes:
    """Say so, and sleep."""
    print("ready", flush=True)
    time.sleep(900.0)
    return b""


def reached_outside(_: object) -> bytes:
    """Return what could be done to devices of the machine, and to sockets without a namespace."""
    found = []
    for what in ("/dev/null", "/dev/zero", "/dev/urandom", 0):
        with suppress(OSError):
            os.chmod(what, os.stat(what).st_mode & 0o7777)
            found.append(f"chmod {what}")
        with suppress(OSError):
            os.utime(what)
            found.append(f"utime {what}")
    for family in (38, 40, 44):  # AF_ALG, AF_VSOCK, AF_XDP
        try:
            socket.socket(family, socket.SOCK_STREAM).close()
        except PermissionError:
            continue
        except OSError:
            pass
        found.append(f"socket of family {family}")
    with open(os.devnull, "w") as nothing:
        nothing.write("can be written to")
    for one in socket.socketpair():
        one.close()
    return ", ".join(found).encode()


def sleeping_family(asking: int) -> bytes:
    """Leave a sleeper in a session of its own, and sleep."""
    from zoo import sleeping

    subprocess.Popen(sleeping(asking), start_new_session=True)
    if os.fork() == 0:
        os.setsid()
        time.sleep(900.0)
    sys.stdout.flush()
    time.sleep(900.0)
    return b""


_LEFT = "/own/left", "/tmp/left"


def leave_traces(how: str) -> bytes:
    """Leave all that a later job might find, and return what is found of it here.

    Arguments:
        how: ``end``, or ``stay`` to print a word and sleep.
    """
    Path(_LEFT[0]).write_text("left")
    vars(json)["left"] = os.environ["FEMUBENCH_LEFT"] = "left"
    ready, listens = os.pipe()
    if os.fork() == 0:
        os.setsid()
        with socket.create_server(("127.0.0.1", 4321)), socket.socket(socket.AF_UNIX) as abstract:
            abstract.bind("\0left")
            abstract.listen()
            os.write(listens, b"1")
            time.sleep(900.0)
    os.read(ready, 1)
    if how == "stay":
        print("left", flush=True)
        time.sleep(900.0)
    return seen_traces(None)


def seen_traces(_: object) -> bytes:
    """Return what there is of what `leave_traces` leaves."""
    found = [path for path in _LEFT if os.path.exists(path)]
    found += ["module"] * hasattr(json, "left") + ["variable"] * ("FEMUBENCH_LEFT" in os.environ)
    found += ["process"] * (len(_processes()) > 2)
    for family, address in ((socket.AF_INET, ("127.0.0.1", 4321)), (socket.AF_UNIX, "\0left")):
        with suppress(OSError), socket.socket(family) as caller:
            caller.connect(address)
            found.append(f"socket of family {family:d}")
    return ", ".join(found).encode()
