"""The page of a run as one HTML document: style, scripts and data inside, nothing fetched."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from femubench.reports.cells import plain

TEMPLATE, STYLES = "run.html", ("run.css", "case.css")
# One classic script; each file adds to what those before it have made.
SCRIPTS = (
    *("core.js", "charts.js", "heat.js", "scene.js", "structure.js", "element_map.js"),
    *("ranking.js", "filters.js", "overview.js", "board.js"),
    *("case_tables.js", "case.js", "app.js"),
)
# What could end the element that holds the data, or a line of script.
_ESCAPES = {ord(letter): f"\\u{ord(letter):04x}" for letter in "<>&\u2028\u2029"}


def document(
    data: Mapping[str, Any],
    *,
    title: str,
    template: str = TEMPLATE,
    styles: tuple[str, ...] = STYLES,
    scripts: tuple[str, ...] = SCRIPTS,
) -> str:
    """Return the document.

    The template has `title` (text, which is escaped), and `style`, `script` and `data` for the
    middle of a style, a script and a JSON element.

    Arguments:
        data: for JSON.
        title: of the window.
        template, styles, scripts: names of assets.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined
    from markupsafe import Markup

    room = Environment(
        loader=FunctionLoader(asset),
        autoescape=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    found = room.get_template(template)
    return found.render(
        title=plain(title),
        style=Markup("\n".join(asset(name) for name in styles)),
        script=Markup("\n".join(asset(name) for name in scripts)),
        data=Markup(embedded_json(data)),
    )


def asset(name: str) -> str:
    """Return the text of one of our files."""
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


def embedded_json(data: Any) -> str:  # noqa: ANN401 - JSON data of any form
    """Return JSON that can end neither a script element nor a line of it."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.translate(_ESCAPES)
