"""Names that are markup show as text; pages stay small."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from synthetic_run import synthetic_run

from femubench.core.schema.records import to_plain
from femubench.reports.htmls import HtmlReporter
from femubench.results import RunData, run_to_json

SCRIPT = "<script>alert(1)</script>"
TITLE = """Frame "of" 'quotes' </table></script><img src=x onerror=alert(2)> & more"""
FORMULA = '=HYPERLINK("http://example.invalid","x")'
MEBI = 2**20


def hostile() -> RunData:
    """Return a run whose names, titles, reasons, citations and parameters are markup."""
    run = synthetic_run(6, 4, names=(SCRIPT, FORMULA))
    cases = {name: {**about, "title": TITLE} for name, about in run.meta["cases"].items()}
    meta = {**run.meta, "cases": cases, "notes": [TITLE]}
    meta["citations"] = dict.fromkeys(run.meta["strategies"], TITLE)
    results = [
        replace(
            result,
            reason=TITLE if result.status != "ok" else "",
            parameters=tuple({**item, "name": SCRIPT} for item in result.parameters),
        )
        for result in run.results
    ]
    results[0] = replace(results[0], status="failed", reason=SCRIPT, blocks={})
    return RunData(meta, tuple(results))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hostile") / "run.html"
    path.write_text(HtmlReporter().render(hostile()), encoding="utf-8")
    return path


def test_markup_in_names_is_text(view: Callable[..., Any], page: Path) -> None:
    opened = view(page)
    shown = opened.page
    shown.wait_for_selector("html[data-ready=yes]")
    names = shown.locator("#board-table .expand").all_inner_texts()
    assert SCRIPT in names
    assert FORMULA in names
    for button in shown.locator("#board-table .expand").all():
        button.click()
    assert any(f"failed: {SCRIPT}" in text for text in shown.locator("tr.more").all_inner_texts())
    assert TITLE in shown.locator("#notes").inner_text()
    shown.click("details.menu[data-filter=strategies] > summary")
    for name in hostile().meta["cases"]:
        shown.evaluate("(name) => { location.hash = bench.caseHref(name); }", name)
        shown.wait_for_function("(name) => document.title.startsWith(name)", arg=name)
        assert shown.locator("h1").inner_text() == TITLE
        assert SCRIPT in shown.locator("main").inner_text()
    assert shown.evaluate("[...document.scripts].map((one) => one.id)") == ["data", ""]
    assert shown.locator("img, iframe, object, [onerror]").count() == 0
    opened.assert_quiet(page)


def test_markup_in_the_compared_page_and_the_site_is_text(
    view: Callable[..., Any], command: Callable[..., str], tmp_path: Path
) -> None:
    data = tmp_path / "run.json"
    data.write_text(json.dumps(to_plain(run_to_json(hostile()))), encoding="utf-8")
    compared = tmp_path / "compared.html"
    command("compare", data, data, "-f", "html", "-o", compared)
    opened = view(compared)
    assert SCRIPT in opened.page.locator("body").inner_text()
    assert opened.page.locator("img").count() == 0
    opened.assert_quiet(compared)


def test_a_page_of_everything_stays_small(real: Any) -> None:
    """All built-in strategies on all built-in cases are eight times as many models."""
    bare = len(HtmlReporter().render(RunData(real.run.meta, ())).encode())
    models = len(real.run.results)
    whole = bare + (real.page.stat().st_size - bare) * 144 / models
    assert bare < 3 * MEBI / 4  # half a megabyte of it is d3 and Plot
    assert whole < 8 * MEBI
