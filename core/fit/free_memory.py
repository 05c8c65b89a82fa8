"""Memory that is free goes back to the system: glibc keeps what large arrays leave behind."""

from __future__ import annotations

import ctypes
import sys


def give_back() -> None:
    """Return what is free to the system, where the C library can do so.

    Source: malloc_trim(3) of the GNU C library.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # musl has none
        if trim is not None:
            trim(0)
