"""Charts of `plot.Chart` in a page: the numbers of the data, by keyboard and as a table."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from femubench import plot
from femubench.core.plot.chart import KINDS

NAMES = [f"strategy {k}" for k in range(6)]
FAR = [1.0, 1.1, 1.2, 1.3, 1.4, 900.0]


def chart(kind: Any) -> plot.Chart:
    number, name = plot.Axis("ratio", "%"), plot.Axis("name", names=tuple(NAMES))
    if kind == "cells":
        return plot.Chart(
            kind, "T", name, plot.Axis("row", names=("r",)), values=[FAR], value=number
        )
    if kind == "interval":
        ends = [v - 0.1 for v in FAR], [v + 0.1 for v in FAR]
        return plot.Chart(kind, "T", number, name, (plot.Series("s", FAR, NAMES, *ends),))
    if kind == "bars":
        return plot.Chart(kind, "T", name, number, (plot.Series("s", NAMES, FAR),))
    series = plot.Series("s", [0.0, 0.2, 0.4, 0.6, 0.8, 1.0], FAR)
    return plot.Chart(kind, "T", plot.Axis("level"), number, (series,))


@pytest.mark.parametrize(
    ("kind", "size"), [(kind, ((1440, 900), (390, 844))[k % 2]) for k, kind in enumerate(KINDS)]
)
def test_a_chart_shows_the_numbers_of_its_data(
    kind: str, size: tuple[int, int], real: Any, view: Callable[..., Any]
) -> None:
    found = view(real.page, size=size)
    drawn = """data => {
        const node = bench.draw(data);
        node.id = "tried";
        document.querySelector("main").prepend(node);
    }"""
    found.page.evaluate(drawn, chart(kind).to_json())
    figure = found.page.locator("#tried")
    figure.locator("svg.canvas").last.wait_for()
    figure.locator("summary").click()
    values = figure.locator("td[data-value]").evaluate_all(
        "cells => cells.map(c => c.dataset.value)"
    )
    assert {repr(v) for v in FAR} - {"1.0", "900.0"} <= set(values)
    assert {"1", "900"} <= set(values)
    if kind != "cells":
        assert "900" in figure.locator("svg.canvas").last.text_content()
    plot_of = figure.locator(".plot")
    plot_of.focus()
    found.page.keyboard.press("ArrowRight")
    found.page.keyboard.press("End")
    assert "900" in figure.locator(".readout").text_content()
    assert found.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    found.assert_quiet(real.page)
