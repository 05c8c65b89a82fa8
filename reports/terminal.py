"""Blocks of a report on the screen, 80 columns wide."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest

from femubench.reports.blocks import Block, Cards, Column, Items, Passage, Row, Table
from femubench.reports.cells import plain, shorten_text

WIDTH = 80


def to_terminal(sections: Iterable[Passage]) -> str:
    """Return plain text of 80 columns at most; whatever a terminal would obey is taken out."""
    return "\n\n".join("\n".join(_screen(section)) for section in sections)


def align_table(rows: list[list[str]], headers: tuple[str, ...], align: tuple[str, ...]) -> str:
    """Return a table no wider than its cells; tabulate pads headers, so they go in as rows."""
    from tabulate import tabulate

    height = max(header.count("\n") for header in headers) + 1
    split = [[""] * (height - 1 - header.count("\n")) + header.split("\n") for header in headers]
    heads = [list(line) for line in zip(*split, strict=True)]
    rule = ["-" * max(map(len, column)) for column in zip(*heads, *rows, strict=True)]
    lines = [*heads, rule, *rows]
    text: str = tabulate(lines, tablefmt="plain", disable_numparse=True, colalign=align)
    return "\n".join(line.rstrip() for line in text.splitlines())


def _screen(section: Passage) -> Iterator[str]:
    if section.title:
        yield shorten_text(plain(section.title), WIDTH)
    for block in section.blocks:
        yield from _shown(block, "  " if section.title else "")


def _shown(block: Block, indent: str) -> Iterator[str]:
    if isinstance(block, str):
        yield textwrap.fill(plain(block), WIDTH, break_on_hyphens=False)
    elif isinstance(block, Table):
        if block.caption:
            yield textwrap.fill(plain(block.caption), WIDTH, break_on_hyphens=False)
        yield textwrap.indent("\n\n".join(_parts(block, WIDTH - len(indent))), indent)
        if more := len(block.rows[block.most :]) if block.most else 0:
            yield f"... and {more} more in the report"
    elif isinstance(block, Items | Cards):
        whole = isinstance(block, Items) and block.whole
        yield from (_entry(*entry, whole=whole) for entry in block.entries)
    else:
        drawings = block.drawings if isinstance(block, Row) else (block,)
        yield from (_entry(one.title, one.caption) for one in drawings)


def _entry(label: str, *texts: str, whole: bool = False) -> str:
    text = ", ".join(texts)
    return textwrap.fill(
        plain(f"{label}: {text}" if label else text),
        WIDTH, initial_indent="  ", subsequent_indent="      ",
        break_on_hyphens=False, break_long_words=not whole,
    )  # fmt: skip


def _parts(table: Table, room: int) -> Iterator[str]:
    """Yield a table in parts that fit on the screen."""
    rows = [
        [c.text(cell, c.width) for c, cell in zip(table.columns, row, strict=True)]
        for row in table.rows[: table.most]
    ]
    widths = []
    for column, *cells in zip(table.columns, *rows, strict=True):
        longest = max(map(len, cells), default=0)
        widths.append(max(min(longest, column.width), *map(len, column.title.split("\n"))))
    parts: list[list[int]] = [[]]
    for place, width in enumerate(widths):
        if parts[-1] and sum(widths[k] + 2 for k in parts[-1]) + width > room:
            parts.append([table.names])
        parts[-1].append(place)
    for part in parts:
        spare = max(0, room + 2 - sum(widths[k] + 2 for k in part))
        columns = [table.columns[k] for k in part]
        most = [column.width or widths[k] + spare for k, column in zip(part, columns, strict=True)]
        lines = [line for row in rows for line in _lines([row[k] for k in part], columns, most)]
        heads = [(column.title, column.side) for column in columns]
        yield align_table(lines, *zip(*heads, strict=True))


def _lines(row: Sequence[str], columns: Sequence[Column], widths: Sequence[int]) -> list[list[str]]:
    """Return the lines that a row takes on the screen."""
    cells = [
        textwrap.wrap(cell, width) if column.wrap else [shorten_text(cell, width)]
        for cell, column, width in zip(row, columns, widths, strict=True)
    ]
    return [list(line) for line in zip_longest(*cells, fillvalue="")] or [[""] * len(columns)]
