"""Charts as plain data: their numbers are drawn, and what lies far off is stated at the edge."""

from __future__ import annotations

import json
import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection

from femubench import plot
from femubench.core.plot.chart import KINDS, ends_of


def chart(kind: Any, **more: Any) -> plot.Chart:
    x, y = ([1.0, 2.0, 3.0], [0.4, None, 0.6])
    series = plot.Series("one", x, y, [0.3, None, 0.5], [0.5, None, 0.8])
    if kind == "interval":
        series = plot.Series("one", y, ["a", "b", "c"], series.low, series.high)
    if kind == "bars":
        series = plot.Series("one", ["a", "b", "c"], y)
    axes = plot.Axis("level"), plot.Axis("share", "%")
    if kind == "cells":
        names = [plot.Axis(title, names=("p", "q")) for title in ("across", "down")]
        return plot.Chart("cells", "C", *names, values=[[1.0, 2.0], [None, 4.0]], value=axes[1])
    return plot.Chart(kind, f"A {kind}", *axes, (series,), **more)


def dots(ax: Axes) -> list[list[float]]:
    return [
        [float(v) for v in np.asarray(point)]
        for found in ax.collections
        if isinstance(found, PathCollection)
        for point in np.asarray(found.get_offsets())
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_drawn_and_is_json(kind: Any) -> None:
    given = chart(kind)
    data = json.loads(json.dumps(given.to_json(), allow_nan=False))
    assert data["kind"] == kind
    assert data["x"]["label"] in given.draw().get_xlabel()
    text = plot.svg(partial(given.draw), name=kind, title=given.title, caption="", themed=True)
    assert text.startswith("<svg")


def test_what_is_not_known_is_not_drawn() -> None:
    assert dots(chart("scatter").draw()) == [[1.0, 0.4], [3.0, 0.6]]
    assert dots(chart("interval").draw()) == [[0.4, 0.0], [0.6, 2.0]]
    heights = [bar.get_height() for bar in chart("bars").draw().patches]
    assert np.allclose(heights, [0.4, 0.6])
    grid = np.ma.filled(chart("cells").draw().get_images()[0].get_array(), np.nan)  # type: ignore[no-untyped-call]
    assert np.allclose(grid, [[1.0, 2.0], [np.nan, 4.0]], equal_nan=True)


def test_ends_are_those_of_the_values_where_none_is_far_off() -> None:
    linear, log = plot.Axis("x"), plot.Axis("x", log=True)
    assert ends_of([1.0, 2.0, 3.0], linear, pad=0.0, few=1) == (1.0, 3.0)
    assert ends_of([5.0], linear, pad=0.1, few=1) == (4.5, 5.5)
    assert ends_of([], linear, pad=0.0, few=1) == (0.0, 1.0)
    assert np.allclose(ends_of([0.0, -1.0, 0.01, 10.0], log, pad=0.0, few=1), (0.01, 10.0))
    assert ends_of([2.0, 4.0], linear, pad=0.5, few=1, zero=True) == (0.0, 6.0)
    assert ends_of([1.0, 9.0], plot.Axis("x", low=-1.0), pad=0.0, few=1) == (-1.0, 9.0)
    assert ends_of([math.nan, None, math.inf, 3.0, 4.0], linear, pad=0.0, few=1) == (3.0, 4.0)
    # The spread of the rest is nothing to compare with.
    assert ends_of([1.0] * 9 + [50.0], linear, pad=0.0, few=1) == (1.0, 50.0)
