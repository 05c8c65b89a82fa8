"""docs/development/performance.md has the kept figures."""

from __future__ import annotations

import json

import performance


def test_page_has_the_kept_figures() -> None:
    kept = json.loads(performance.KEPT.read_text(encoding="utf-8"))
    page = performance.PAGE.read_text(encoding="utf-8")
    assert page.partition(performance._BEGIN)[2].partition(performance._END)[0] == (
        performance.page_of(kept) + "\n"
    )
