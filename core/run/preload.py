"""Imported once by the process from which workers fork: what every job needs is there at once.

It holds no case, and of plugins those that come with femubench: what a stranger wrote is imported
in the process of its own job alone.
"""

from __future__ import annotations

import ctypes
import gc
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing import popen_forkserver  # noqa: F401 - every worker imports it

import scipy.linalg
import scipy.optimize
import scipy.sparse.linalg
import scipy.stats  # noqa: F401 - loaded for its time
from threadpoolctl import threadpool_limits

import femubench.core.drawing.prediction
import femubench.core.plugin.variants
import femubench.core.run.judging
import femubench.core.run.worker  # noqa: F401 - loaded for its time
from femubench.core.plugin.loader import load_plugins

_PR_SET_CHILD_SUBREAPER = 36
_OWN = ("strategies", "effects", "faults")


def own_plugins() -> Iterator[str]:
    """Load the plugins that come with femubench and yield the modules of what they offer."""
    found = load_plugins(strangers=False)
    for kind in _OWN:
        offers = getattr(found, kind)
        for name in offers:
            with suppress(Exception):  # a job that needs it says what is wrong with it
                yield type(offers[name]).__module__


LOADED = frozenset(own_plugins())
# What a job leaves behind becomes a child of this process, whose other children are known.
if sys.platform == "linux":
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    warnings.filterwarnings("ignore", "forkserver: waitpid returned unexpected pid")
threadpool_limits(1)
# Ctrl-C, kept back so far, is for the parent; whoever else imports this goes on hearing it.
if signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT,))
# Else the first search for garbage in a worker writes to, and so copies, every page of the server.
gc.collect()
gc.freeze()
