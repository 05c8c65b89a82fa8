"""A run, or whatever else there is to report, as a page with everything inside of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from femubench.reports.page.data import ExhibitSource, page_data
from femubench.reports.page.document import document
from femubench.results import RunData, StudyAxes

if TYPE_CHECKING:
    from femubench import Identification
    from femubench.reproduction import Study


class HtmlReporter:
    """One HTML document that needs no network."""

    name = "html"
    suffix = ".html"

    def render(self, run: RunData) -> str:
        """Return the page, without what only a store can add."""
        return self.render_with(run, None)

    def render_with(self, run: RunData, exhibits: ExhibitSource | None) -> str:
        """Return the page with the drawings that the store has."""
        if StudyAxes.from_run(run) is not None:
            from femubench.reports.study import study_html

            return study_html(run)
        data = page_data(run, exhibits)
        return document(data, title=f"femubench run {data['run']}".rstrip())

    def render_diagnosis(self, data: Mapping[str, Any]) -> str:
        """Return the page of a diagnosis."""
        from femubench.reports.diagnosis import diagnosis_html

        return diagnosis_html(data)

    def render_comparison(self, data: Mapping[str, Any]) -> str:
        """Return the page of a comparison."""
        from femubench.reports.compare_page import comparison_html

        return comparison_html(data)

    def render_studies(self, studies: Sequence[Study], drawings: Mapping[str, str]) -> str:
        """Return the page of papers worked through, with the SVG of every figure by its name."""
        from femubench.reports.reproduction_page import reproduction_html

        return reproduction_html(studies, drawings)

    def render_modes(self, found: Identification, source: str = "") -> str:
        """Return the page of identified modes, from the file `source`."""
        from femubench.reports.identification import identification_html

        return identification_html(found, source)

    def render_site(self, index: Mapping[str, Any]) -> dict[str, str]:
        """Return the files of a public leaderboard by their names, but for its data."""
        from femubench.reports.publish_page import pages_of

        return pages_of(index)
