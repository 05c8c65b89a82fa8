"""Order and choice that do not turn on rounding: figures that tie keep the order they came in."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from math import inf, log
from typing import TypeVar

import numpy as np

from femubench.core.typing import FloatArray, IntArray

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
# Costs and log evidences of mirrored places differ by some 1e-9 of their size, as the kernels of
# linear algebra add up; what differs by a thousandth of a nat or less decides nothing anyway.
_RELATIVE, _ABSOLUTE = 1e-7, 1e-6


def _margin(value: FloatArray | float, absolute: float = _ABSOLUTE) -> FloatArray:
    return np.asarray(_RELATIVE * np.abs(value) + absolute)


def alike(one: float, other: float) -> bool:
    """Tell whether two figures differ by no more than rounding may have made."""
    return bool(abs(one - other) <= _margin(other))


def in_order(items: Iterable[T], figure: Callable[[T], float]) -> list[T]:
    """Return items by ascending figure, those that tie with the first of a run as they came.

    Arguments:
        items: in the order that decides ties, such as that of effects and places.
        figure: a cost, or minus a log evidence.
    """
    given = list(items)
    figures = np.array([figure(item) for item in given], dtype=float)
    result: list[T] = []
    run: list[int] = []
    for i in np.argsort(figures, kind="stable"):
        if run and not figures[i] <= figures[run[0]] + _margin(figures[run[0]]):
            result += [given[j] for j in sorted(run)]
            run = []
        run.append(int(i))
    return result + [given[j] for j in sorted(run)]


def least(figures: FloatArray, absolute: float = _ABSOLUTE) -> IntArray:
    """Return the first along the last axis of those that tie for the least.

    Arguments:
        figures: costs, (..., n).
        absolute: difference that counts as rounding; 0 for figures of any unit.
    """
    low = figures.min(axis=-1, keepdims=True)
    return np.asarray((figures <= low + _margin(low, absolute)).argmax(axis=-1))


def by_probability(shares: Mapping[K, float]) -> list[K]:
    """Return keys, most probable first; those that tie as they came."""
    return in_order(shares, lambda key: -log(shares[key]) if shares[key] > 0.0 else inf)
