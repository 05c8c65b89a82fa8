"""What a worker has loaded; a module of its own, since a worker imports what it is to run."""

from __future__ import annotations

import os
import sys


def loaded(_: object) -> bytes:
    """Return the names of all modules."""
    return "\n".join(sys.modules).encode()


def variables(_: object) -> bytes:
    """Return the environment but for values with spaces."""
    return "\n".join(f"{k}={v}" for k, v in os.environ.items() if not set(v) & set(" \n")).encode()
