"""Watch what a reader does while it reads: the time it takes and the files it opens."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from femubench import reports

# Of a processor, that no small file may take. The largest mesh allowed takes some 7 s, and 14 to
# more than 30 where seven processes share two cores and their caches.
SECONDS = 90.0
# Again and again so many seconds, in each of which a reader that works has used the processor.
WAITING, USED = 300.0, 0.01
_CLOCKS = (
    (signal.ITIMER_PROF, signal.SIGPROF, SECONDS),
    (signal.ITIMER_REAL, signal.SIGALRM, WAITING),
)
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_NEVER = ("os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.chmod",
          "os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect",
          "pickle.find_class", "ctypes.dlopen")  # fmt: skip
# The templates of the page.
_OWN = Path(reports.__file__).resolve().parent
# A module that is imported only now is no file of the case.
_CODE = (".py", ".pyc", ".so")
# How much memory this process has.
_OWN_SIZE = Path("/proc/self/statm")


class Hang(BaseException):
    """A reader that takes too long; no reader may take this for a fault of the file."""


@dataclass
class Watch:
    """What happened that must not, as long as `folder` is set."""

    folder: Path | None = None
    faults: list[str] = field(default_factory=list)

    def hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Note an event; see the table of audit events in Python's documentation."""
        if self.folder is None:
            return
        if event in _NEVER:
            self.faults.append(f"{event} {arguments!r}"[:300])
        elif event == "open" and isinstance(arguments[0], (str, bytes)):
            path = Path(os.fsdecode(arguments[0]))
            reading = not (arguments[2] or 0) & _WRITING
            inside = any(path.resolve().is_relative_to(f) for f in (self.folder, _OWN))
            known = inside or path == _OWN_SIZE or path.name.endswith(_CODE)
            if not (reading and known):
                self.faults.append(f"opens {path} {'' if reading else 'for writing'}")


_WATCH = Watch()
_installed: list[bool] = []


@contextmanager
def watched(folder: Path) -> Iterator[None]:
    """Raise AssertionError when the block touches a file elsewhere, Hang when it takes long."""
    if not _installed:
        sys.addaudithook(_WATCH.hook)
        _installed.append(True)
    late: list[bool] = []
    used = time.process_time()

    def stop(number: int, _: object) -> None:
        nonlocal used
        before, used = used, time.process_time()
        if number == signal.SIGALRM and used - before > USED:
            return
        late.append(True)
        raise Hang(f"more than {SECONDS} s of a processor, or {WAITING} s without it")

    before = [signal.signal(number, stop) for _, number, _ in _CLOCKS]
    files = _listing(folder)
    _WATCH.faults.clear()
    _WATCH.folder = folder.resolve()
    for clock, _, seconds in _CLOCKS:
        signal.setitimer(clock, seconds, seconds)
    try:
        yield
    finally:
        for (clock, number, _), handler in zip(_CLOCKS, before, strict=True):
            signal.setitimer(clock, 0.0)
            signal.signal(number, handler)
        _WATCH.folder = None
    assert _WATCH.faults == [], _WATCH.faults
    assert _listing(folder) == files
    # A library that catches everything catches the alarm as well.
    assert not late


def _listing(folder: Path) -> list[str]:
    return sorted(str(path) for path in folder.rglob("*"))
