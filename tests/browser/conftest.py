"""Pages in a real browser: Debian's chromium, driven by playwright, which downloads nothing."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, sync_playwright

from femubench import report
from femubench.core.schema.records import read_run
from femubench.core.score.ranking import rank_results
from femubench.results import JobResult, RunData
from tests.command import call_bench

NAMES = ("chromium", "chromium-browser", "google-chrome")
STRATEGIES = ("unchanged", "baruch", "generic-ls", "local", "nobari", "kabe")
CASES = ("frame", "hframe", "frame-solid")
# Without asking for style sheets once more, which the policy of the site refuses.
AXE = {"resultTypes": ["violations"], "preload": False}
WIDE, NARROW = (1440, 900), (390, 844)


@dataclass(frozen=True)
class Real:
    """A real run: its results, and the pages that the command line makes of them.

    Arguments:
        run: the results as `bench run --json` wrote them.
        json_file, page: that file, and the report.
        store: with the exhibits.
    """

    run: RunData
    json_file: Path
    page: Path
    store: Path


@dataclass
class View:
    """A page in the browser with everything that it said, asked for and showed by itself."""

    page: Page
    messages: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    dialogs: list[str] = field(default_factory=list)

    def assert_accessible(self) -> None:
        """Axe-core finds no serious fault in what is shown."""
        assert [
            (fault["id"], fault["help"], node["html"], node["failureSummary"])
            for fault in Axe().run(self.page, options=AXE).response["violations"]
            if fault["impact"] in ("serious", "critical")
            for node in fault["nodes"]
        ] == []

    def assert_quiet(self, *files: Path) -> None:
        """Nothing was said, nothing but the files was asked for, nothing popped up."""
        assert self.messages == []
        assert self.dialogs == []
        own = {path.resolve().as_uri() for path in files}
        asked = {url.partition("#")[0] for url in self.requests if not url.startswith("data:")}
        assert asked == own


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave the browser out of `make check`; a test that ends one is charged with all it did."""
    for item in items:
        if item.path.parent == Path(__file__).parent:
            item.add_marker(pytest.mark.slow(20))


def chromium() -> str:
    """Return the path of the browser: of FEMUBENCH_CHROMIUM, or the first that is installed."""
    found = os.environ.get("FEMUBENCH_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), "")
    if not found or not os.access(found, os.X_OK):
        pytest.fail(
            "the tests of the pages need a browser: apt install chromium, or name one in "
            f"FEMUBENCH_CHROMIUM (looked for {found or ', '.join(NAMES)})",
            pytrace=False,
        )
    return found


def call(*arguments: object, code: int = 0) -> str:
    """Call the command line; return what it printed."""
    return call_bench(*arguments, code=code).output


@pytest.fixture(scope="session")
def command() -> Callable[..., str]:
    return call


@pytest.fixture(scope="session")
def real(tmp_path_factory: pytest.TempPathFactory) -> Real:
    """Run some strategies, of which one fails and two are unphysical, and report; once for all."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    store, json_file, page = (shared / name for name in ("real-store", "real.json", "real.html"))
    with (shared / "real.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not page.exists():
            wanted = [word for name in STRATEGIES for word in ("-s", name)]
            # As the papers start; test_board.py has a run from both nominal models.
            start = ("--nominal", "drawn", "-q", "--store", store)
            call("run", *CASES, *wanted, *start, "--json", json_file)
            run = with_a_failure(read_run(json_file))
            report(run, json_file)
            report(run, page, store=store)
    return Real(read_run(json_file), json_file, page, store)


def with_a_failure(run: RunData) -> RunData:
    """Return a run in which one job gave no model; none does so by itself."""
    lost = next(r for r in run.results if (r.case, r.strategy) == ("hframe", "kabe"))
    why = "after step 1 no mode of the model matches measured mode 3"
    job = JobResult(lost.case, lost.strategy, lost.seed, "failed", why)
    failed = replace(job, key=lost.key, provenance=lost.provenance)
    listed = [failed if result is lost else result for result in run.results]
    return RunData(run.meta, rank_results(listed, run.meta))


# Not for the whole session: its event loop would be in the way of tests elsewhere.
@pytest.fixture(scope="module")
def browser(real: Real) -> Iterator[Browser]:
    """Start the browser, after the run: its processes must not inherit the browser's pipes."""
    path = chromium()
    with sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture
def view(browser: Browser) -> Iterator[Callable[..., View]]:
    """Return what opens a file in a fresh window."""
    windows = []

    def opened(
        file: Path, at: str = "", *, size: tuple[int, int] = WIDE, still: bool = True, **more: Any
    ) -> View:
        window = browser.new_context(
            viewport={"width": size[0], "height": size[1]},
            reduced_motion="reduce" if still else "no-preference",
            **more,
        )
        windows.append(window)
        window.set_default_timeout(300_000)  # ms; others may use the machine
        found = View(window.new_page())
        page = found.page
        page.on("console", lambda message: found.messages.append(message.text))
        page.on("pageerror", lambda error: found.messages.append(str(error)))
        page.on("request", lambda request: found.requests.append(request.url))
        page.on("dialog", lambda dialog: (found.dialogs.append(dialog.message), dialog.dismiss()))
        page.goto(file.resolve().as_uri() + at)
        return found

    yield opened
    for window in windows:
        window.close()
