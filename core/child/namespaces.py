"""A process apart from the rest of the machine: namespaces of its own around a root of few folders.

Of the file system there is what `Walls` name, read-only, and an empty temporary folder; of other
processes, the network, System V objects and the host's name there is nothing. One process raises
the walls and forks all others into them, each into namespaces of its own, so that none sees what
another has left: there is the first of a namespace of processes, whose end ends all in it, and the
one that goes on, with no capability and without the system calls of `syscall_filter`.

Source: user_namespaces(7), mount_namespaces(7), pid_namespaces(7), pivot_root(2).
"""

from __future__ import annotations

import ctypes
import os
import platform
import socket
import struct
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, NoReturn

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
# How the children of a process are apart: all but code is elsewhere, or processes alone are.
Apart = Literal["walled", "alone"]


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


def raise_walls(walls: Walls | None, at: str) -> Apart:
    """Leave the files of this machine, and return how children can be apart.

    Arguments:
        walls: what there is inside; None where the files stay.
        at: an empty folder, used to build the new root.

    Raises:
        OSError: where the system refuses the namespaces; this process may then have lost rights.
    """
    if sys.platform != "linux":
        raise OSError("namespaces are of Linux")
    # Root keeps its rights.
    if walls is None or os.geteuid() != 0 or libc().unshare(_NEW_MOUNTS) != 0:
        own = os.open("/proc/self", os.O_PATH)
        _own_users(_NEW_MOUNTS, own)
        os.close(own)
    if walls is not None:
        _build(walls, at)
    os.chdir("/")  # one that may look at a process gets to its folder
    return "alone" if walls is None else "walled"


def fork_apart(apart: Apart, go_on: Callable[[], NoReturn]) -> tuple[int, int, int]:
    """Fork a process into namespaces of its own.

    The first one there, whose end ends all, is a program that reads until the end: it hears of no
    signal from within, so that a strategy in its place that ends itself would go on, and a copy of
    this process would be as large. What has made a namespace of processes forks into it ever
    after: a thread makes it, and ends.

    Arguments:
        apart: of this process, which has raised the walls.
        go_on: what the new process does; it begins with `settle`.

    Returns:
        Its number, that of the first process, and what to close so that the first one ends.

    Raises:
        OSError: where the system refuses it.
    """
    found: list[tuple[int, int, int] | OSError] = []

    def leave() -> None:
        reads, alive = os.pipe()
        try:
            more = (_NEW_NAME | _NEW_IPC | _NEW_NETWORK) * (apart == "walled")
            _call("unshare", "namespaces", _NEW_PROCESSES | _NEW_MOUNTS | more)
            actions = [
                (os.POSIX_SPAWN_DUP2, reads, 0),
                *((os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_WRONLY, 0) for stream in (1, 2)),
            ]
            first = os.posix_spawn(_READER, [_READER], {}, file_actions=actions)
            process = os.fork()
            if not process:
                os.close(alive)
                go_on()
            found.append((process, first, alive))
        except OSError as error:
            os.close(alive)
            found.append(error)
        os.close(reads)

    threading.stack_size(2**24)  # bytes, of the main thread there
    thread = threading.Thread(target=leave, name=threading.main_thread().name)
    thread.start()
    thread.join()
    if isinstance(found[0], OSError):
        raise found[0]
    return found[0]


def settle(apart: Apart, room: int, processes: int) -> None:
    """Make what a process from `fork_apart` has to itself, and give up its rights.

    Arguments:
        apart: of the process from which it was forked.
        room: bytes that its temporary folder may hold.
        processes: that there may be, with their threads.
    """
    try:
        # The limit on a user's processes does not bind root, that on their numbers does.
        release = tuple(int(part) for part in platform.release().split(".")[:2])
        # Before Linux 6.14 the file is that of the whole machine.
        if release >= (6, 14):
            with suppress(OSError):
                _write("/proc/sys/kernel/pid_max", str(max(processes, 301)))
        own = os.open("/proc/self", os.O_PATH)
        if apart == "alone":
            with suppress(OSError):
                _mount("", "/", flags=_RECURSIVE | _PRIVATE)
                _mount("proc", "/proc", "proc", _NO_SUID | _NO_DEV | _NO_EXEC)
        else:
            limits = f"mode=700,size={room},nr_inodes={_INODES}"
            _mount("tmpfs", FOLDER, "tmpfs", _NO_SUID | _NO_DEV, limits)
            _mount("proc", "/proc", "proc", _READ_ONLY | _NO_SUID | _NO_DEV | _NO_EXEC)
            os.chdir(FOLDER)
            # A loopback that leads to nobody else, and another name of the host.
            _call("sethostname", "a name", b"sandbox", 7)
            import fcntl

            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket, suppress(OSError):
                request = struct.pack("16sh14x", b"lo", 0)
                (flags,) = struct.unpack_from("16xh", fcntl.ioctl(any_socket, _FLAGS_OF, request))
                fcntl.ioctl(any_socket, _SET_FLAGS_OF, struct.pack("16sh14x", b"lo", flags | _UP))
        # Else a user's limit on processes would count those of all jobs.
        with suppress(OSError):
            _own_users(0, own)
        os.close(own)
        if apart == "walled":
            capability = 0
            while libc().prctl(_DROP_BOUND, capability, 0, 0, 0) == 0:
                capability += 1
            _call("prctl", "ambient capabilities", _AMBIENT, _CLEAR_AMBIENT, 0, 0, 0)
            head = struct.pack("=Ii", _CAPABILITY_VERSION, 0)
            _call("capset", "capabilities", head, bytes(24))
        import resource

        lower_limit(resource.RLIMIT_NPROC, processes)
    except Exception as error:
        os.write(2, f"no sandbox: {error}\n".encode())
        os._exit(FAILED)


def _own_users(wanted: int, own: int) -> None:
    """Be the one user of a namespace, with others of which that is the owner.

    Arguments:
        wanted: the others.
        own: the folder of this process in a file system of processes that can be written to.

    Raises:
        OSError: where the system refuses it.
    """
    user, group = os.geteuid(), os.getegid()
    _call("unshare", "namespaces", wanted | _NEW_USER)
    _write("setgroups", "deny", own)
    _write("uid_map", f"{user} {user} 1", own)
    _write("gid_map", f"{group} {group} 1", own)


def lower_limit(what: int, wanted: int) -> None:
    """Lower a limit of this process, as far as it is not lower yet."""
    import resource

    # Where there is no limit, -1 stands for it.
    soft, hard = (min(wanted, given % 2**64) for given in resource.getrlimit(what))
    resource.setrlimit(what, (soft, hard))


def _build(walls: Walls, at: str) -> None:
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
    # Hidden by that of each job; where none is seen, none may be mounted, and none is written to.
    _mount("/proc", f"{at}/proc", flags=_BIND | _RECURSIVE)
    os.chdir(at)
    _call("syscall", "pivot_root", _PIVOT_ROOT[platform.machine()], b".", b".")
    _call("umount2", "the old root", b".", _DETACH)
    os.umask(mask)


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


def _write(path: str, text: str, own: int | None = None) -> None:
    """Write to a file, which may be one of the folder of a process."""
    try:
        file = os.open(path, os.O_WRONLY | os.O_CREAT, 0o644, dir_fd=own)
        with open(file, "wb", buffering=0) as stream:
            stream.write(text.encode())
    except OSError as error:
        where = os.path.join("/proc/self", path)
        raise OSError(error.errno, f"write of {where}: {error.strerror}") from error
