"""A run as a page to look at, with everything inside of it."""

from __future__ import annotations

from femubench.reports.page.data import Exhibits, page_data
from femubench.reports.page.document import document
from femubench.results import Run


class HtmlReporter:
    """One HTML document that needs no network."""

    name = "html"
    suffix = ".html"

    def render(self, run: Run) -> str:
        """Return the page, without what only a store can add."""
        return self.render_with(run, None)

    def render_with(self, run: Run, exhibits: Exhibits | None) -> str:
        """Return the page with the drawings that the store has."""
        data = page_data(run, exhibits)
        return document(data, title=f"femubench run {data['run']}".rstrip())
