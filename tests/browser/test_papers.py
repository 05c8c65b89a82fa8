"""The page of a paper: why a cell has its colour, by pointer, keyboard and tap; conventions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import reproduction_toys as toys

from femubench.core.library.reproduce import write_studies


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("papers")
    write_studies((toys.study("frame"), toys.study("hframe")), folder)
    return folder


def test_wrong_cells_are_seen_at_once(view: Callable[..., Any], pages: Path) -> None:
    file = pages / "reproduce.html"
    found = view(file)
    bad = found.page.locator("nav .square:is(.misprint, .does-not-follow):visible")
    assert bad.count() == 6
    assert all(b["y"] + b["height"] <= 900 for b in (one.bounding_box() for one in bad.all()))
    assert set(bad.all_inner_texts()) == {"!", "✗"}
    found.assert_quiet(file)


def test_why(view: Callable[..., Any], pages: Path) -> None:
    size = (390, 844)
    page = view(pages / "reproduce.html", size=size, has_touch=True).page
    cells, why = page.locator(".cell.does-not-follow:visible"), page.locator(".why:visible")
    assert why.count() == 0
    cells.first.hover()
    page.locator(".why:visible", has_text=toys.REASON).wait_for()
    box = why.bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= size[0]
    assert box["y"] + box["height"] <= size[1]
    page.keyboard.press("Escape")  # with the pointer still there
    why.wait_for(state="hidden")
    page.mouse.move(1, 1)
    cells.nth(1).tap()
    page.locator(".why:visible", has_text="mode 5").wait_for()
    page.touchscreen.tap(5, 5)
    why.wait_for(state="hidden")


def test_why_with_the_keyboard(view: Callable[..., Any], pages: Path) -> None:
    page = view(pages / "reproduce.html").page
    cells, why = page.locator(".cell.does-not-follow:visible"), page.locator(".why:visible")
    cells.nth(1).focus()
    page.locator(".why:visible", has_text="mode 5").wait_for()
    page.keyboard.press("Shift+Tab")
    page.locator(".why:visible", has_text="mode 4").wait_for()
    page.keyboard.press("Escape")
    why.wait_for(state="hidden")
    page.keyboard.press("Enter")
    page.locator(".why:visible", has_text="mode 4").wait_for()
    page.keyboard.press("Escape")
    why.wait_for(state="hidden")
    assert page.evaluate("document.activeElement.dataset.printed") == "911.3"


def test_a_convention_changes_cells_and_squares(view: Callable[..., Any], pages: Path) -> None:
    page = view(pages / "reproduce.html").page

    def seen() -> list[str]:
        rows = page.locator("#frame table.printed").first.locator("tbody tr")
        cells = rows.locator(".cell:visible")
        return [cell.get_attribute("class").partition(" ")[2] for cell in cells.all()]

    def squares() -> list[str]:
        return page.locator("nav .squares").first.locator(".square:visible").all_inner_texts()

    before, marks = seen(), squares()
    assert before[2:4] == ["under-convention", "does-not-follow"]
    page.locator("#frame fieldset input").nth(1).check()
    assert seen() == [*before[:2], "does-not-follow", "under-convention", before[4]]
    assert squares() == [*marks[:2], "✗", "≈", *marks[4:]]
    page.keyboard.press("ArrowUp")
    assert (seen(), squares()) == (before, marks)
