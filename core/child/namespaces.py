"""A process apart from the rest of the machine: namespaces of its own around a root of few folders.

Of the file system there is what `Walls` name, read-only, and an empty temporary folder; of other
processes, the network, System V objects and the host's name there is nothing. Three processes take
part: the caller, which waits; the first of the new namespace of processes, whose end ends all in
it; and the one that goes on, with no capability and without the system calls of `syscall_filter`.

Run as a program it tries whether this machine allows that, and needs the standard library alone.

Source: user_namespaces(7), mount_namespaces(7), pid_namespaces(7), pivot_root(2).
"""

from __future__ import annotations

import ctypes
import json
import os
import platform
import signal
import socket
import struct
import sys
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

_NEW_MOUNTS, _NEW_NAME, _NEW_IPC = 0x00020000, 0x04000000, 0x08000000
_NEW_USER, _NEW_PROCESSES, _NEW_NETWORK = 0x10000000, 0x20000000, 0x40000000
_READ_ONLY, _NO_SUID, _NO_DEV, _NO_EXEC = 1, 2, 4, 8
_BIND, _RECURSIVE, _PRIVATE = 4096, 16384, 2**18
_DETACH = 2
_ATTR_READ_ONLY, _ATTR_NO_SUID, _ATTR_NO_DEV = 1, 2, 4
_HERE, _WHOLE_TREE = -100, 0x8000  # AT_FDCWD, AT_RECURSIVE
_DROP_BOUND, _AMBIENT, _CLEAR_AMBIENT = 24, 47, 4
_CAPABILITY_VERSION = 0x20080522
_FLAGS_OF, _SET_FLAGS_OF, _UP = 0x8913, 0x8914, 1  # SIOCGIFFLAGS, SIOCSIFFLAGS, IFF_UP
_PIVOT_ROOT = {"x86_64": 155, "aarch64": 41}
_MOUNT_SETATTR = 442
_READER = "/bin/cat"
_INODES = 65536  # of the temporary folder
FAILED = 70  # exit code where the namespaces could not be made
FOLDER = "/own"  # /tmp may hold code that is shown
_DEVICES = ("null", "zero", "full", "random", "urandom")


@dataclass(frozen=True)
class Walls:
    """What there is inside.

    Arguments:
        shown: paths that are there, read-only, with what is below them.
        links: symbolic links and where they lead.
        hidden: folders below those that are empty.
    """

    shown: tuple[str, ...]
    links: tuple[tuple[str, str], ...] = ()
    hidden: tuple[str, ...] = ()


def go_apart(walls: Walls | None, at: str, room: int, processes: int) -> None:
    """Return in a new process within walls; the caller waits, and ends as that one does.

    Arguments:
        walls: what there is inside; with None only a namespace of processes is made, where that is
            possible, and the root, rights and network stay.
        at: an empty folder, used to build the new root.
        room: bytes that the temporary folder may hold.
        processes: that there may be, with their threads.

    Raises:
        OSError: where the system refuses the namespaces; this process may then have lost rights.
    """
    if walls is None and not _may_unshare():
        return
    _unshare(alone=walls is None)
    # The first process of the namespace, whose end ends all in it, is a program that reads until
    # the end, and small, where a copy of this process would be as large as this one. That it hears
    # of no signal from within makes it no place for a strategy: one that ends itself would go on.
    # Anyone who may look at it goes where its folder leads. From the root it moves to the new one.
    os.chdir("/")
    reads, alive = os.pipe()
    for descriptor in range(3, alive):
        with suppress(OSError):
            os.set_inheritable(descriptor, False)
    actions = [
        (os.POSIX_SPAWN_DUP2, reads, 0),
        *((os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_WRONLY, 0) for stream in (1, 2)),
    ]
    first = os.posix_spawn(_READER, [_READER], {}, file_actions=actions)
    os.close(reads)
    strategy = os.fork()
    if strategy:
        os.closerange(3, alive)
        _, status = os.waitpid(strategy, 0)
        os.close(alive)
        os.kill(first, signal.SIGKILL)
        os.waitpid(first, 0)
        code = os.waitstatus_to_exitcode(status)
        if code < 0:
            with suppress(OSError):
                signal.signal(-code, signal.SIG_DFL)
            os.kill(os.getpid(), -code)
            signal.pause()
        os._exit(code)
    os.close(alive)
    try:
        # The limit on a user's processes does not bind root, that on their numbers does.
        release = tuple(int(part) for part in platform.release().split(".")[:2])
        # Before Linux 6.14 the file is that of the whole machine.
        if release >= (6, 14):
            with suppress(OSError):
                _write("/proc/sys/kernel/pid_max", str(max(processes, 301)))
        if walls is None:
            with suppress(OSError):
                _mount("", "/", flags=_RECURSIVE | _PRIVATE)
                _mount("proc", "/proc", "proc", _NO_SUID | _NO_DEV | _NO_EXEC)
            os.chdir(at)
        else:
            _build(walls, at, room)
            # A loopback that leads to nobody else, and another name of the host.
            _call("sethostname", "a name", b"sandbox", 7)
            import fcntl

            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket, suppress(OSError):
                request = struct.pack("16sh14x", b"lo", 0)
                (flags,) = struct.unpack_from("16xh", fcntl.ioctl(any_socket, _FLAGS_OF, request))
                fcntl.ioctl(any_socket, _SET_FLAGS_OF, struct.pack("16sh14x", b"lo", flags | _UP))
            capability = 0
            while libc().prctl(_DROP_BOUND, capability, 0, 0, 0) == 0:
                capability += 1
            _call("prctl", "ambient capabilities", _AMBIENT, _CLEAR_AMBIENT, 0, 0, 0)
            head = struct.pack("=Ii", _CAPABILITY_VERSION, 0)
            _call("capset", "capabilities", head, bytes(24))
        os.setsid()
        import resource

        lower_limit(resource.RLIMIT_NPROC, processes)
    except Exception as error:
        os.write(2, f"no sandbox: {error}\n".encode())
        os._exit(FAILED)


def _may_unshare() -> bool:
    """Tell whether a namespace of processes is to be had.

    Another process tries it: one that may make a namespace of users and not write their map is
    good for nothing (Ubuntu 24.04).
    """
    if sys.platform != "linux" or not os.path.exists(_READER):
        return False
    trial = os.fork()
    if not trial:
        with suppress(OSError):
            _unshare(alone=True)
            os._exit(0)
        os._exit(FAILED)
    return os.waitpid(trial, 0)[1] == 0


def _unshare(*, alone: bool) -> None:
    """Let the next child begin namespaces of its own.

    Arguments:
        alone: whether one of processes is enough.

    Raises:
        OSError: as for `go_apart`.
    """
    user, group = os.geteuid(), os.getegid()
    wanted = _NEW_PROCESSES | _NEW_MOUNTS
    if not alone:
        wanted |= _NEW_NAME | _NEW_IPC | _NEW_NETWORK
    elif user == 0 and libc().unshare(wanted) == 0:  # keeps the rights of root
        return
    _call("unshare", "namespaces", wanted | _NEW_USER)
    _write("/proc/self/setgroups", "deny")
    _write("/proc/self/uid_map", f"{user} {user} 1")
    _write("/proc/self/gid_map", f"{group} {group} 1")


def lower_limit(what: int, wanted: int) -> None:
    """Lower a limit of this process, as far as it is not lower yet."""
    import resource

    # Where there is no limit, -1 stands for it.
    soft, hard = (min(wanted, given % 2**64) for given in resource.getrlimit(what))
    resource.setrlimit(what, (soft, hard))


def _build(walls: Walls, at: str, room: int) -> None:
    """Make a root of the paths of some walls, and make it the root of this namespace."""
    mask = os.umask(0o022)
    _mount("", "/", flags=_RECURSIVE | _PRIVATE)
    _mount("tmpfs", at, "tmpfs", _NO_SUID | _NO_DEV, "mode=755,size=1m")
    for path in walls.shown:
        _point(at + path, folder=os.path.isdir(path))
        _mount(path, at + path, flags=_BIND | _RECURSIVE)
    for path, target in walls.links:
        os.makedirs(os.path.dirname(at + path), exist_ok=True)
        os.symlink(target, at + path)
    for path in walls.hidden:
        if os.path.isdir(at + path):
            _mount("tmpfs", at + path, "tmpfs", _NO_SUID | _NO_DEV, "mode=755,size=4k")
    for name in ("proc", FOLDER.strip("/"), "dev", "etc"):
        os.makedirs(f"{at}/{name}", exist_ok=True)
    # Libraries ask for the name and the home of a user.
    user, group = os.geteuid(), os.getegid()
    _write(f"{at}/etc/passwd", f"judge:x:{user}:{group}::{FOLDER}:/bin/sh\n")
    _write(f"{at}/etc/group", f"judge:x:{group}:\n")
    for name in _DEVICES:
        _point(f"{at}/dev/{name}", folder=False)
    os.symlink(FOLDER, f"{at}/dev/shm")
    with suppress(FileExistsError):
        os.symlink(FOLDER, f"{at}/tmp")
    os.symlink("/proc/self/fd", f"{at}/dev/fd")
    _lock(at, _ATTR_READ_ONLY | _ATTR_NO_SUID | _ATTR_NO_DEV)
    for name in _DEVICES:
        _mount(f"/dev/{name}", f"{at}/dev/{name}", flags=_BIND)
        # It can be written to all the same, but whose it is and who may use it stays.
        _lock(f"{at}/dev/{name}", _ATTR_READ_ONLY | _ATTR_NO_SUID)
    limits = f"mode=700,size={room},nr_inodes={_INODES}"
    _mount("tmpfs", at + FOLDER, "tmpfs", _NO_SUID | _NO_DEV, limits)
    _mount("proc", f"{at}/proc", "proc", _READ_ONLY | _NO_SUID | _NO_DEV | _NO_EXEC)
    os.chdir(at)
    _call("syscall", "pivot_root", _PIVOT_ROOT[platform.machine()], b".", b".")
    _call("umount2", "the old root", b".", _DETACH)
    os.umask(mask)
    os.chdir(FOLDER)
    # What is open was opened outside, where it is not read-only.
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)


def _point(path: str, *, folder: bool) -> None:
    """Make a folder or file on which something can be mounted."""
    os.makedirs(path if folder else os.path.dirname(path), exist_ok=True)
    if not folder and not os.path.exists(path):
        os.close(os.open(path, os.O_CREAT | os.O_WRONLY, 0o644))


def _lock(at: str, attributes: int) -> None:
    """Give attributes to everything that is mounted at a path and below."""
    wanted = struct.pack("=QQQQ", attributes, 0, 0, 0)
    path, flags = os.fsencode(at), ctypes.c_uint(_WHOLE_TREE)
    size = ctypes.c_size_t(len(wanted))
    _call("syscall", "mount_setattr", _MOUNT_SETATTR, _HERE, path, flags, wanted, size)


@cache
def libc() -> Any:  # noqa: ANN401 - a library of C
    """Return the library of C."""
    return ctypes.CDLL(None, use_errno=True)


def _call(function: str, what: str, *arguments: object) -> None:
    if getattr(libc(), function)(*arguments) != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{function} of {what}: {os.strerror(number)}")


def _mount(source: str, target: str, kind: str = "", flags: int = 0, data: str = "") -> None:
    words = [os.fsencode(word) for word in (source, target, kind)]
    wanted = ctypes.c_ulong(flags)
    _call("mount", target, *words, wanted, os.fsencode(data) if data else None)


def _write(path: str, text: str) -> None:
    try:
        with open(path, "wb", buffering=0) as stream:
            stream.write(text.encode())
    except OSError as error:
        raise OSError(error.errno, f"write of {path}: {error.strerror}") from error


def main() -> None:
    """Try it with the walls and the folder on standard input; fail in one line."""
    given = json.load(sys.stdin)
    walls = Walls(given["shown"], given["links"], given["hidden"])
    try:
        go_apart(walls, given["at"], 2**20, 64)
        with open(f"{FOLDER}/written", "w") as stream:
            stream.write("yes")
    except OSError as error:
        os.write(2, f"no sandbox: {error.strerror}\n".encode())
        os._exit(FAILED)
    os._exit(0)


if __name__ == "__main__":
    main()
