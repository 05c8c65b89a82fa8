"""A report as sections of text, lists, tables and drawings, for the screen and in Markdown."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Literal
from urllib.parse import quote

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
        wrap: whether a longer cell goes on below, instead of being cut.
    """

    title: str
    width: int
    left: bool = False
    wrap: bool = False

    @property
    def side(self) -> Literal["left", "right"]:
        """Return where the cells stand."""
        return "left" if self.left else "right"


@dataclass(frozen=True)
class Table:
    """Rows of raw cells; the columns together fit on the screen.

    Arguments:
        columns, rows: headers and cells.
        caption: one line on the whole, may be empty.
        tones: a word for each row that HTML may style it by; nothing may rest on it alone.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    tones: Sequence[str] = ()


@dataclass(frozen=True)
class Items:
    """A list of remarks.

    Arguments:
        entries: label, which may be empty, and text.
        whole: whether words wider than the screen stay whole, as commands must to be copied.
    """

    entries: Sequence[tuple[str, str]]
    whole: bool = False


@dataclass(frozen=True)
class Drawing:
    """A figure.

    Arguments:
        title: one line.
        caption: what it shows and where it comes from.
        svg: its drawing, for HTML; may be empty.
        file: where the drawing lies from the Markdown document; empty for nowhere.
    """

    title: str
    caption: str
    svg: str = ""
    file: str = ""


Block = str | Table | Items | Drawing


@dataclass(frozen=True)
class Section:
    """Blocks under a title; without a title they stand by themselves.

    Arguments:
        level: 2 for a chapter, 3 for a part of one.
    """

    title: str
    blocks: Sequence[Block]
    level: int = 2


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
            yield from (_entry(label, text, whole=block.whole) for label, text in block.entries)
        elif isinstance(block, Drawing):
            yield _entry(block.title, block.caption)
        else:
            if block.caption:
                yield textwrap.fill(plain(block.caption), WIDTH, break_on_hyphens=False)
            rows = [line for row in block.rows for line in _lines(row, block.columns)]
            heads = [(column.title, column.side) for column in block.columns]
            yield textwrap.indent(aligned_table(rows, *zip(*heads, strict=True)), "  ")


def _entry(label: str, text: str, *, whole: bool = False) -> str:
    return textwrap.fill(
        plain(f"{label}: {text}" if label else text),
        WIDTH, initial_indent="  ", subsequent_indent="      ",
        break_on_hyphens=False, break_long_words=not whole,
    )  # fmt: skip


def _lines(row: Sequence[str], columns: Sequence[Column]) -> list[list[str]]:
    """Return the lines that a row takes on the screen."""
    cells = [
        textwrap.wrap(plain(cell), column.width)
        if column.wrap
        else [shortened(plain(cell), column.width)]
        for cell, column in zip(row, columns, strict=True)
    ]
    return [list(line) for line in zip_longest(*cells, fillvalue="")] or [[""] * len(columns)]


def _document(section: Section) -> Iterator[str]:
    if section.title:
        yield f"{'#' * section.level} {escape(section.title)}"
    for block in section.blocks:
        if isinstance(block, str):
            yield _line(escape(block))
        elif isinstance(block, Items):
            yield "\n".join(f"- {_labelled(label, text)}" for label, text in block.entries)
        elif isinstance(block, Drawing):
            if block.file:
                yield f"![{escape(block.title)}]({quote(block.file)})"
            yield _labelled(block.title, block.caption)
        else:
            if block.caption:
                yield _line(escape(block.caption))
            heads = [escape(column.title) for column in block.columns]
            rows = (map(escape, row) for row in block.rows)
            yield table(heads, rows, "".join(column.side[0] for column in block.columns))


def _labelled(label: str, text: str) -> str:
    return f"**{escape(label)}**: {escape(text)}" if label else _line(escape(text))


def _line(text: str) -> str:
    """Return escaped text that stays a paragraph wherever it starts."""
    return _STARTERS.sub(r"\1\\\2", text)
