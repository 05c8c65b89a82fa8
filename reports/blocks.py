"""A report as sections of text, lists and tables, for the screen and in Markdown."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from femubench.reports.cells import plain, shortened
from femubench.reports.markdown import escape, table
from femubench.reports.terminal import WIDTH, aligned_table

# What at the start of a line makes a heading, a list or a rule of it.
_STARTERS = re.compile(r"^(\d*)([#+\-=.)])")


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Arguments:
        title: its header.
        width: the most characters that a cell takes on the screen.
        left: whether it holds words rather than figures.
    """

    title: str
    width: int
    left: bool = False


@dataclass(frozen=True)
class Table:
    """Rows of raw cells; the columns together fit on the screen."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Items:
    """A list of remarks, each with a label that may be empty."""

    entries: Sequence[tuple[str, str]]


Block = str | Table | Items


@dataclass(frozen=True)
class Section:
    """Blocks under a title; without a title they stand by themselves."""

    title: str
    blocks: Sequence[Block]


def to_terminal(sections: Iterable[Section]) -> str:
    """Return plain text of 80 columns at most; whatever a terminal would obey is taken out."""
    return "\n\n".join("\n".join(_screen(section)) for section in sections)


def to_markdown(sections: Iterable[Section]) -> str:
    """Return GitHub's Markdown; whatever it or HTML would obey is escaped."""
    return "\n\n".join(part for section in sections for part in _document(section))


def _screen(section: Section) -> Iterator[str]:
    if section.title:
        yield shortened(plain(section.title), WIDTH)
    for block in section.blocks:
        if isinstance(block, str):
            yield textwrap.fill(plain(block), WIDTH, break_on_hyphens=False)
        elif isinstance(block, Items):
            yield from (_entry(label, text) for label, text in block.entries)
        else:
            yield textwrap.indent(_screen_table(block), "  ")


def _entry(label: str, text: str) -> str:
    words = plain(f"{label}: {text}" if label else text)
    return textwrap.fill(
        words, WIDTH, initial_indent="  ", subsequent_indent="      ", break_on_hyphens=False
    )


def _screen_table(block: Table) -> str:
    rows = [
        [
            shortened(plain(cell), column.width)
            for cell, column in zip(row, block.columns, strict=True)
        ]
        for row in block.rows
    ]
    sides = tuple("left" if column.left else "right" for column in block.columns)
    return aligned_table(rows, tuple(column.title for column in block.columns), sides)


def _document(section: Section) -> Iterator[str]:
    if section.title:
        yield f"## {escape(section.title)}"
    for block in section.blocks:
        if isinstance(block, str):
            yield _line(escape(block))
        elif isinstance(block, Items):
            yield "\n".join(f"- {_labelled(label, text)}" for label, text in block.entries)
        else:
            heads = [escape(column.title) for column in block.columns]
            rows = [[escape(cell) for cell in row] for row in block.rows]
            yield table(
                heads, rows, "".join("l" if column.left else "r" for column in block.columns)
            )


def _labelled(label: str, text: str) -> str:
    return f"**{escape(label)}**: {escape(text)}" if label else _line(escape(text))


def _line(text: str) -> str:
    """Return escaped text that stays a paragraph wherever it starts."""
    return _STARTERS.sub(r"\1\\\2", text)
