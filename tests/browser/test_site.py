"""The published site: large, hostile, small screens, keyboard; nothing asked for, nothing said."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from synthetic_run import synthetic_run
from synthetic_site import synthetic_site

EVIL = (
    """<script>alert(1)</script><img src=x onerror=alert(2)>"'</title>&amp; javascript:alert(3)"""
)
TURNED = "\u202eevil \u05e9\u05dc\u05d5\u05dd\u2066 \x1b[2J"
KINDS = ("index", "class", "strategy", "case")
BAR = 2**18  # bytes of a page


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a site of 12 strategies on 9 cases."""
    return synthetic_site(tmp_path_factory.mktemp("large"), 12, 8)


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a site in which every text that a third party gives is markup, or turned around."""
    names = (EVIL, TURNED, "n" * 60)
    cases = {c: {"title": EVIL, "digest": f"{k:064d}"} for k, c in enumerate(synthetic_cases())}
    own = {"summary": EVIL, "author": TURNED, "homepage": "https://a.b/c"}
    machine = {"platform": EVIL, "cpu": EVIL, "blas": TURNED}
    stated = {
        "cases": cases,
        "about": dict.fromkeys(names, own),
        "machine": machine,
        "citations": {EVIL: EVIL},
    }
    return synthetic_site(
        tmp_path_factory.mktemp("hostile"), 5, 4, names=names, kind=EVIL, **stated
    )


def synthetic_cases() -> list[str]:
    return list(synthetic_run(2, 4).meta["cases"])


def page_of(site: Path, kind: str) -> Path:
    """Return the page of the first strategy, class or case."""
    index = json.loads((site / "index.json").read_text())
    pages = {
        "index": "index.html",
        "class": index["boards"][1]["page"],
        "strategy": next(s["page"] for s in index["strategies"] if len(s["versions"]) > 1),
        "case": index["cases"][0]["page"],
    }
    return site / str(pages[kind])


def assert_quiet(found: Any, site: Path) -> None:
    """Only the page and what all pages share was asked for; nothing was said."""
    file = Path(found.page.url.removeprefix("file://"))
    found.assert_quiet(file, site / "site.css", site / "site.js")


@pytest.mark.parametrize(
    ("kind", "scheme"), [(kind, ("light", "dark")[k % 2]) for k, kind in enumerate(KINDS)]
)
def test_axe_finds_nothing_serious(
    view: Callable[..., Any], hostile: Path, kind: str, scheme: str
) -> None:
    found = view(page_of(hostile, kind), color_scheme=scheme)
    found.assert_accessible()
    assert_quiet(found, hostile)


@pytest.mark.parametrize(
    ("which", "kind"),
    [
        pytest.param("large", "index", marks=pytest.mark.nightly),
        *(("hostile", kind) for kind in KINDS),
    ],
)
def test_a_small_screen_scrolls_no_chart(
    request: pytest.FixtureRequest, view: Callable[..., Any], which: str, kind: str
) -> None:
    site = request.getfixturevalue(which)
    found = view(page_of(site, kind), size=(390, 844))
    page, width = found.page, "node => [node.scrollWidth, node.clientWidth]"
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    charts = page.locator("figure")
    assert charts.count() == (kind != "case")
    for chart in charts.all():
        inside, room = chart.evaluate(width)
        assert inside <= room
        texts = chart.locator("svg:visible text").evaluate_all(
            "all => all.map(a => a.getBoundingClientRect()).map(b => [b.left, b.right, b.height])"
        )
        assert len(texts) > 5
        assert all(left >= 0.0 and right <= 390.0 for left, right, _ in texts)
        assert min(height for *_, height in texts) >= 11.0
    assert_quiet(found, site)


@pytest.mark.parametrize("kind", ["index", "strategy"])
def test_what_others_write_is_text(view: Callable[..., Any], hostile: Path, kind: str) -> None:
    found = view(page_of(hostile, kind))
    page = found.page
    page.wait_for_selector("thead button")
    text = page.locator("body").inner_text()
    assert EVIL in text
    assert not {"\u202e", "\u2066", "\x1b"} & set(page.content())
    assert page.locator("img, iframe, object, form, base, style, [onerror]").count() == 0
    assert page.evaluate("[...document.scripts].map(one => one.src.split('/').pop())") == [
        "site.js"
    ]
    links = page.evaluate("[...document.links].map(one => one.href)")
    assert len(links) > 3
    for link in links:
        path, is_file = link.removeprefix("file://"), link.startswith("file:")
        assert Path(path).is_file() if is_file else link.startswith("https://a.b/c")
    for button in page.locator("thead button").all():
        button.click()
    assert page.locator("body").inner_text().count(EVIL) == text.count(EVIL)
    assert_quiet(found, hostile)


def test_a_large_board_is_sorted_and_filtered_with_the_keyboard(
    view: Callable[..., Any], large: Path
) -> None:
    found = view(page_of(large, "index"))
    page, index = found.page, json.loads((large / "index.json").read_text())
    board = index["boards"][0]
    assert (len(board["rows"]), len(board["cases"])) == (12, 9)
    table, names = page.locator("table.filtered"), [row["strategy"] for row in board["rows"]]

    def column(number: int) -> list[str]:
        cells = table.locator(f"tbody tr > :nth-child({number})")
        found: list[str] = cells.evaluate_all(
            "all => all.map(c => c.dataset.value ?? c.querySelector('a').textContent)"
        )
        return found

    assert column(2) == names
    assert [float(text) for text in column(3)] == [row["gain"] for row in board["rows"]]
    for number, key in ((2, str), (3, float), (5, float), (8, float)):
        head = table.locator("thead th").nth(number - 1)
        head.locator("button").focus()
        page.keyboard.press("Enter")
        assert head.get_attribute("aria-sort") == "ascending"
        assert column(number) == sorted(column(number), key=key)
        page.keyboard.press("Enter")
        assert head.get_attribute("aria-sort") == "descending"
        assert column(number) == sorted(column(number), key=key, reverse=True)
    page.get_by_label("Filter by name").fill("STRATEGY 00")
    assert table.locator("tbody tr:visible").count() == 10
    assert page.locator("#count").inner_text() == "10 shown"
    assert_quiet(found, large)


@pytest.mark.nightly
def test_pages_of_a_large_site_stay_small(tmp_path: Path) -> None:
    site = synthetic_site(tmp_path, 40, 54)
    sizes = {path.name: path.stat().st_size for path in site.rglob("*.html")}
    assert len(sizes) == 1 + 2 + 40 + 60
    assert max(sizes.values()) < BAR
