"""The page of a run as one HTML document: style, scripts and data inside, nothing fetched."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from femubench.reports.page.rounding import compact_json
from femubench.reports.templating import asset, templates

STYLES = ("page.css", "run.css", "case.css")
# One classic script; each file adds to what those before it have made.
SCRIPTS = (
    *("vendor/d3.min.js", "vendor/plot.umd.min.js"),
    *("core.js", "sortable.js", "charts.js", "structure.js"),
    *("ranking.js", "filters.js", "overview.js", "case_matrix.js", "board.js"),
    *("case_tables.js", "case.js", "app.js", "figures.js"),
)
# What could end the element that holds the data, or a line of script.
_ESCAPES = {ord(letter): f"\\u{ord(letter):04x}" for letter in "<>&\u2028\u2029"}


def document(data: Mapping[str, Any], *, title: str) -> str:
    """Return the document."""
    from markupsafe import Markup

    page = templates().overlay(keep_trailing_newline=True).get_template("run.html")
    return page.render(
        title=title,
        run=data["run"],
        style=Markup("\n".join(asset(name) for name in STYLES)),
        script=Markup("\n".join(asset(name) for name in SCRIPTS)),
        data=Markup(embed_json(data)),
    )


def embed_json(data: Any) -> str:  # noqa: ANN401 - JSON data of any form
    """Return JSON that can end neither a script element nor a line of it."""
    return compact_json(data).translate(_ESCAPES)
