"""The case pages of a real run: structure view, frequencies, receptances, and their addresses."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from femubench.core.run.store import Store
from femubench.reports.htmls import HtmlReporter
from femubench.results import Run

VIEW, TOLD = ".case-structure svg.case-view", ".case-structure .case-stated"
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
    return page.locator(TOLD).inner_text()


@pytest.mark.parametrize("case", ["frame", "hframe", "frame-solid"])
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


def test_the_papers_row_stands_below_ours(shown: Callable[..., Page]) -> None:
    page = shown("frame")
    rows = page.locator(".case-frequencies [data-strategy=baruch]")
    assert rows.evaluate_all("(rows) => rows.map((tr) => tr.dataset.said)") == ["", "as printed"]
    ours, theirs = (row.split() for row in rows.all_inner_texts())
    assert "911.1" in ours
    assert "911.3" in theirs  # as the paper has it


def test_measured_frequencies_and_the_baseline_stay_in_view(shown: Callable[..., Page]) -> None:
    page = shown("frame", size=(390, 500))
    table = page.locator(".wide:has(.case-frequencies)")
    table.evaluate("(box) => box.scrollTo(200, 400)")
    assert table.evaluate("(box) => box.scrollLeft") > 50
    table.scroll_into_view_if_needed()
    box = table.bounding_box()
    names = table.locator("thead th:first-child, thead [data-strategy=unchanged] th")
    places = [place.bounding_box() for place in names.all()]
    assert len(places) >= 3
    for place in places:
        assert abs(place["x"] - box["x"]) < 2
        assert box["y"] <= place["y"] < box["y"] + box["height"]


def test_more_of_the_table_on_request(shown: Callable[..., Page]) -> None:
    page = shown("frame")
    table = page.locator(".case-frequencies")
    rows = table.locator("[data-strategy]").count()
    page.get_by_label("Errors in %").check()
    assert table.locator("td .case-under").first.inner_text().endswith("%")
    page.get_by_label("MAC", exact=True).check()
    assert "MAC" in table.locator(".case-under", has_text="MAC").first.inner_text()
    page.get_by_label("A and B alone").check()
    assert table.locator("[data-strategy]").count() < rows
    page.get_by_label("Strategy A").select_option("baruch")
    assert "baruch" in table.locator("tbody").inner_text()


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


def test_nothing_moves_by_itself_for_who_wants_it_still(shown: Callable[..., Page]) -> None:
    page = shown("frame")
    page.locator(VIEW).scroll_into_view_if_needed()
    assert page.locator(".case-play").inner_text() == "Play"
    first = drawn(page)
    page.wait_for_timeout(150)
    assert drawn(page) == first


def test_receptances_before_and_after_the_change(shown: Callable[..., Page]) -> None:
    page = shown("frame-solid")
    charts = page.locator("figure.chart", has_text="Receptance, dB re 1 m/N")
    assert charts.count() == 2
    assert "mass and spring at 6" in charts.nth(1).locator("figcaption").inner_text()
    for chart in charts.all():
        chart.locator("svg.canvas").wait_for()
        assert "Frequency, Hz" in chart.locator("svg.canvas").text_content()
        legend = chart.locator(".legend").inner_text()
        assert all(name in legend for name in ("measured", "local", "unchanged"))
        lines = [path.get_attribute("d") or "" for path in chart.locator(".curve path").all()]
        assert len(set(lines)) == 3
        assert all(len(line) > 1000 for line in lines)
    section = page.locator("section.case-section", has=charts.first)
    assert "damping ratio of 0.0" in section.inner_text()


def test_the_nominal_model_is_shown_where_unchanged_did_not_run(
    view: Callable[..., Any], real: Any, tmp_path: Path
) -> None:
    run, path = real.run, tmp_path / "local.html"
    alone = Run(
        {**run.meta, "strategies": ["local"]},
        tuple(result for result in run.results if result.strategy == "local"),
    )
    exhibits = Store(real.store).exhibits
    path.write_text(HtmlReporter().render_with(alone, exhibits), encoding="utf-8")
    found = view(path, "#case/frame-solid")
    page = found.page
    page.wait_for_selector(".case-title")
    for legend in page.locator("figure.chart", has_text="Receptance,").locator(".legend").all():
        assert legend.inner_text().split("\n") == ["measured", "local", "nominal model"]
    page.get_by_label("Strategy", exact=True).select_option("nominal model")
    assert "nominal model 264.48 Hz" in stated(page)
    found.assert_quiet(path)


def test_supports_and_rotations_are_drawn_as_what_they_are(
    view: Callable[..., Any], command: Callable[..., str], tmp_path: Path
) -> None:
    case, store = tmp_path / "case", tmp_path / "store"
    command("init", case)
    sensors, modes = case / "sensors.csv", case / "modes.csv"
    sensors.write_text(sensors.read_text().rstrip() + "\nturn,B,ry\n")
    first, *lines = modes.read_text().splitlines()
    modes.write_text("\n".join([f"{first},turn", *(f"{line},5.0" for line in lines)]) + "\n")
    options = ("--seeds", "2", "--seed", "4", "-s", "unchanged", "-s", "global")
    command("run", case, *options, "-q", "--store", store)
    (path,) = store.glob("*.html")
    found = view(path, "#case/portal")
    page = found.page
    page.wait_for_selector(".case-title")
    whole = drawn(page)
    page.get_by_label("Attachments").uncheck()
    assert drawn(page) != whole
    assert "seed 5 is shown, one of 2 draws" in page.locator(".case-facts").inner_text()
    assert "At the drive sensor turn" not in page.locator("main").inner_text()
    page.goto(path.resolve().as_uri() + "#board")
    # One structure, however many its blocks and draws: nothing is claimed.
    assert "No difference between any two lines" in page.locator("#board").inner_text()
    found.assert_quiet(path)


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


def test_many_changes_are_drawn_by_their_colours_while_the_view_moves(
    shown: Callable[..., Page],
) -> None:
    page = shown("frame")
    page.evaluate(
        """() => {
            const all = d3.range(200);
            const nodes = d3.range(201).map((k) => [k / 10, 0, 0]);
            const none = "members joints sensors springs masses supports measured".split(" ");
            const stage = {
              ...Object.fromEntries(none.map((name) => [name, []])), plane: "3d", nodes,
              elements: all.map((k) => [k, k + 1]), member_of: all.map(() => 0),
              element_labels: all.map((k) => `element ${k}`) };
            const shape = nodes.map((_, k) => [0, 0, Math.sin(k / 20)]);
            const elements = all.map((k) => (k % 2 ? 0.1 : 0.2));
            const exhibit = { modes: [{ hz: 12, paired: null, shape }], elements };
            const root = bench.el("div", { id: "tried" });
            document.querySelector("main").prepend(root);
            bench.structure(root, stage, [{ name: "many", exhibit, modes: [] }]);
        }"""
    )
    found = page.locator("#tried .found")
    expect(found).to_have_count(200)
    assert found.last.locator("title").text_content().startswith("element ")
    page.focus("#tried svg.case-view")
    page.keyboard.press("ArrowLeft")
    expect(found).to_have_count(2)
    expect(found).to_have_count(200)
    page.keyboard.press("Space")
    expect(found).to_have_count(2)
    page.keyboard.press("Space")
    expect(found).to_have_count(200)


def test_a_page_without_pictures_says_so(
    view: Callable[..., Any], real: Any, tmp_path: Path
) -> None:
    bare = tmp_path / "bare.html"
    bare.write_text(HtmlReporter().render(real.run), encoding="utf-8")
    found = view(bare, "#case/frame")
    found.page.wait_for_selector(".case-title")
    text = found.page.locator("main").inner_text()
    assert "Pictures are not stored with this run." in text
    assert found.page.locator("canvas").count() == 0
    assert found.page.locator(".case-frequencies").count() == 1
    found.assert_quiet(bare)


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
