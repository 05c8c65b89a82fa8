"""System calls that a strategy has no use for, refused by the kernel.

They make namespaces and mounts, hold memory that no count of a process shows (memfd, System V
shared memory, message queues, io_uring, vmsplice), hide what a process has open, reach into other
processes or the kernel's key rings, or make sockets that know no namespace of networks (those
between virtual machines, say).

Source: Linux, Documentation/userspace-api/seccomp_filter.rst; numbers from asm/unistd_64.h (x86-64)
and asm-generic/unistd.h (AArch64).
"""

from __future__ import annotations

import ctypes
import errno
import platform
import struct
import sys

_PR_SET_SECCOMP, _MODE_FILTER, _PR_SET_NO_NEW_PRIVS = 22, 2, 38
_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_NUMBER_AT, _ARCH_AT, _FIRST_AT = 0, 4, 16  # in struct seccomp_data
_ALLOW, _ERROR = 0x7FFF0000, 0x00050000
_SET_DUMPABLE = 4  # of prctl: who is not dumpable shows nobody what it has open
_X32 = 0x40000000  # numbers from here on are the calls of another interface
_NEW_NAMESPACE = 0x7E020000  # every CLONE_NEW... flag of clone
_FAMILIES = (1, 2, 10, 16)  # AF_UNIX, AF_INET, AF_INET6, AF_NETLINK
_CLONE3 = 435  # its flags lie in memory, where a filter cannot look; glibc falls back to clone

# Audit architecture, numbers of clone, prctl, socket and socketpair, and of what is refused.
_OWN = {
    "x86_64": (
        0xC000003E,
        (56, 157, 41, 53),
        {
            **{"unshare": 272, "setns": 308, "mount": 165, "umount2": 166, "pivot_root": 155},
            **{"chroot": 161, "memfd_create": 319, "shmget": 29, "msgget": 68, "semget": 64},
            **{"mq_open": 240, "add_key": 248, "request_key": 249, "keyctl": 250, "ptrace": 101},
            **{"process_vm_readv": 310, "process_vm_writev": 311, "perf_event_open": 298},
            **{"bpf": 321, "userfaultfd": 323, "name_to_handle_at": 303, "kcmp": 312},
            **{"open_by_handle_at": 304, "fanotify_init": 300, "syslog": 103},
            **{"vmsplice": 278},
        },
    ),
    "aarch64": (
        0xC00000B7,
        (220, 167, 198, 199),
        {
            **{"unshare": 97, "setns": 268, "mount": 40, "umount2": 39, "pivot_root": 41},
            **{"chroot": 51, "memfd_create": 279, "shmget": 194, "msgget": 186, "semget": 190},
            **{"mq_open": 180, "add_key": 217, "request_key": 218, "keyctl": 219, "ptrace": 117},
            **{"process_vm_readv": 270, "process_vm_writev": 271, "perf_event_open": 241},
            **{"bpf": 280, "userfaultfd": 282, "name_to_handle_at": 264, "kcmp": 272},
            **{"open_by_handle_at": 265, "fanotify_init": 262, "syslog": 116},
            **{"vmsplice": 75},
        },
    ),
}
_COMMON = {
    **{"open_tree": 428, "move_mount": 429, "fsopen": 430, "fsconfig": 431, "fsmount": 432},
    **{"fspick": 433, "mount_setattr": 442, "io_uring_setup": 425, "pidfd_getfd": 438},
    **{"memfd_secret": 447},
}


def knows_processor() -> bool:
    """Tell whether the numbers of this processor's system calls are known."""
    return platform.machine() in _OWN and sys.byteorder == "little" and sys.maxsize > 2**32


def refuse_system_calls() -> None:
    """Refuse them to this process and all that it starts, for good.

    Raises:
        OSError: where the kernel has no such filters.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    code = _program()
    kept = ctypes.create_string_buffer(code, len(code))
    # struct sock_fprog: the number of instructions, padding, and where they are.
    head = struct.pack("@HP", len(code) // 8, ctypes.addressof(kept))
    zero = ctypes.c_ulong(0)
    if libc.prctl(_PR_SET_NO_NEW_PRIVS, ctypes.c_ulong(1), zero, zero, zero) or libc.prctl(
        _PR_SET_SECCOMP, ctypes.c_ulong(_MODE_FILTER), ctypes.c_char_p(head), zero, zero
    ):
        raise OSError(ctypes.get_errno(), "no filter of system calls")


def _program() -> bytes:
    """Return the filter: refused calls fail with EPERM, and clone3 as if there were none."""
    arch, (clone, prctl, *sockets), own = _OWN[platform.machine()]
    numbers = sorted({**own, **_COMMON}.values())
    # The lines after the head and the numbers, to which is jumped.
    flags = 7 + len(sockets) + len(numbers)
    hiding = flags + 2
    family = hiding + 2
    allow = family + 1 + len(_FAMILIES)
    refuse, missing = allow + 1, allow + 2
    lines: list[tuple[int, int, int | None, int | None]] = [
        (_LOAD, _ARCH_AT, None, None),
        (_EQUAL, arch, None, refuse),
        (_LOAD, _NUMBER_AT, None, None),
        (_AT_LEAST, _X32, refuse, None),
        (_EQUAL, _CLONE3, missing, None),
        (_EQUAL, clone, flags, None),
        (_EQUAL, prctl, hiding, None),
        *((_EQUAL, number, family, None) for number in sockets),
        *((_EQUAL, number, refuse, None) for number in numbers),
    ]
    lines[-1] = (*lines[-1][:3], allow)
    lines += [
        (_LOAD, _FIRST_AT, None, None),
        (_ANY_BIT, _NEW_NAMESPACE, refuse, allow),
        (_LOAD, _FIRST_AT, None, None),
        (_EQUAL, _SET_DUMPABLE, refuse, allow),
        (_LOAD, _FIRST_AT, None, None),
        *((_EQUAL, known, allow, None) for known in _FAMILIES),
    ]
    lines[-1] = (*lines[-1][:3], refuse)
    lines += [
        (_RETURN, _ALLOW, None, None),
        (_RETURN, _ERROR | errno.EPERM, None, None),
        (_RETURN, _ERROR | errno.ENOSYS, None, None),
    ]
    return b"".join(_instruction(at, *line) for at, line in enumerate(lines))


def _instruction(at: int, code: int, value: int, yes: int | None, no: int | None) -> bytes:
    """Return one instruction; where it jumps to is a line, or the next one."""
    jumps = [0 if line is None else line - at - 1 for line in (yes, no)]
    return struct.pack("=HBBI", code, *jumps, value)
