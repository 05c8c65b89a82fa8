"""Blocks of a report in GitHub's Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from urllib.parse import quote

from femubench.reports.blocks import Block, Cards, Items, Passage, Row, Table
from femubench.reports.cells import plain

_SPECIAL = re.compile(r"([\\`*_\[\]|~])")
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
# What at the start of a line makes a heading, a list or a rule of it.
_STARTERS = re.compile(r"^(\d*)([#+\-=.)])")


def to_markdown(sections: Iterable[Passage], title: str = "") -> str:
    """Return a document; whatever Markdown or HTML would obey is escaped."""
    heading = [f"# {escape(title)}"] if title else []
    return "\n\n".join([*heading, *(part for section in sections for part in _parts(section))])


def escape(text: object) -> str:
    """Return text that Markdown shows as it is, on one line."""
    safe = "".join(_ENTITIES.get(letter, letter) for letter in plain(text))
    return _SPECIAL.sub(r"\\\1", safe)


def table(headers: Sequence[str], rows: Iterable[Iterable[str]], align: str) -> str:
    """Return a table of cells that are escaped already; `align` has an l or r a column."""
    rules = {"l": ":---", "r": "---:"}
    lines = [headers, [rules[side] for side in align], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _parts(section: Passage) -> Iterator[str]:
    if section.title:
        yield f"{'#' * section.level} {escape(section.title)}"
    for block in section.blocks:
        yield from _shown(block)


def _shown(block: Block) -> Iterator[str]:
    if isinstance(block, str):
        yield _STARTERS.sub(r"\1\\\2", escape(block))
    elif isinstance(block, Table):
        if block.caption:
            yield _STARTERS.sub(r"\1\\\2", escape(block.caption))
        heads = [escape(column.title) for column in block.columns]
        rows = (
            (escape(c.text(cell)) for c, cell in zip(block.columns, row, strict=True))
            for row in block.rows
        )
        yield table(heads, rows, "".join(column.side[0] for column in block.columns))
    elif isinstance(block, Items | Cards):
        yield "\n".join(f"- {_labelled(*entry)}" for entry in block.entries)
    else:
        for one in block.drawings if isinstance(block, Row) else (block,):
            if one.file:
                yield f"![{escape(one.title)}]({quote(one.file)})"
            yield _labelled(one.title, one.caption)


def _labelled(label: str, *texts: str) -> str:
    text = ", ".join(texts)
    return (
        f"**{escape(label)}**: {escape(text)}" if label else _STARTERS.sub(r"\1\\\2", escape(text))
    )
