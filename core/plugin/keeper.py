"""Puts questions to plugins of strangers, each in a process that ends with all that it started.

It runs in a process of its own and imports no plugin itself. Where Linux allows it, every question
is answered in a namespace of processes, which can signal or look into none outside it and of which
nothing is left afterwards; elsewhere in a session whose orphans come back to this process. What
needs no file of anybody is answered in the sandbox of strategies, where that is possible.
"""

from __future__ import annotations

import ctypes
import json
import os
import resource
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NoReturn

HEAD = 8  # bytes that tell the length of what follows
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_NEW_MOUNTS, _NEW_USER, _NEW_PROCESSES = 0x20000, 0x10000000, 0x20000000
_MS_NOSUID, _MS_NODEV, _MS_NOEXEC, _MS_PRIVATE, _MS_REC = 2, 4, 8, 1 << 18, 1 << 14
_LEAST_MEMORY = 4 * 2**30  # bytes of address space that every question may take
_LARGEST_FILE = 2**30
_MOST_PROCESSES = 256  # in a namespace
_SIGNALLED = 128  # added to the number of a signal by who passes the end of a process on
_ROOM = 2**28  # bytes that the temporary folder in a sandbox may hold
_INSIDE = b"\1"  # said by who is in the sandbox, before any plugin is imported
_END = 5.0  # s that is spent on ending what was left behind
_CHUNK = 2**16
_PAUSE = 0.001  # s
_TICK = 0.2  # s between two looks at who has ended

exit_now = os._exit  # before anybody puts something else there
Answer = Callable[[dict[str, Any]], dict[str, Any]]
Enter = Callable[[str], None]


@dataclass
class _Asked:
    """A question on its way.

    Arguments:
        number, question: what was asked.
        walled: whether a sandbox was to be entered first.
        process, pipe: who answers, and where.
        deadline, seconds: when it has had its time, on the monotonic clock, and how much that is.
        most: bytes that the answer may have.
    """

    number: int
    question: dict[str, Any]
    process: int
    pipe: int
    deadline: float
    seconds: float
    most: int
    walled: bool
    received: bytearray = field(default_factory=bytearray)

    @property
    def start(self) -> int:
        """Return where the answer begins, behind its length."""
        return HEAD + (len(_INSIDE) if self.walled else 0)

    @property
    def length(self) -> int:
        """Return the length that the answer is said to have; -1 before it is known."""
        told = self.received[self.start - HEAD : self.start]
        return int.from_bytes(told, "big") if len(told) == HEAD else -1

    @property
    def complete(self) -> bool:
        """Tell whether the whole answer is there."""
        return 0 <= self.length <= len(self.received) - self.start


def main(answer: Answer, way_in: Callable[[int, int], Enter | None], at: str) -> None:
    """Read questions from standard input and write what became of each to standard output.

    Arguments:
        answer: from a question to plain data; called in a process of its own.
        way_in: from room and number of processes to what enters a sandbox; see `way_in` there.
        at: an empty folder for it.
    """
    questions = json.loads(sys.stdin.buffer.read())
    out = os.dup(1)
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    _call("prctl", _PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    _call("prctl", _PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    walled = any(question.get("walled") for question in questions)
    enter = way_in(_ROOM, _MOST_PROCESSES) if walled else None
    inside = None if enter is None else partial(enter, at)
    found = json.dumps(_all(questions, answer, inside)).encode()
    _end_children()
    write(out, found)


def write(descriptor: int, data: bytes) -> None:
    """Write all bytes."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view[:_CHUNK]) :]


def _all(
    questions: list[dict[str, Any]], answer: Answer, enter: Callable[[], None] | None
) -> list[dict[str, str]]:
    """Return for every question what was ``said``, as text, or why the answer was ``lost``."""
    found: list[dict[str, str]] = [{} for _ in questions]
    waiting, running = list(enumerate(questions)), list[_Asked]()
    most = os.cpu_count() or 1
    while waiting or running:
        while waiting and len(running) < most:
            running.append(_begin(*waiting.pop(0), answer, enter))
        for asked in list(_over(running)):
            running.remove(asked)
            told = _told(asked)
            # Where the sandbox was not entered no plugin has been imported yet.
            if asked.walled and not asked.received:
                waiting.append((asked.number, {**asked.question, "walled": False}))
            else:
                found[asked.number] = told
    return found


def _over(running: list[_Asked]) -> Iterator[_Asked]:
    """Wait a while; yield whoever has answered, has gone, or has had its time."""
    wait = max(0.0, min(asked.deadline for asked in running) - time.monotonic())
    ready, _, _ = select.select([asked.pipe for asked in running], [], [], min(wait, _TICK))
    for asked in running:
        if asked.pipe in ready:
            data = os.read(asked.pipe, _CHUNK)
            asked.received += data
            over = not data or asked.complete or asked.length > asked.most
        else:
            options = os.WEXITED | os.WNOHANG | os.WNOWAIT
            over = os.waitid(os.P_PID, asked.process, options) is not None
        if over or time.monotonic() >= asked.deadline:
            yield asked


def _told(asked: _Asked) -> dict[str, str]:
    """End a process and return what it said, or how it ended."""
    late = time.monotonic() >= asked.deadline
    os.close(asked.pipe)
    if asked.length > asked.most:
        _end(asked.process)
        return {"lost": f"what it told was larger than {asked.most} bytes"}
    if asked.complete:
        _end(asked.process)
        text = bytes(asked.received[asked.start : asked.start + asked.length]).decode(
            "utf-8", "replace"
        )
        return {"said": text}
    code = None if late else _ended(asked.process)
    if code is None:
        _end(asked.process)
        return {"lost": f"no answer within {asked.seconds:g} s"}
    if code > _SIGNALLED:
        with suppress(ValueError):
            return {"lost": f"its process was ended by {signal.Signals(code - _SIGNALLED).name}"}
    return {"lost": f"its process ended with exit code {code}"}


def _ended(process: int) -> int | None:
    """Return the exit code of a process whose pipe is closed; None where it lives on."""
    until = time.monotonic() + 1.0
    while time.monotonic() < until:
        gone, status = os.waitpid(process, os.WNOHANG)
        if gone:
            return _code(status)
        time.sleep(0.005)
    return None


def _code(status: int) -> int:
    code = os.waitstatus_to_exitcode(status)
    return code if code >= 0 else _SIGNALLED - code


def _end(process: int) -> None:
    _kill(process)
    with suppress(ChildProcessError):
        os.waitpid(process, 0)


def _kill(process: int) -> None:
    for end in (os.killpg, os.kill):
        with suppress(ProcessLookupError, PermissionError):
            end(process, signal.SIGKILL)


def _end_children() -> None:
    """End what lost its parents, and so became a child of this process, until nothing is left."""
    until = time.monotonic() + _END
    while time.monotonic() < until:
        with suppress(OSError, ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        try:
            with open(f"/proc/self/task/{os.getpid()}/children") as listed:
                left = [int(word) for word in listed.read().split()]
        except OSError:
            return
        if not left:
            return
        # The first process of a namespace ends when all others of it have been waited for.
        for process in left:
            _kill(process)
        time.sleep(_PAUSE)


def _begin(
    number: int, question: dict[str, Any], answer: Answer, enter: Callable[[], None] | None
) -> _Asked:
    """Start the process that answers a question."""
    walled = enter is not None and bool(question.get("walled"))
    mine, its = os.pipe()
    process = os.fork()
    if process == 0:
        try:
            _apart(enter if walled else None)
            if walled:
                write(its, _INSIDE)
            _speak(its, question, answer)
        finally:
            exit_now(1)
    os.close(its)
    seconds = question["seconds"]
    deadline = time.monotonic() + seconds
    most = question["most"]
    return _Asked(number, question, process, mine, deadline, seconds, most, walled)


def _speak(pipe: int, question: dict[str, Any], answer: Answer) -> NoReturn:
    """Answer a question into a pipe and end, whatever threads there are."""
    os.closerange(3, pipe)
    os.closerange(pipe + 1, os.sysconf("SC_OPEN_MAX"))
    data = json.dumps(answer(question)).encode()
    write(pipe, len(data).to_bytes(HEAD, "big") + data)
    exit_now(0)


def _apart(enter: Callable[[], None] | None) -> None:
    """Go on in a session of its own, with limits, and in a namespace of processes if possible.

    Arguments:
        enter: enters a sandbox instead; None for none.
    """
    os.setsid()
    _call("prctl", _PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if enter is not None:
        enter()
    alone = enter is not None or _in_namespace()
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    _lower(resource.RLIMIT_AS, max(_LEAST_MEMORY, physical // 2))
    _lower(resource.RLIMIT_CORE, 0)
    _lower(resource.RLIMIT_FSIZE, _LARGEST_FILE)
    if alone:
        _lower(resource.RLIMIT_NPROC, _MOST_PROCESSES)


def _lower(what: int, wanted: int) -> None:
    _, hard = resource.getrlimit(what)
    most = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    resource.setrlimit(what, (most, most))


def _in_namespace() -> bool:
    """Go on as the second process of a new namespace; tell whether there is one."""
    if not _unshared():
        return False
    _passing_on(os.fork())
    # Of a namespace the first process survives what is below it; its end is the end of all.
    _call("prctl", _PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    _call("mount", b"none", b"/", None, _MS_REC | _MS_PRIVATE, None)
    flags = _MS_NOSUID | _MS_NODEV | _MS_NOEXEC
    _call("mount", b"proc", b"/proc", b"proc", flags, None)
    _passing_on(os.fork())
    return True


def _passing_on(process: int) -> None:
    """Wait for a child and end as it does; the child goes on."""
    if process == 0:
        return
    os.closerange(0, os.sysconf("SC_OPEN_MAX"))
    while True:
        gone, status = os.wait()
        if gone == process:
            exit_now(_code(status))


def _unshared() -> bool:
    """Let the next child begin a namespace of processes; tell whether it will."""
    user, group = os.geteuid(), os.getegid()
    if user == 0 and _call("unshare", _NEW_PROCESSES | _NEW_MOUNTS) == 0:
        return True
    if _call("unshare", _NEW_USER | _NEW_PROCESSES | _NEW_MOUNTS) != 0:
        return False
    try:
        for name, text in (
            ("setgroups", "deny"),
            ("uid_map", f"{user} {user} 1"),
            ("gid_map", f"{group} {group} 1"),
        ):
            with open(f"/proc/self/{name}", "w") as file:
                file.write(text)
    except OSError:  # nobody, then: what is readable for all still is
        pass
    return True


def _call(name: str, *arguments: object) -> int:
    """Call a function of the C library; -1 where it is not there."""
    if sys.platform != "linux":
        return -1
    function = getattr(ctypes.CDLL(None), name, None)
    return -1 if function is None else int(function(*arguments))
