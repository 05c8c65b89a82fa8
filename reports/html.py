"""A report as one HTML document: nothing but itself is needed to read it, no script runs."""

from __future__ import annotations

from collections.abc import Iterable

from femubench.reports.blocks import Section
from femubench.reports.svg import embedded
from femubench.reports.templating import templates


def to_html(sections: Iterable[Section], *, title: str, heading: str) -> str:
    """Return a document; whatever comes from data is escaped.

    Arguments:
        sections: of level 2 and 3, in reading order.
        title: in the title bar.
        heading: at the top, the line that matters most.
    """
    page = templates().get_template("report.html")
    return page.render(title=title, heading=heading, sections=list(sections), embedded=embedded)
