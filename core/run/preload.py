"""What every job needs, loaded once by the process from which workers fork.

It holds no case, and of plugins those that come with femubench: others are imported in the process
of their own job alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import scipy.linalg
import scipy.optimize
import scipy.sparse.linalg
import scipy.stats  # noqa: F401 - loaded for its time
from threadpoolctl import threadpool_limits

import femubench.core.drawing.prediction
import femubench.core.plugin.variants
import femubench.core.run.standing_judge  # noqa: F401 - loaded for its time
from femubench.core.plugin.loader import load_plugins

_OWN = ("strategies", "effects", "faults")


def own_plugins() -> Iterator[str]:
    """Load the plugins that come with femubench and yield the modules of what they offer."""
    found = load_plugins(third_parties=False)
    for kind in _OWN:
        offers = getattr(found, kind)
        for name in offers:
            with suppress(Exception):  # a job that needs it says what is wrong with it
                yield type(offers[name]).__module__


LOADED = frozenset(own_plugins())
threadpool_limits(1)
