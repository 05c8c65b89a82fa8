"""What tests have done in children: calls of calls, lower limits, a look around."""

from __future__ import annotations

import json
import os
import resource
import time
from pathlib import Path
from typing import Any

from femubench.core.child.namespaces import lower_limit
from femubench.core.child.workers import call_apart


def call_again(folder: str) -> bytes:
    """Call a function in a process of this process; return how that ended and what is left."""
    inner = call_apart(str.encode, "inner", 60.0, 2**31, "femubench.core.child.limits")
    left = sorted(path.name for path in Path(folder).glob("femubench-*"))
    return json.dumps([inner.how, inner.reason, left]).encode()


def hoard(count: int) -> bytes:
    """Hold so many bytes for a minute."""
    held = b"x" * count
    time.sleep(60.0)
    return held[:1]


def shout(count: int) -> bytes:
    """Print so many bytes, and wait for a minute."""
    print("x" * count, flush=True)
    return hoard(1)


def lowered(given: tuple[int, int]) -> bytes:
    """Return the limit on open files after a soft limit of this process and another wanted one."""
    soft, wanted = given
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    lower_limit(resource.RLIMIT_NOFILE, wanted)
    return json.dumps(resource.getrlimit(resource.RLIMIT_NOFILE)).encode()


def namespace(*_: Any) -> dict[str, str]:
    """Answer a question to a plugin with the namespace of processes that it is asked in."""
    return {"namespace": os.readlink("/proc/self/ns/pid")}
