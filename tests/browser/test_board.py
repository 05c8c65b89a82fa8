"""The leaderboard of a real run: opens from disk, sorts, filters, tells the run's figures."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page
from synthetic_run import synthetic_run

from femubench.core.schema.records import read_run
from femubench.core.score.leaderboard import leaderboard, list_rows
from femubench.core.score.ranking import rank_results
from femubench.reports.summary import finding
from femubench.results import PredictiveBoard, RunData, run_to_json

ROUNDED = {"seconds": 1e-3}  # figures that the page holds with fewer digits
KEYS = (
    *("rank", "gain", "error_percent", "better_share", "worse_share", "error_gain", "change_gain"),
    *("gain_tests", "band_percent", "shape_error", "false_modes"),
    *("used_percent", "higher_percent", "modified_percent"),
    *("parameters", "seconds"),
)


@pytest.fixture
def page(view: Callable[..., Any], real: Any) -> Iterator[Page]:
    opened = view(real.page)
    opened.page.wait_for_selector("html[data-ready=yes]")
    opened.page.wait_for_selector("svg.canvas")
    yield opened.page
    opened.assert_quiet(real.page)


def part(
    run: RunData, *, cases: Collection[str] | None = None, strategies: Collection[str] | None = None
) -> RunData:
    """Return the run as if there were nothing but these."""

    def kept(name: str) -> bool:
        return cases is None or name in cases

    names = [n for n in run.meta["strategies"] if strategies is None or n in strategies]
    results = [r for r in run.results if kept(r.case) and r.strategy in names]
    meta = {**run.meta, "strategies": names}
    for key in ("cases", "reference", "models"):
        meta[key] = {name: own for name, own in run.meta[key].items() if kept(name)}
    return RunData(meta, rank_results(results, meta))


def shown(page: Page) -> dict[str, dict[str, float | None]]:
    """Return the figures in the cells of the table, by strategy from the top down."""
    rows = page.evaluate(
        """() => {
          const all = (path) => [...document.querySelectorAll(`#board-table ${path}`)];
          const keys = all("thead th").map((th) => th.dataset.key);
          return all("tr[data-strategy]").map((tr) => {
            const figures = [...tr.children].flatMap((td, k) =>
              !td.hidden && td.dataset.value !== undefined ? [[keys[k], td.dataset.value]] : []);
            const flags = tr.querySelector("[data-lost]").dataset;
            const { ok, total } = tr.querySelector("[data-ok]").dataset;
            return [tr.dataset.strategy, [...figures, ["answered", ok], ["total", total],
              ["rigid_modes_lost", flags.lost], ["negative_eigenvalues", flags.negative]]];
          });
        }"""
    )
    return {name: {k: float(v) if v else None for k, v in figures} for name, figures in rows}


def assert_shows(page: Page, run: RunData, *, without: Collection[str] = ()) -> None:
    """The table is the leaderboard of the run, row for row."""
    found, board = shown(page), leaderboard(run).to_dict("records")
    assert list(found) == [row["strategy"] for row in board]
    for row in board:
        ours = found[row["strategy"]]
        more = {"answered", "total", "rigid_modes_lost", "negative_eigenvalues"}
        expected = {*KEYS, *more} - {*without}
        assert set(ours) - {"better_than", "worse_than"} == expected
        for key in expected:
            value = None if row[key] is None or row[key] != row[key] else row[key]
            room = ROUNDED.get(key, 1e-9)
            assert ours[key] == (value if value is None else pytest.approx(value, rel=room)), key


def order(page: Page) -> list[str]:
    return list(shown(page))


def tick(page: Page, menu: str, *off: str) -> None:
    """Open a menu of the filters and take the ticks away."""
    page.click(f"details.menu[data-filter={menu}] > summary")
    for name in off:
        page.locator(f"details.menu[data-filter={menu}]").get_by_label(name, exact=True).uncheck()
    page.keyboard.press("Escape")


def test_opens_from_disk_and_is_the_leaderboard(page: Page, real: Any) -> None:
    assert_shows(page, real.run)
    assert page.title().startswith("Leaderboard")
    assert page.locator("#facts").inner_text().find(real.run.meta["run"]) >= 0
    for row in leaderboard(real.run).to_dict("records"):
        # One seed on two structures has no interval.
        shown_range = page.locator(f"tr[data-strategy='{row['strategy']}'] .range")
        assert shown_range.inner_text() == "–"
    assert page.locator("tr[data-strategy=nobari] .flags").inner_text().startswith("▲")
    assert "1 failed" in page.locator("tr[data-strategy=kabe] .coverage").inner_text()
    figures = page.locator("figure:has(svg)")
    assert page.locator("figure .saves").count() == figures.count() > 0  # legends have drawings too


def test_the_headline_and_the_lines_below_are_made_from_the_figures(page: Page, real: Any) -> None:
    first, *rest = finding(real.run, list_rows(real.run))
    assert page.locator("h1").inner_text() == first
    # One seed on two structures: no interval, no test.
    assert page.locator("p.finding").inner_text() == " ".join(rest)
    assert "No difference between any two lines of the board is shown." in rest
    foot = page.locator("footer").inner_text()
    assert "openblas" in foot
    assert "openblas" not in page.locator("main").inner_text()
    assert "openblas" not in page.locator("header").inner_text()


@pytest.mark.parametrize(("form", "suffix"), [("json", ".json"), ("csv", ".csv")])
def test_what_is_downloaded_is_what_the_commands_write(
    view: Callable[..., Any], command: Callable[..., str], real: Any, form: str, suffix: str
) -> None:
    opened = view(real.page)
    page = opened.page
    page.wait_for_selector("html[data-ready=yes]")
    with page.expect_download() as waiting:
        page.click(f"#downloads [data-file$='{suffix}']")
    assert waiting.value.suggested_filename == f"{real.run.meta['run']}{suffix}"
    text = Path(waiting.value.path()).read_text(encoding="utf-8")
    assert text.rstrip("\n") == command("report", real.json_file, "-f", form).rstrip("\n")
    if form == "json":
        stored = json.loads(real.json_file.read_text())
        assert json.loads(text)["results"] == stored["results"]
    assert [url for url in opened.requests if not url.startswith(("file:", "data:", "blob:"))] == []
    assert opened.messages == []


def test_case_by_case_has_every_figure_next_to_the_baseline(page: Page, real: Any) -> None:
    read = """() => {
      const [head, ...rows] = document.querySelector("table.matrix").rows;
      const names = [...head.cells].map((th) => th.textContent);
      return rows.map((tr) => [tr.cells[0].textContent, Object.fromEntries(
        [...tr.cells].slice(1).map((td, k) => [names[k + 1], td.dataset.value]))]);
    }"""
    gains = {(r.case, r.strategy): r.gain for r in real.run.results}
    for case, cells in page.evaluate(read):
        assert next(iter(cells)) == "unchanged"
        for name, value in cells.items():
            assert float(value) == pytest.approx(gains[case, name], abs=1e-12)
    page.get_by_label("Figure of every case").select_option("higher")
    errors = {(r.case, r.strategy): r.blocks.get("higher") for r in real.run.results}
    for case, cells in page.evaluate(read):
        for name, value in cells.items():
            block = errors[case, name]
            assert value == "" if block is None else float(value) == block.rms_percent
    page.get_by_role("button", name="local").last.click()
    order = [float(cells["local"]) for _, cells in page.evaluate(read)]
    assert order == sorted(order, reverse=True)


def test_sorts_by_mouse_and_keyboard(page: Page) -> None:
    gain = {name: row["gain"] for name, row in shown(page).items()}
    falling = sorted(gain, key=lambda name: -(gain[name] or 0.0))
    assert order(page) == falling
    page.locator("th[data-key=strategy] button").click()
    head = page.locator("th[data-key=gain]")
    head.locator("button").click()
    assert (order(page), head.get_attribute("aria-sort")) == (falling, "descending")
    head.locator("button").focus()
    page.keyboard.press("Enter")
    assert head.get_attribute("aria-sort") == "ascending"
    assert [gain[name] for name in order(page)] == sorted(gain.values())
    name = page.locator("th[data-key=strategy]")
    name.locator("button").focus()
    page.keyboard.press("Space")
    assert order(page) == sorted(gain)
    assert name.get_attribute("aria-sort") == "ascending"
    assert head.get_attribute("aria-sort") is None


def test_a_strategy_opens_case_by_case(page: Page) -> None:
    row = page.locator("tr[data-strategy=kabe]")
    button = row.locator(".expand")
    button.focus()
    page.keyboard.press("Enter")
    assert button.get_attribute("aria-expanded") == "true"
    text = page.locator(f"#{button.get_attribute('aria-controls')}").inner_text()
    assert "failed: after step 1 no mode of the model matches measured mode" in text
    page.keyboard.press("Enter")
    assert button.get_attribute("aria-expanded") == "false"


def test_all_filters_at_once(page: Page, real: Any) -> None:
    tick(page, "scenarios", "frame")
    tick(page, "blocks", "used")
    tick(page, "strategies", "unchanged", "kabe")
    kept = [n for n in real.run.meta["strategies"] if n not in ("unchanged", "kabe")]
    whole = part(real.run, cases=["hframe", "frame-solid"], strategies=kept)
    assert_shows(page, whole, without=["used_percent"])


def test_intervals_of_a_part_are_over_its_structures(
    view: Callable[..., Any], command: Callable[..., str], tmp_path: Path
) -> None:
    """Twelve structures, one of two cases; of the whole run the leaderboard's own intervals."""
    run = synthetic_run(5, 12, failing=0.0)
    structures = {case: case.partition("/")[0] for case in run.meta["cases"]}
    run = RunData({**run.meta, "structures": structures}, run.results)
    data = tmp_path / "run.json"
    data.write_text(json.dumps(run_to_json(run)), encoding="utf-8")
    command("report", data, "-f", "html", "-o", tmp_path)
    (file,) = tmp_path.glob("*.html")
    page = view(file).page
    page.wait_for_selector("html[data-ready=yes]")

    def intervals() -> dict[str, list[float]]:
        read = "() => bench.board.rows().map((r) => [r.strategy, [r.gain_low, r.gain_high]])"
        return dict(page.evaluate(read))

    def expected(whole: RunData) -> dict[str, list[float]]:
        rows = leaderboard(whole).to_dict("records")
        return {row["strategy"]: [row["gain_low"], row["gain_high"]] for row in rows}

    # No strategy states an uncertainty; the common one is learned from twelve structures.
    lines = page.locator("#predictive tbody tr").all_inner_texts()
    for line, row in zip(lines, PredictiveBoard.of(run).rows, strict=True):
        assert line.split("\t")[0] == "= " * bool(row["yardstick"]) + row["strategy"]
        assert float(line.split("\t")[1]) == pytest.approx(row["above_crps_percent"], rel=5e-3)
        assert float(line.split("\t")[3]) == pytest.approx(row["above_skill"], abs=6e-4)
    assert "over structures" in page.locator("#board-table thead").inner_text()
    assert intervals() == {name: pytest.approx(ends) for name, ends in expected(run).items()}
    tick(page, "scenarios", "scenario-03")
    kept = [case for case in run.meta["cases"] if case != "scenario-03"]
    for name, ends in expected(part(run, cases=kept)).items():
        assert intervals()[name] == pytest.approx(ends, abs=0.05), name


@pytest.mark.nightly
def test_both_nominal_models_stand_side_by_side(
    view: Callable[..., Any], command: Callable[..., str], tmp_path: Path
) -> None:
    data, file = tmp_path / "run.json", tmp_path / "run.html"
    words = ("run", "frame", "-s", "unchanged", "-s", "baruch", "-q", "--store", tmp_path)
    command(*words, "--json", data, "--report", file)
    page = view(file).page
    page.wait_for_selector("html[data-ready=yes]")
    board = leaderboard(read_run(data)).set_index("strategy")
    for name, row in shown(page).items():
        assert row["gain_drawn"] == pytest.approx(board.loc[name, "gain_drawn"])
        assert row["gain_drawn"] < -0.5 < row["gain"]
    assert "Ranks are from the textbook models" in page.locator("p.lead").inner_text()
    view_case = view(file, "#case/frame").page
    text = view_case.locator("table.case-frequencies").inner_text()
    assert "from drawn" in text
    assert "as printed" in text
    ours = next(
        r
        for r in json.loads(data.read_text())["results"]
        if (r["strategy"], r["nominal"]) == ("baruch", "drawn")
    )
    assert f"{ours['higher']['modes'][1]['predicted_hz']:.1f}" in text
