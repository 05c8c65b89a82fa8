"""The page of a paper: why a cell has its colour, by pointer, keyboard and tap; conventions."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import reproduction_toys as toys

from femubench.core.library.reproduce import write_studies
from femubench.reproduction import Choice, Convention, Equation


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("papers")
    write_studies((toys.study("frame"), toys.study("hframe")), folder)
    return folder


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_wrong_cells_are_seen_at_once(view: Callable[..., Any], pages: Path, scheme: str) -> None:
    file = pages / "reproduce.html"
    found = view(file, color_scheme=scheme)
    bad = found.page.locator("nav .square:is(.misprint, .does-not-follow):visible")
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


def test_a_square_says_why_and_leads_to_its_cell(view: Callable[..., Any], pages: Path) -> None:
    page = view(pages / "reproduce.html").page
    square, why = page.locator("nav .square.misprint").first, page.locator(".why:visible")
    square.focus()
    page.keyboard.press("Enter")
    page.locator(".why:visible", has_text=toys.EVIL).wait_for()
    page.keyboard.press("Escape")
    why.wait_for(state="hidden")
    square.click()
    why.get_by_role("link").click()
    assert page.locator(".at:target .cell:visible").bounding_box()["y"] < 900


def tally_of(page: Any, place: str) -> str:
    """Return what is seen of a heading, with what the style sheet counts."""
    session = page.context.new_cdp_session(page)
    (node,) = session.send("DOM.querySelectorAll", {
        "nodeId": session.send("DOM.getDocument")["root"]["nodeId"], "selector": place,
    })["nodeIds"]  # fmt: skip
    tree = session.send("Accessibility.queryAXTree", {"nodeId": node})["nodes"]
    texts = [n["name"]["value"] for n in tree if n["role"]["value"] == "StaticText"]
    return "".join(texts)


def test_counts_follow_the_convention(view: Callable[..., Any], tmp_path: Path) -> None:
    """Of 22 cells 6 are wrong; under the first choice 5 are, under the second of the other 7."""
    keys = [("1", f"mode {k}", "FE") for k in range(1, 5)]
    agree = Choice("agree", {keys[2]: 581.4, keys[3]: 911.35})
    choices = agree, Choice("none", dict.fromkeys(keys[:1], 100.0))
    made = [
        replace(toys.study(paper), conventions=lambda: (Convention("x", "y", choices),))
        for paper in ("frame", "hframe")
    ]
    write_studies(made, tmp_path)
    page = view(tmp_path / "reproduce.html").page

    def seen(place: str) -> int:
        return int(page.locator(f"{place} .square:is(.misprint, .does-not-follow):visible").count())

    assert tally_of(page, "h1") == "6 of 22 printed figures do not come out again"
    assert seen("nav") == 6
    page.locator("#frame fieldset input").nth(1).check()
    assert tally_of(page, "h1") == "5 of 22 printed figures do not come out again"
    assert seen("nav") == 5
    page.locator("#hframe fieldset input").nth(2).check()
    assert tally_of(page, "h1") == "6 of 22 printed figures do not come out again"
    assert seen("nav") == 6
    assert "As judged: " in page.locator("#frame .counts").first.evaluate(
        "node => getComputedStyle(node, '::before').content"
    )
    page.locator("#frame fieldset input").nth(0).check()
    assert tally_of(page, "h1") == "7 of 22 printed figures do not come out again"
    assert tally_of(page, ".key li:last-child").endswith("does not follow 5")
    assert "✗ 4 of 11" in tally_of(page, "nav h2:last-of-type")
    assert "3 of 6 differ" in tally_of(page, "nav .strip:last-child > :first-child")


def test_brackets_of_matrices_stretch(view: Callable[..., Any], tmp_path: Path) -> None:
    rows = "<mtr><mtd><mi>x</mi></mtd></mtr>" * 4
    matrix = f"<math><mrow><mo>[</mo><mtable>{rows}</mtable><mo>]</mo></mrow></math>"
    equation = Equation("(1)", "matrix", "femubench.modal.mac", matrix)
    write_studies([replace(toys.study(), equations=(equation,))], tmp_path)
    page = view(tmp_path / "reproduce.html").page
    brackets, rest = page.locator("math mo"), page.locator("math mtable")
    height = rest.bounding_box()["height"]
    assert all(one.bounding_box()["height"] > 0.9 * height for one in brackets.all())


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
