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


@pytest.mark.parametrize("size", [(1440, 900), (390, 844)])
@pytest.mark.parametrize("kind", KINDS)
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


def test_a_point_beyond_the_edge_is_named_once(real: Any, view: Callable[..., Any]) -> None:
    found = view(real.page)
    far = plot.Series("s", [*FAR], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], names=NAMES)
    data = plot.Chart("scatter", "T", plot.Axis("time", "s"), plot.Axis("error"), (far,)).to_json()
    found.page.evaluate("data => document.querySelector('main').prepend(bench.draw(data))", data)
    labels = found.page.locator("figure.chart").first.locator("svg.canvas .label")
    labels.first.wait_for()
    assert sorted(labels.all_text_contents()) == [*NAMES[:5], "strategy 5 \u25b6 900"]
    found.assert_quiet(real.page)


ROWS = [("b", "2", ""), ("a", "", "second of a"), ("d", "10", ""), ("c", "2", "")]


def test_any_table_sorts_by_its_heads(real: Any, view: Callable[..., Any]) -> None:
    """Numbers as numbers, nothing last, equal rows as they came, what belongs to a row below it."""
    found = view(real.page)
    found.page.evaluate(
        """rows => {
            const { el } = bench;
            const line = ([name, value, more]) => [
              el("tr", {}, el("th", {}, name), el("td", { "data-value": value }, `<${value}>`)),
              more && el("tr", { class: "more" }, el("td", { colspan: 2 }, more))];
            const down = el("th", { "data-down": true }, "Value");
            const head = el("thead", {}, el("tr", {}, el("th", {}, "Name"), down));
            const table = el("table", { id: "tried" }, head, el("tbody", {}, rows.map(line)));
            document.querySelector("main").prepend(table);
            sortable(table);
        }""",
        ROWS,
    )
    table = found.page.locator("#tried")

    def order() -> str:
        texts = table.locator("tbody tr > :first-child").all_inner_texts()
        return " ".join(texts)

    value = table.get_by_role("button", name="Value")
    value.click()
    assert order() == "d b c a second of a"
    assert table.locator("th[aria-sort]").get_attribute("aria-sort") == "descending"
    value.focus()
    found.page.keyboard.press("Enter")
    assert order() == "b c d a second of a"
    table.get_by_role("button", name="Name").click()
    assert order() == "a second of a b c d"
    assert table.locator("th[aria-sort]").count() == 1
    found.assert_quiet(real.page)
