"""Work on many small objects without the collector of garbage, which would look at each again."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def pause_collection() -> Iterator[None]:
    """Look for no circles of references meanwhile; also a decorator.

    Results have none, and to look for them while there are more and more takes half as long as to
    read or to rank them.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
