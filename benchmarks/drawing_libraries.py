"""What JavaScript libraries that draw cost, and whether they do under the policy of our pages.

    python benchmarks/drawing_libraries.py FOLDER [REPEATS]

FOLDER has the npm packages as published, each in a folder of its name with `_` for `@` and `/`:

    for package in @observablehq/plot@0.6.17 d3@7.9.2 echarts@6.1.0 three@0.187.0 uplot@1.6.32 \\
        plotly.js-basic-dist-min@4.1.1 plotly.js-gl3d-dist-min@4.1.1 \\
        plotly.js-strict-dist-min@4.1.1 vega@6.4.0 vega-interpreter@2.3.2 vega-lite@6.5.0; do
      to=FOLDER/$(echo "${package%@*}" | tr @/ __) && mkdir -p "$to"
      tar -xzf "$(npm pack --silent "$package")" -C "$to"
    done

Every library draws a matrix of 40 x 60 values, a chart of 10 curves of 100 points and a structure
of 1000 nodes that moves, with `drawing_libraries.js`, in a page whose policy allows inline scripts
and styles alone. Prints the tables of docs/development/drawing.md: medians of REPEATS pages (5).
Milliseconds are of the page's main thread, and in brackets until the picture stood. Needs chromium,
see CONTRIBUTING.md.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import re
import shutil
import statistics
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.image import imread
from playwright.sync_api import Browser, Error, Page, sync_playwright
from tabulate import tabulate

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
TASKS = ("matrix", "chart", "structure")
FRAMES = 60
MOST_STOPS = 20  # of the keyboard that are tried in one drawing
# WebGL without a graphics card, as on a machine for tests.
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


@dataclass(frozen=True)
class Library:
    """A way to draw.

    Arguments:
        title: what the tables call it.
        key: its entry in DRAWERS of the script.
        files: package and path of what a page has to contain.
    """

    title: str
    key: str
    files: tuple[tuple[str, str], ...]


VEGA = (("vega", "build/vega.min.js"), ("vega-lite", "build/vega-lite.min.js"))
PLOTLY = "plotly.js-{0}-dist-min", "plotly-{0}.min.js"
LIBRARIES = (
    Library(
        "Observable Plot, d3",
        "plot",
        (("d3", "dist/d3.min.js"), ("@observablehq/plot", "dist/plot.umd.min.js")),
    ),
    Library(
        "Plotly basic", "plotlyBasic", ((PLOTLY[0].format("basic"), PLOTLY[1].format("basic")),)
    ),
    Library("Plotly gl3d", "plotlyGl", ((PLOTLY[0].format("gl3d"), PLOTLY[1].format("gl3d")),)),
    Library(
        "Plotly strict", "plotlyStrict", ((PLOTLY[0].format("strict"), PLOTLY[1].format("strict")),)
    ),
    Library("Vega-Lite as it is", "vegaLite", VEGA),
    Library(
        "Vega-Lite, interpreter",
        "vegaLiteInterpreted",
        (*VEGA, ("vega-interpreter", "build/vega-interpreter.js")),
    ),
    Library("ECharts", "echarts", (("echarts", "dist/echarts.min.js"),)),
    Library(
        "uPlot", "uplot", (("uplot", "dist/uPlot.iife.min.js"), ("uplot", "dist/uPlot.min.css"))
    ),
    Library(
        "three.js", "three", (("three", "build/three.core.js"), ("three", "build/three.module.js"))
    ),
)


@dataclass
class Drawing:
    """What a library did with one task.

    Arguments:
        processor, wall: milliseconds of every repetition until the picture stood.
        frame_processor, frame_wall: milliseconds of one frame, of every repetition.
        names, roles: elements with an accessible name and with a role.
        stops, answers: stops of the keyboard, and those at which a key changes the picture.
        messages, requests: of the console, and beyond the page itself.
        error: why there is no picture, "" if there is one.
    """

    processor: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)
    frame_processor: list[float] = field(default_factory=list)
    frame_wall: list[float] = field(default_factory=list)
    names: int = 0
    roles: int = 0
    stops: int = 0
    answers: int = 0
    messages: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    error: str = ""


def home(folder: Path, package: str) -> Path:
    """Return where a package lies."""
    return folder / re.sub("[@/]", "_", package) / "package"


def pairs(listed: str, sign: str) -> str:
    """Return names of an import or export as those of an object, "a as b" as "a: b"."""
    return re.sub(r"\s+as\s+", sign, listed)


def inlined(module: str, target: str, source: str) -> str:
    """Return a module with one import and its exports as a script that sets a global variable."""
    module = re.sub(r"^export \{[^}]*\} from [^;]*;", "", module, flags=re.MULTILINE)
    module = re.sub(
        r"^import \{([^}]*)\} from [^;]*;",
        lambda found: f"const {{{pairs(found[1], ': ')}}} = {source};",
        module,
        flags=re.MULTILINE,
    )

    def returned(found: re.Match[str]) -> str:
        names = [name.strip().split(" as ") for name in found[1].split(",")]
        return f"return {{{', '.join(f'{name[-1]}: {name[0]}' for name in names)}}};"

    module = re.sub(r"^export \{([^}]*)\};", returned, module, flags=re.MULTILINE)
    return f"{target} = (() => {{\n{module}\n}})();"


def script_of(path: Path) -> str:
    """Return a file of a library as text that a page can contain; modules become scripts."""
    text = path.read_text(encoding="utf-8")
    if path.name == "three.core.js":
        text = inlined(text, "window.THREE", "")
    elif path.name == "three.module.js":
        text = inlined(text, "window.more", "THREE") + "\nObject.assign(THREE, more);"
    elif path.name == "vega-interpreter.js":
        text = inlined(text, "window.vegaInterpreter", "vega")
    if path.suffix == ".css":
        return f"<style>{text}</style>"
    return "<script>" + re.sub("</(?=script)", r"<\/", text) + "</script>"


def page_of(folder: Path, library: Library) -> str:
    """Return the text of a page with a library and the drawings."""
    own = Path(__file__).with_suffix(".js").read_text(encoding="utf-8")
    files = [script_of(home(folder, package) / path) for package, path in library.files]
    return "\n".join(
        [
            "<!doctype html><html lang=en><head><meta charset=utf-8><title>Drawings</title>",
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            "</head><body><div id=box style='width: 900px; height: 500px'></div>",
            *files,
            f"<script>{own}</script></body></html>",
        ]
    )


def picture(page: Page) -> np.ndarray:
    """Return the pixels of the drawing."""
    return np.asarray(imread(io.BytesIO(page.locator("#box").screenshot()), format="png"))


def is_blank(pixels: np.ndarray) -> bool:
    """Return whether fewer than one pixel in a thousand differs from the paper."""
    return bool(np.mean(np.any(pixels != pixels[0, 0], axis=-1)) < 1e-3)


def settled(page: Page) -> np.ndarray:
    """Return the pixels of the drawing once two pictures are alike: tips fade in."""
    last = picture(page)
    for _ in range(20):
        page.wait_for_timeout(150)
        last, before = picture(page), last
        if np.array_equal(last, before):
            break
    return last


def walk(page: Page, drawing: Drawing) -> None:
    """Go through the drawing with the keyboard, then press keys at every stop."""
    seen: list[int] = []
    for _ in range(MOST_STOPS):
        page.keyboard.press("Tab")
        stop = int(page.evaluate("focused()"))
        if stop < 0 or stop in seen:
            break
        seen.append(stop)
    drawing.stops = len(seen)
    for number in range(len(seen)):
        # Not by Tab: a library may build its buttons anew when one is pressed.
        page.evaluate("(number) => focusStop(number)", number)
        before = settled(page)
        for key in ("ArrowRight", "ArrowDown", "Enter"):
            page.keyboard.press(key)
            if not np.array_equal(before, settled(page)):
                drawing.answers += 1
                break


def timed(page: Page, action: Callable[[], float]) -> tuple[float, float]:
    """Return milliseconds of the main thread and of the clock that something took."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def busy() -> float:
        metrics = session.send("Performance.getMetrics")["metrics"]
        return 1000.0 * float(
            next(one["value"] for one in metrics if one["name"] == "TaskDuration")
        )

    before = busy()
    wall = action()
    return busy() - before, wall


def draw(page: Page, library: Library, task: str, drawing: Drawing) -> None:
    """Draw once, and move it where it moves."""
    processor, wall = timed(
        page, lambda: float(page.evaluate("([a, b]) => draw(a, b)", [library.key, task]))
    )
    drawing.processor.append(processor)
    drawing.wall.append(wall)
    if is_blank(picture(page)):
        drawing.error = "nothing is drawn"
    elif task == "structure":
        page.evaluate("animate(5)")
        processor, wall = timed(page, lambda: float(page.evaluate(f"animate({FRAMES})")))
        drawing.frame_processor.append(processor / FRAMES)
        drawing.frame_wall.append(wall / FRAMES)


def measured(
    browser: Browser, file: Path, library: Library, task: str, repeats: int
) -> Drawing | None:
    """Return what a library does with a task; None if it has nothing for it."""
    drawing = Drawing()
    for turn in range(repeats):
        page = browser.new_context(viewport={"width": 1000, "height": 600}).new_page()
        page.on(
            "console",
            lambda said: drawing.messages.append(re.sub(r"blob:[^']*", "blob:", said.text)),
        )
        page.on("pageerror", lambda error: drawing.messages.append(str(error)))
        page.on("request", lambda request: drawing.requests.append(request.url))
        page.goto(file.as_uri())
        try:
            if page.evaluate("([a, b]) => !DRAWERS[a][b]", [library.key, task]):
                return None
            draw(page, library, task, drawing)
        except Error as error:
            drawing.error = error.message.strip().splitlines()[0]
        if turn == 0 and not drawing.error:
            found = page.evaluate("counted()")
            drawing.names, drawing.roles = found["names"], found["roles"]
            walk(page, drawing)
        page.context.close()
        if drawing.error:
            break
    own = file.as_uri()
    drawing.requests = [
        url for url in drawing.requests if url != own and not url.startswith(("data:", "blob:"))
    ]
    return drawing


def milliseconds(processor: list[float], wall: list[float]) -> str:
    """Return medians as a cell."""
    if not processor:
        return "–"
    return f"{statistics.median(processor):.1f} ({statistics.median(wall):.0f})"


def weight_row(folder: Path, library: Library) -> list[str]:
    """Return what the package says of itself, and its weight."""
    about = [
        json.loads((home(folder, package) / "package.json").read_text(encoding="utf-8"))
        for package in dict.fromkeys(package for package, _ in library.files)
    ]
    data = [(home(folder, package) / path).read_bytes() for package, path in library.files]
    return [
        library.title,
        ", ".join(one["version"] for one in about),
        ", ".join(dict.fromkeys(one["license"] for one in about)),
        f"{sum(map(len, data)):,}".replace(",", " "),
        f"{sum(len(gzip.compress(text, mtime=0)) for text in data):,}".replace(",", " "),
    ]


def cell(found: Drawing | None, text: Callable[[Drawing], str]) -> str:
    """Return a cell of a drawing that may not be there."""
    return "none" if found is None else "fails" if found.error else text(found)


def rows_of(library: Library, found: dict[str, Drawing | None]) -> tuple[list[str], list[str]]:
    """Return the rows of a library in the tables of times and of access."""
    there = [drawing for drawing in found.values() if drawing is not None]
    errors = list(dict.fromkeys(drawing.error for drawing in there if drawing.error))
    messages = len({text for drawing in there for text in drawing.messages})
    requests = len({text for drawing in there for text in drawing.requests})
    good = sum(not drawing.error for drawing in there)
    times = [
        library.title,
        f"{good} of {len(there)}",
        *(cell(found[task], lambda one: milliseconds(one.processor, one.wall)) for task in TASKS),
        cell(found["structure"], lambda one: milliseconds(one.frame_processor, one.frame_wall)),
        f"{messages}, {requests}",
    ]
    access = [
        library.title,
        *(cell(found[task], lambda one: f"{one.names}, {one.roles}") for task in TASKS),
        *(cell(found[task], lambda one: f"{one.stops}, {one.answers}") for task in TASKS),
    ]
    for text in errors:
        print(f"{library.title}: {text}", file=sys.stderr)
    return times, access


def main(folder: Path, repeats: int) -> None:
    """Measure and print."""
    path = os.environ.get("FEMUBENCH_CHROMIUM") or shutil.which("chromium")
    times, access = [], []
    with tempfile.TemporaryDirectory() as place, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=FLAGS)
        for library in LIBRARIES:
            file = Path(place, f"{library.key}.html")
            file.write_text(page_of(folder, library), encoding="utf-8")
            found = {task: measured(browser, file, library, task, repeats) for task in TASKS}
            said = [text for one in found.values() if one for text in one.messages]
            for text in dict.fromkeys(said):
                print(f"{library.title}: {text}", file=sys.stderr)
            row_of_times, row_of_access = rows_of(library, found)
            times.append(row_of_times)
            access.append(row_of_access)
        browser.close()
    weights = [weight_row(folder, library) for library in LIBRARIES]
    heads = (
        ["library", "version", "licence", "bytes", "bytes, gzip"],
        ["library", "drawn", "matrix", "chart", "structure", "a frame", "messages, requests"],
        [
            "library",
            *(f"names, roles: {t}" for t in TASKS),
            *(f"stops, answers: {t}" for t in TASKS),
        ],
    )
    for head, rows in zip(heads, (weights, times, access), strict=True):
        print(tabulate(rows, head, tablefmt="github", disable_numparse=True), end="\n\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 5)
