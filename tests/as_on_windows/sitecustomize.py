"""An interpreter in which femubench finds what it would on Windows: Python loads this on its path.

Modules of femubench alone see it; those of others have ways of their own there.
"""

from __future__ import annotations

import builtins
from types import ModuleType
from typing import Any

GONE = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
LACKING = {
    "os": "O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK O_PATH POSIX_SPAWN_DUP2 SCHED_OTHER WNOHANG "
    "chown chroot fchown fork forkpty geteuid getegid getgid getloadavg getpgid getsid getuid "
    "killpg lockf mkfifo nice pidfd_open posix_fallocate posix_spawn pread pwrite "
    "register_at_fork sched_getaffinity sched_setaffinity setpgid setsid statvfs sysconf uname "
    "wait wait3 wait4 waitid",
    "select": "POLLIN POLLOUT epoll poll",
    "signal": "ITIMER_REAL SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGSTOP SIGUSR1 SIGXFSZ "
    "SIG_BLOCK SIG_UNBLOCK alarm pause pthread_sigmask setitimer sigwait",
    "socket": "AF_UNIX CMSG_LEN SCM_RIGHTS recv_fds send_fds",
    "sys": "abiflags",
}
STATED = {"sys": {"platform": "win32"}, "os": {"name": "nt"}}


class AsOnWindows(ModuleType):
    """A module without what it has on other systems alone."""

    def __init__(self, real: ModuleType) -> None:
        self.__dict__["real"] = real

    def __getattr__(self, name: str) -> Any:
        own = self.real.__name__
        if name in LACKING[own].split():
            raise AttributeError(f"module {own!r} has no attribute {name!r} on Windows", name=name)
        return STATED.get(own, {}).get(name) or getattr(self.real, name)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(self.real, name, value)


real_import = builtins.__import__
shown: dict[str, ModuleType] = {}


def refusing(name: str, globals: Any = None, *more: Any, **words: Any) -> ModuleType:
    """Import as `__import__` does."""
    if not str((globals or {}).get("__name__")).startswith("femubench"):
        return real_import(name, globals, *more, **words)
    if name in GONE:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    found = real_import(name, globals, *more, **words)
    return shown.setdefault(name, AsOnWindows(found)) if name in LACKING else found


builtins.__import__ = refusing
