"""The case pages of a real run: structure view, frequencies, receptances, and their addresses."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

VIEW, SAID = ".case-structure svg.case-view", ".case-structure .case-stated"
PIXELS = f"document.querySelector('{VIEW}').innerHTML"


@pytest.fixture
def shown(view: Callable[..., Any], real: Any) -> Iterator[Callable[..., Page]]:
    """Return what opens the page of a case."""
    opened = []

    def opening(case: str, **options: Any) -> Page:
        found = view(real.page, f"#case/{case}", **options)
        opened.append(found)
        found.page.wait_for_selector("html[data-ready=yes]")
        found.page.wait_for_selector(".case-title")
        return found.page  # type: ignore[no-any-return]

    yield opening
    for found in opened:
        found.assert_quiet(real.page)


def drawn(page: Page) -> str:
    """Return the picture of the structure, once a frame has been drawn."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    found: str = page.evaluate(PIXELS)
    return found


def stated(page: Page) -> str:
    return page.locator(SAID).inner_text()


@pytest.mark.parametrize("case", ["hframe", "frame-solid"])
def test_frequencies_are_those_of_the_json(
    shown: Callable[..., Page], real: Any, case: str
) -> None:
    page = shown(case)
    rows = page.evaluate(
        """() => {
          const table = document.querySelector(".case-frequencies");
          const [, modes, measured] = table.tHead.rows;
          const keys = [...modes.cells].map((th, k) => th.dataset.mode ?? `rms ${k}`);
          const cells = (tr) => Object.fromEntries(
            [...tr.cells].slice(1).map((td, k) => [keys[k + 1], td.textContent]));
          const rows = [...table.querySelectorAll("[data-strategy]")];
          return [["measured", "", cells(measured)],
            ...rows.map((tr) => [tr.dataset.strategy, tr.dataset.said, cells(tr)])];
        }"""
    )
    results = [
        result
        for result in json.loads(real.json_file.read_text())["results"]
        if result["case"] == case and result["status"] == "ok"
    ]
    assert len(results) == (5 if case == "hframe" else 6)
    own = {strategy: cells for strategy, said, cells in rows if not said}
    assert set(own) == {"measured", *(result["strategy"] for result in results)}
    for result in results:
        found, blocks = dict(own[result["strategy"]]), ("used", "higher", "modified")
        rms = [found.pop(key) for key in list(found) if key.startswith("rms")]
        given = [result[block]["rms_percent"] for block in blocks if result[block]]
        for value, text in zip(given, rms, strict=True):
            assert (
                (text == "< 0.001")
                if value < 0.001
                else float(text) == pytest.approx(value, rel=6e-3)
            )
        for block in blocks:
            for mode in result[block]["modes"] if result[block] else ():
                key = f"{block}|{mode.get('modification') or ''}|{mode['mode']}"
                text, ours = found.pop(key), mode["predicted_hz"]
                measured = float(own["measured"][key])
                assert measured == pytest.approx(mode["measured_hz"], abs=0.0501)
                assert (
                    text == "none"
                    if ours is None
                    else float(text) == pytest.approx(ours, abs=0.0501)
                )
        assert found == {}
    assert any(said == "as printed" for _, said, _ in rows) == (case != "frame-solid")


def test_modes_and_strategies_can_be_picked(shown: Callable[..., Page]) -> None:
    page = shown("frame-solid")
    page.get_by_label("Strategy", exact=True).select_option("unchanged")
    first, text = drawn(page), stated(page)
    assert text.startswith("Mode 1 (used): measured 231.41 Hz, unchanged 264.")
    mode = page.get_by_label("Mode", exact=True)
    mode.select_option(index=1)
    second = drawn(page)
    assert second != first
    assert stated(page).startswith("Mode 2 (used)")
    page.get_by_label("Strategy", exact=True).select_option("generic-ls")
    assert drawn(page) != second
    assert "generic-ls" in stated(page)
    # After a design change there are shapes as well.
    changed = page.locator("optgroup[label*='mass and spring at 6'] option").first
    mode.select_option(value=changed.get_attribute("value"))
    assert "generic-ls 150.9" in stated(page) or "generic-ls 151" in stated(page)
    assert re.search(r"MAC (0\.99|1\.0)", stated(page))


def test_the_structure_is_turned_by_keys_and_mouse(shown: Callable[..., Page]) -> None:
    page = shown("hframe")
    page.focus(VIEW)
    page.keyboard.press("r")  # edges of the very first picture may be smoothed otherwise
    seen = [drawn(page)]
    for key in ("ArrowLeft", "ArrowUp", "+", "-", "-", "ArrowRight", "ArrowDown"):
        page.keyboard.press(key)
        seen.append(drawn(page))
        assert seen[-1] != seen[-2], key
    page.keyboard.press("r")
    assert drawn(page) == seen[0]
    page.keyboard.press("n")
    assert stated(page).startswith("Mode 2 (used)")
    page.keyboard.press("p")
    page.keyboard.press("p")
    assert not stated(page).startswith(("Mode 1 ", "Mode 2 "))
    page.keyboard.press("n")
    assert drawn(page) == seen[0]
    page.locator(VIEW).scroll_into_view_if_needed()
    box = page.locator(VIEW).bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60, y + 20, steps=3)
    page.mouse.up()
    assert drawn(page) != seen[0]
    page.get_by_role("button", name="Reset the view").click()
    assert drawn(page) == seen[0]
    page.get_by_label("Sensors").check()
    assert drawn(page) != seen[0]


def test_the_mode_moves_until_it_is_paused(shown: Callable[..., Page]) -> None:
    page = shown("frame", still=False)
    page.locator(VIEW).scroll_into_view_if_needed()
    button = page.locator(".case-play")
    assert button.inner_text() == "Pause"
    first = drawn(page)
    page.wait_for_function("(first) => " + PIXELS + " !== first", arg=first)
    page.focus(VIEW)
    page.keyboard.press("Space")
    assert button.inner_text() == "Play"
    still = drawn(page)
    page.wait_for_timeout(150)
    assert drawn(page) == still
    button.click()
    page.wait_for_function("(still) => " + PIXELS + " !== still", arg=still)


def test_a_saved_mode_moves(shown: Callable[..., Page]) -> None:
    page = shown("frame")
    with page.expect_download() as got:
        page.locator(f"{VIEW} ~ .saves").get_by_role("button", name="SVG").click()
    saved = Path(got.value.path()).read_text()
    outlines = re.findall(r'<animate attributeName="d"[^>]* values="([^"]+)"', saved)
    assert outlines
    assert all(len(set(each.split(";"))) > 10 for each in outlines)


def test_changes_of_the_stiffness(shown: Callable[..., Page]) -> None:
    page = shown("frame")
    section = page.locator("section.case-section", has_text="Change of the stiffness").last
    page.get_by_label("Strategy A").select_option("generic-ls")
    assert section.locator("svg.case-map").first.locator(".found").count() == 28
    stated = section.locator(".case-stated").first.inner_text()
    assert stated.startswith("Largest: k")
    assert "colours end at" in stated
    page.get_by_label("Strategy A").select_option("baruch")
    picture = section.locator(".plot").first
    picture.locator("svg.canvas").wait_for()
    picture.focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowRight")
    assert "N/m" in section.locator(".readout").first.inner_text()
    assert section.locator(".case-list li").count() == 5


def test_addresses_lead_to_pages_and_back(shown: Callable[..., Page]) -> None:
    page = shown("hframe")
    assert "H-frame" in page.locator("h1").inner_text()
    page.locator("#pages a", has_text="frame-solid").click()
    expect(page).to_have_title(re.compile("^frame-solid"))
    assert page.evaluate("location.hash") == "#case/frame-solid"
    assert page.evaluate("document.activeElement.tagName") == "H1"
    assert page.locator("#pages a[aria-current=page]").inner_text() == "frame-solid"
    page.go_back()
    expect(page).to_have_title(re.compile("^hframe"))
    page.evaluate("location.hash = '#board'")
    page.wait_for_selector("#board-table")
    page.go_back()
    expect(page).to_have_title(re.compile("^hframe"))
    page.evaluate("location.hash = '#case/%E0%A4%A'")
    expect(page.locator("h1")).to_have_text("Nothing to show")
