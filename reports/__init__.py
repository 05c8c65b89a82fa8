"""Reports on stored results: screen, HTML, Markdown, tables, JSON; nothing here runs anything."""

from __future__ import annotations

from femubench import hookimpl
from femubench.reports.csvs import CsvReporter, ModesCsvReporter
from femubench.reports.htmls import HtmlReporter
from femubench.reports.jsons import JsonReporter
from femubench.reports.markdown import MarkdownReporter
from femubench.reports.parquets import ParquetReporter
from femubench.reports.terminal import TerminalReporter
from femubench.results import Reporter


@hookimpl
def femubench_reporters() -> list[Reporter]:
    """Return the built-in reporters."""
    return [
        TerminalReporter(),
        HtmlReporter(),
        MarkdownReporter(),
        CsvReporter(),
        ModesCsvReporter(),
        JsonReporter(),
        ParquetReporter(),
    ]
