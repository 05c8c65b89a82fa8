"""Blocks of a report as one HTML document: nothing but itself is needed to read it."""

from __future__ import annotations

from collections.abc import Iterable

from markupsafe import Markup

from femubench.reports.blocks import Passage
from femubench.reports.cells import plain
from femubench.reports.templating import asset, templates


def to_html(
    sections: Iterable[Passage],
    *,
    title: str,
    heading: str,
    lead: str = "",
    brand: str = "",
    foot: str = "",
    scripts: Iterable[str] = (),
) -> str:
    """Return a document; whatever comes from data is escaped.

    Arguments:
        sections: of level 2 and 3, in reading order.
        heading: at the top, the line that matters most.
        lead: a line above it; may be empty.
        brand, foot: one line above all, and one below; may be empty.
        scripts: names of assets; the document reads without them.
    """
    room = templates().overlay(finalize=_shown)
    return room.get_template("report.html").render(
        title=title,
        heading=heading,
        lead=lead,
        brand=brand,
        foot=foot,
        sections=list(sections),
        style=Markup(asset("page.css") + asset("report.css")),
        script=Markup("".join(map(asset, scripts))),
    )


def _shown(value: object) -> object:
    """Return text on one line, a number and its percent sign together."""
    if isinstance(value, Markup):
        return value
    text = plain(value).replace(" %", "\N{NO-BREAK SPACE}%")
    return text.replace("> ", ">\N{NO-BREAK SPACE}").replace("< ", "<\N{NO-BREAK SPACE}")
