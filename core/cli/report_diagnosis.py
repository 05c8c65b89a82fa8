"""A stored diagnosis in any form: ``bench report DIAGNOSIS.json``."""

from __future__ import annotations

import webbrowser
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

from femubench.core.cli.files import check_writable, make_folder, write_atomically
from femubench.core.errors import InputError
from femubench.core.files import read_bytes
from femubench.core.schema.records import parse_json

MOST_BYTES = 64 * 2**20
_KEYS = frozenset({"verdict", "causes", "rivals", "smallest_visible"})
_SUFFIX = {"html": ".html", "markdown": ".md", "terminal": ".txt", "json": ".json"}


def diagnosis_in(path: Path) -> Mapping[str, Any] | None:
    """Return the diagnosis that a JSON file holds; None where it holds something else.

    Raises:
        InputError: when it cannot be read, or is a diagnosis with a wrong field.
    """
    expected = "what 'bench run --json' or 'bench diagnose --json' writes"
    data = parse_json(read_bytes(path, MOST_BYTES), file=path, expected=expected)
    if not isinstance(data, dict) or not data.keys() >= _KEYS:
        return None
    from femubench.core.diagnosis.serial import diagnosis_from_json

    return diagnosis_from_json(data, file=path)


def report_diagnosis(
    data: Mapping[str, Any],
    path: Path,
    formats: Iterable[str],
    output: Path | None,
    *,
    opened: bool,
) -> None:
    """Show a diagnosis, or write it beside its file.

    Arguments:
        data: as `diagnosis_in` gives it.
        path: of its file, from which the names of others follow.
        formats: terminal, markdown, html or json.
        output: folder for all of them.
        opened: show the page in the browser.

    Raises:
        InputError: for another format.
    """
    for name in formats:
        if name not in _SUFFIX:
            expected = f"one of {', '.join(_SUFFIX)}"
            raise InputError(f"a diagnosis has no format {name!r}", file=path, expected=expected)
    for name in formats:
        text = _text(data, name)
        if output is None and name != "html":
            click.echo(text)
            continue
        if output is not None:
            make_folder(output)
        written = (output or path.parent) / f"{path.stem}{_SUFFIX[name]}"
        check_writable(written)
        write_atomically(written, text)
        click.echo(f"{name}: {written}")
        if opened and name == "html" and not webbrowser.open(written.resolve().as_uri()):
            click.echo(f"bench: there is no browser here; open {written} in one", err=True)


def _text(data: Mapping[str, Any], name: str) -> str:
    import json

    from femubench.reports.diagnosis import diagnosis_markdown, diagnosis_text
    from femubench.reports.diagnosis_page import diagnosis_html

    if name == "json":
        return json.dumps(data, indent=1, allow_nan=False)
    renderers = {
        "html": diagnosis_html,
        "markdown": diagnosis_markdown,
        "terminal": diagnosis_text,
    }
    return renderers[name](data)
