"""The page of a paper: why a cell has its colour, by pointer, keyboard and tap; conventions."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from femubench.core.library.reproduce import write_studies

sys.path.insert(0, str(Path(__file__).parents[1] / "toys"))
import reproduction_toys as toys


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("papers")
    write_studies((toys.study("frame"), toys.study("hframe")), folder)
    return folder


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_wrong_cells_are_seen_at_once(view: Callable[..., Any], pages: Path, scheme: str) -> None:
    file = pages / "reproduce.html"
    found = view(file, color_scheme=scheme)
    bad = found.page.locator("nav a.square:is(.misprint, .does-not-follow):visible")
    assert bad.count() == 6
    assert all(b["y"] + b["height"] <= 900 for b in (one.bounding_box() for one in bad.all()))
    assert set(bad.all_inner_texts()) == {"!", "✗"}
    found.assert_quiet(file)


def test_figures_are_those_of_the_json(view: Callable[..., Any], pages: Path) -> None:
    page = view(pages / "reproduce.html").page
    shown = page.eval_on_selector_all(
        ".cell",
        "all => all.filter(c => c.offsetParent).map(c => [c.dataset.printed, c.dataset.value])",
    )
    cells = json.loads((pages / "reproduce.json").read_text())
    wanted = [(float(c["printed"]), float(c["ours"] or "nan")) for c in cells]
    assert sorted(map(str, wanted)) == sorted(
        str((float(printed), float(value or "nan"))) for printed, value in shown
    )


@pytest.mark.parametrize("size", [(1440, 900), (390, 844)])
def test_why(view: Callable[..., Any], pages: Path, size: tuple[int, int]) -> None:
    page = view(pages / "reproduce.html", size=size, has_touch=True).page
    cells, why = page.locator(".cell.does-not-follow:visible"), page.locator(".why:visible")
    assert why.count() == 0
    cells.first.hover()
    assert toys.REASON in why.inner_text()
    box = why.bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= size[0]
    assert box["y"] + box["height"] <= size[1]
    page.mouse.move(1, 1)
    cells.nth(1).focus()
    assert "mode 5" in why.inner_text()
    page.keyboard.press("Shift+Tab")
    assert "mode 4" in why.inner_text()
    cells.nth(1).tap()
    assert "mode 5" in why.last.inner_text()


def test_a_square_leads_to_its_cell(view: Callable[..., Any], pages: Path) -> None:
    page = view(pages / "reproduce.html").page
    page.locator("nav a.square.misprint").first.focus()
    page.keyboard.press("Enter")
    assert toys.EVIL in page.locator(".why:visible").inner_text()
    assert page.locator(".at:target .cell:visible").bounding_box()["y"] < 900


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
