"""All pages: no serious fault by axe-core, light and dark; nothing wider than a small screen."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe

sys.path.insert(0, str(Path(__file__).parents[1] / "toys"))
from run_edits import called, scaled

OTHERS = ("board", "compared", "site", "site-strategy", "site-case", "diagnosis", "reproduction")
# Without asking for style sheets once more, which the policy of the site refuses.
ONLY = {"resultTypes": ["violations"], "preload": False}
CASES = ("frame", "hframe", "frame-solid")


@pytest.fixture(scope="module")
def addresses(
    real: Any, command: Callable[..., str], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, tuple[Path, str]]:
    """Make every kind of page; file and hash by name."""
    folder = tmp_path_factory.mktemp("pages")
    data = json.loads(real.json_file.read_text())
    other = folder / "other.json"
    other.write_text(json.dumps(called(scaled(data, "local", 1.5), "later")))
    compared, diagnosis = folder / "compared.html", folder / "diagnosis.html"
    command("compare", real.json_file, other, "-f", "html", "-o", compared, code=1)
    fair = folder / "fair.json"
    words = ("run", "frame", "-s", "unchanged", "-s", "baruch", "-s", "local", "-q")
    command(*words, "--store", folder / "store", "--json", fair)
    command("publish", "--unverified", folder / "site", fair, "-q")
    command("diagnose", "hframe", "--no-pairs", "-q", "--report", diagnosis)
    command("reproduce", "hframe", "-q", "-o", folder / "reproduced")
    site = folder / "site"
    return {
        "board": (real.page, "#board"),
        **{case: (real.page, f"#case/{case}") for case in CASES},
        "compared": (compared, ""),
        "site": (site / "index.html", ""),
        "site-strategy": (sorted(site.glob("strateg*/*.html"))[0], ""),
        "site-case": (sorted(site.glob("case*/*.html"))[0], ""),
        "diagnosis": (diagnosis, ""),
        "reproduction": (folder / "reproduced" / "reproduce.html", ""),
    }


def unfolded(page: Any) -> None:
    """Show what is folded away, so that it is looked at too."""
    page.evaluate(
        """() => {
          for (const one of document.querySelectorAll("details:not(.menu)")) one.open = true;
          document.querySelector("details.menu")?.setAttribute("open", "");
          document.querySelector(".expand")?.click();
        }"""
    )
    page.wait_for_timeout(50)


@pytest.mark.parametrize(
    ("name", "scheme"),
    [(name, scheme) for name in OTHERS for scheme in ("light", "dark")]
    # A change element by element, and one of the whole matrix.
    + [("frame", "light"), ("hframe", "dark")],
)
def test_axe_finds_nothing_serious(
    view: Callable[..., Any], addresses: dict[str, tuple[Path, str]], name: str, scheme: str
) -> None:
    file, at = addresses[name]
    found = view(file, at, color_scheme=scheme)
    unfolded(found.page)
    faults = [
        (fault["id"], fault["help"], node["html"], node["failureSummary"])
        for fault in Axe().run(found.page, options=ONLY).response["violations"]
        if fault["impact"] in ("serious", "critical")
        for node in fault["nodes"]
    ]
    assert faults == []
    assert found.messages == []
    assert not [url for url in found.requests if not url.startswith(("file:", "data:"))]


@pytest.mark.parametrize("name", [*OTHERS, *CASES])
def test_fits_a_small_screen(
    view: Callable[..., Any], addresses: dict[str, tuple[Path, str]], name: str
) -> None:
    file, at = addresses[name]
    page = view(file, at, size=(390, 844)).page
    width = "document.documentElement.scrollWidth"
    assert page.evaluate(width) <= 390
    unfolded(page)
    assert page.evaluate(width) <= 390


def test_a_board_is_sorted_and_filtered_with_the_keyboard(
    view: Callable[..., Any], addresses: dict[str, tuple[Path, str]]
) -> None:
    opened = view(addresses["site"][0])
    page, index = opened.page, json.loads((addresses["site"][0].parent / "index.json").read_text())
    table = page.locator("table.filtered")
    names = [row["strategy"] for row in index["boards"][0]["rows"]]
    assert table.locator("tbody th a").all_inner_texts() == names
    shown = [cell.get_attribute("data-value") for cell in table.locator("td:nth-child(3)").all()]
    assert [float(text) for text in shown] == [row["skill"] for row in index["boards"][0]["rows"]]
    head = table.locator("thead th").nth(1)
    head.locator("button").focus()
    page.keyboard.press("Enter")
    assert head.get_attribute("aria-sort") == "ascending"
    assert table.locator("tbody th a").all_inner_texts() == sorted(names)
    page.keyboard.press("Enter")
    assert table.locator("tbody th a").all_inner_texts() == sorted(names, reverse=True)
    page.get_by_label("Filter by name").fill(names[0])
    assert table.locator("tbody tr:visible").count() == 1
    assert page.locator("#count").inner_text() == "1 shown"
    assert opened.messages == []


def test_the_best_is_seen_without_scrolling(
    view: Callable[..., Any], addresses: dict[str, tuple[Path, str]]
) -> None:
    page = view(addresses["site"][0]).page
    for place in (".answer", "figure svg", "figcaption"):
        box = page.locator(place).first.bounding_box()
        assert box["y"] + box["height"] <= 900
    assert " with skill 0." in page.locator(".answer").inner_text()
