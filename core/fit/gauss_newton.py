"""The bounded step of damped Gauss-Newton iterations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from femubench.core.typing import BoolArray, FloatArray


def bounded_step(
    solve: Callable[[BoolArray], FloatArray],
    at: FloatArray,
    low: FloatArray,
    high: FloatArray,
    longest: float,
) -> FloatArray:
    """Return a step on which no coordinate at a limit leaves its range, shortened as a whole.

    Coordinates that would leave are held and the rest is solved again, until none would. Off the
    limits a step may lead beyond them: clip where it ends.

    Arguments:
        solve: from which of the k coordinates are free (k,) to their step, the others held.
        at: the coordinates, (k,).
        low, high: their limits, (k,).
        longest: largest component of a step.
    """
    step = np.zeros(len(at))
    free = np.ones(len(at), dtype=bool)
    while free.any():
        step[:] = 0.0
        step[free] = solve(free)
        stuck = free & (((at <= low) & (step < 0.0)) | ((at >= high) & (step > 0.0)))
        if not stuck.any():
            break
        free &= ~stuck
    size = float(np.abs(step).max(initial=0.0))
    return step * min(1.0, longest / size) if size > 0.0 else step
