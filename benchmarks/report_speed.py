"""How large the page of a run and a published site are, and how long they take to open and to sort.

    python benchmarks/report_speed.py [STORE]

STORE is a store with a run of everything (`bench run`), by default that of `bench report`. Prints
the size of its page and the time until its leaderboard stands, then for made-up runs of 40
strategies on 60 cases and 200 on 55 the time to sort; the same of a site of 40 strategies on 60
cases, with the time to publish it and to filter. Needs chromium, see CONTRIBUTING.md.
"""

from __future__ import annotations

import os
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

from femubench.core.run.store import Store
from femubench.reports.htmls import HtmlReporter

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "toys"))
from synthetic_run import synthetic_run
from synthetic_site import synthetic_site

REPEATS = 5
SIZE, OPENING, SORTING = 8.0, 2.0, 200.0  # MB, s, ms: what is asked for
KEYS = ("gain", "strategy", "seconds", "coverage", "flags", "rank")
# From the request to the leaderboard; the figures below it are there too.
READY = (
    "(({ startTime, duration }) => startTime + duration)(performance.getEntriesByName('bench')[0])"
)


def opened(browser: Browser, file: Path) -> tuple[Page, float]:
    """Return a page in a fresh window and the seconds until it stood."""
    page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
    page.goto(file.as_uri())
    page.wait_for_selector("html[data-ready=yes]")
    return page, float(page.evaluate(READY)) / 1000.0


def opening(browser: Browser, file: Path) -> float:
    """Return the median of the seconds that the page takes to open."""
    found = []
    for _ in range(REPEATS):
        page, seconds = opened(browser, file)
        found.append(seconds)
        page.context.close()
    return statistics.median(found)


def sorting(page: Page, key: str) -> tuple[float, float]:
    """Return milliseconds of processor and of wall time until a click has sorted and laid out."""
    return timed(page, f"document.querySelector('th[data-key={key}] button').click()")


def timed(page: Page, deed: str) -> tuple[float, float]:
    """Return milliseconds of processor and of wall time until a page is laid out after a deed."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def busy() -> float:
        metrics = session.send("Performance.getMetrics")["metrics"]
        return 1000.0 * next(one["value"] for one in metrics if one["name"] == "TaskDuration")

    before = busy()
    wall = page.evaluate(
        f"""() => {{
          const start = performance.now();
          {deed};
          document.querySelector("table").getBoundingClientRect();
          return performance.now() - start;
        }}"""
    )
    page.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)))")
    return busy() - before, float(wall)


def measure_site(browser: Browser, folder: Path) -> None:
    """Publish a site, then open, sort and filter its first page."""
    began, wall = time.process_time(), time.perf_counter()
    site = synthetic_site(folder)
    began, wall = time.process_time() - began, time.perf_counter() - wall
    size = sum(path.stat().st_size for path in site.rglob("*") if path.is_file()) / 1e6
    print(f"site, 40 strategies x 60 cases: {size:.1f} MB, two runs published in {wall:.1f} s")
    print(f"  of which {began:.1f} s of processor")
    for kind in ("index.html", "classes/*.html", "strategies/*.html", "cases/*.html"):
        file, found = min(site.glob(kind)), []
        for _ in range(REPEATS):
            page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
            page.goto(file.as_uri())
            found.append(page.evaluate("performance.getEntriesByType('navigation')[0].duration"))
            page.context.close()
        print(f"  {kind}: {file.stat().st_size / 1e3:.0f} kB, opens in {min(found):.0f} ms")
    page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
    page.goto((site / "index.html").as_uri())
    page.wait_for_timeout(500)
    for number in range(0, 14, 3):
        deed = f"document.querySelectorAll('.filtered thead button')[{number}].click()"
        print("  sort by column {}: {:.0f} ms of processor, {:.0f} ms in all".format(
            number + 1, *timed(page, deed)
        ))  # fmt: skip
    typed = "filter.value = '01'; filter.dispatchEvent(new Event('input'))"
    print("  filter: {:.0f} ms of processor, {:.0f} ms in all".format(*timed(page, typed)))


def main(store: Path) -> None:
    """Measure and print."""
    shelf = Store(store)
    run = shelf.load()
    path = os.environ.get("FEMUBENCH_CHROMIUM") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        print(f"{run.meta['run']}: {len(run.results)} results")
        print(f"asked for: this run < {SIZE:g} MB and < {OPENING:g} s, sorting < {SORTING:g} ms")
        pages = {
            "this run": HtmlReporter().render_with(run, shelf.exhibits),
            "40 strategies x 60 cases": HtmlReporter().render(synthetic_run(40, 54)),
            "200 strategies x 55 cases": HtmlReporter().render(synthetic_run(200, 50)),
        }
        for name, text in pages.items():
            file = Path(folder, "page.html")
            file.write_text(text, encoding="utf-8")
            print(
                f"{name}: {file.stat().st_size / 1e6:.2f} MB, "
                f"opens in {opening(browser, file):.2f} s"
            )
            page, _ = opened(browser, file)
            page.wait_for_timeout(1500)
            for key in KEYS:
                processor, wall = sorting(page, key)
                print(f"  sort by {key}: {processor:.0f} ms of processor, {wall:.0f} ms in all")
        measure_site(browser, Path(folder, "site"))
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "femubench-results"))
