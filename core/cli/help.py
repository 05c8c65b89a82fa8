"""``bench help``: what a key, an effect or a verdict means, out of the tables of the docs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import click

from femubench.core.cli.registry import wrap_text
from femubench.core.plugin.validation import choose_names

_PAGES = ("case-format", "effects", "diagnosis", "settings")
_CELL = re.compile(r"(?<!\\)\|")
_LINK = re.compile(r"\[([^]]*)\]\([^)]*\)")


class _Saying(NamedTuple):
    """A row of a table or a paragraph: its page and heading, what it is on, and all it mentions."""

    page: str
    heading: str
    names: list[str]
    mentions: list[str]
    text: str


def _sayings() -> Iterator[_Saying]:
    """Yield the rows of the tables of the pages, and their paragraphs."""
    for page in _PAGES:
        file = Path(__file__).parents[2] / "docs" / f"{page}.md"
        heading = ""
        for block in file.read_text(encoding="utf-8").split("\n\n"):
            if block.startswith("#"):
                heading = block.partition("\n")[0].lstrip("# ").replace("`", "")
            table = [[c.strip() for c in _CELL.split(line)[1:-1]] for line in block.split("\n")]
            pairs: list[tuple[list[str], str]] = [([], block)]
            if block.startswith("|"):
                header, _, *rows = table
                pairs = [
                    (re.findall("`([^`]+)`", cells[0]), "; ".join(_spoken(header, cells)))
                    for cells in rows
                    if cells
                ]
            for names, text in pairs:
                mentions = re.findall(r"[\w-]+", " ".join(re.findall("`([^`\n]+)`", text)))
                plain = _LINK.sub(r"\1", text).replace("`", "").replace("\\|", "|")
                yield _Saying(page, heading, names, mentions, " ".join(plain.split()))


def _spoken(header: list[str], cells: list[str]) -> Iterator[str]:
    """Yield the cells of a row after the first with the heads of their columns."""
    for head, cell in zip(header[1:], cells[1:], strict=False):
        if cell:
            yield cell if head == "meaning" else f"{head}: {cell}"


@click.command("help")
@click.argument("key")
def help_(key: str) -> None:
    """Explain a key of a case, an effect, a verdict or a setting.

    KEY may name its table too: measurement.tolerance.
    """
    table, _, name = key.strip("[]").rpartition(".")
    rows = list(_sayings())
    named = dict.fromkeys(n for row in rows for n in row.names)
    if not (found := [row for row in rows if name in row.names]):
        found = [row for row in rows if name in row.mentions]
    choose_names("key", [] if found else [name], named)
    for row in [row for row in found if table in row.heading] or found:
        click.echo(f"{name} ({row.heading}, docs/{row.page}.md)")
        click.echo(wrap_text(row.text, indent=2, hanging=2))
