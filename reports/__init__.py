"""Reports on stored results: screen, HTML, Markdown, tables, JSON; nothing here runs anything."""

from __future__ import annotations

from femubench import hookimpl

CLASSES = {
    "terminal": "runs:TerminalReporter",
    "html": "htmls:HtmlReporter",
    "markdown": "runs:MarkdownReporter",
    "csv": "csvs:CsvReporter",
    "modes-csv": "csvs:ModesCsvReporter",
    "json": "jsons:JsonReporter",
    "jsonl": "jsons:JsonLinesReporter",
    "predictive": "predictive:PredictiveReporter",
    "parquet": "parquets:ParquetReporter",
}


@hookimpl
def femubench_reporters() -> dict[str, str]:
    """Return where the built-in reporters are."""
    return {name: f"{__name__}.{place}" for name, place in CLASSES.items()}
