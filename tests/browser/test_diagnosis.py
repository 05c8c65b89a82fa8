"""The page of a diagnosis in a browser: sorting, places tied to the drawing, names that attack."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import diagnosis_toys as toys

from femubench.core.diagnosis.serial import diagnosis_from_json, diagnosis_to_json
from femubench.core.schema.diagnosis import Rival
from femubench.reports.diagnosis import diagnosis_html


def page_of(tmp_path: Path, data: dict[str, Any]) -> Path:
    file = tmp_path / "diagnosis.html"
    file.write_text(diagnosis_html(data), encoding="utf-8")
    return file


def test_numbers_are_sorted_as_numbers_and_what_is_missing_stays_last(
    view: Callable[..., Any], tmp_path: Path
) -> None:
    chi2 = {"a": 1e5, "b": 9.0, "c": 812.5}
    rivals = tuple(Rival(name, "J1", value, 0.1) for name, value in chi2.items())
    rivals += (Rival("d", "J1", float("nan"), 0.1),)
    opened = view(page_of(tmp_path, toys.data_of(rivals=rivals)))
    table = opened.page.locator("section", has_text="Rivals").locator("table").last
    head = table.locator("thead th").nth(2)
    for order in ("b at J1 c at J1 a at J1 d at J1", "a at J1 c at J1 b at J1 d at J1"):
        head.locator("button").press("Enter")
        assert " ".join(table.locator("tbody th").all_inner_texts()) == order
    assert opened.messages == []


def test_a_place_in_the_list_lights_up_in_the_drawing(
    view: Callable[..., Any], tmp_path: Path
) -> None:
    page = view(page_of(tmp_path, toys.data_of())).page
    row = page.locator("tr[data-row]", has_text="type:T")
    spot = page.locator(f".first svg g[data-at='{row.get_attribute('data-row')}']")
    assert "lit" not in (spot.get_attribute("class") or "")
    row.hover()
    assert "lit" in spot.get_attribute("class")
    page.locator("h1").hover()
    assert "lit" not in (spot.get_attribute("class") or "")


def test_first_screen_without_scripts(view: Callable[..., Any], tmp_path: Path) -> None:
    page = view(page_of(tmp_path, toys.data_of()), java_script_enabled=False).page
    for place in ("h1", ".verdict", ".tiles", ".cards", ".first svg"):
        box = page.locator(place).first.bounding_box()
        assert box["y"] + box["height"] <= 900, place
    assert page.locator("table").first.is_visible()


def test_hostile_names_stay_text(view: Callable[..., Any], tmp_path: Path) -> None:
    data = diagnosis_from_json({**diagnosis_to_json(toys.nasty()), "structure": toys.STRUCTURE})
    for size in ((1440, 900), (390, 844)):
        opened = view(page_of(tmp_path, data), size=size)
        assert "alert(1)" in opened.page.locator("h1").inner_text()
        assert opened.page.evaluate("document.documentElement.scrollWidth") <= size[0]
        assert (opened.dialogs, opened.messages) == ([], [])
        assert [url for url in opened.requests if not url.startswith("file:")] == []


def test_a_figure_is_saved_as_it_looks(view: Callable[..., Any], tmp_path: Path) -> None:
    opened = view(page_of(tmp_path, toys.data_of()))
    figures = opened.page.locator("figure:has(svg)")
    assert figures.count() == opened.page.locator("figure .saves").count() > 0
    for word, starts in (("SVG", b"<svg"), ("PNG", b"\x89PNG")):
        with opened.page.expect_download() as got:
            figures.first.get_by_role("button", name=word).click()
        assert got.value.suggested_filename.endswith(f".{word.lower()}")
        saved = Path(got.value.path()).read_bytes()
        assert saved.startswith(starts)
        assert len(saved) > 2000
        assert word == "PNG" or b"fill:" in saved
    assert opened.messages == []
