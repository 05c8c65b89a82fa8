"""Imported once by the process from which workers fork: what every job needs is there at once.

It holds no case and no strategy.
"""

from __future__ import annotations

import scipy.linalg
import scipy.optimize
import scipy.sparse.linalg  # noqa: F401 - loaded for its time
from threadpoolctl import threadpool_limits

import femubench.core.run.judging
import femubench.core.run.worker  # noqa: F401 - loaded for its time

threadpool_limits(1)
