"""A report as one HTML document: nothing but itself is needed to read it, no script runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from femubench.reports.blocks import Block, Drawing, Items, Section, Table
from femubench.reports.cells import plain
from femubench.reports.svg import embedded
from femubench.reports.templating import templates

_TEMPLATE = "report.html"


def to_html(sections: Iterable[Section], *, title: str, heading: str) -> str:
    """Return a document; whatever comes from data is escaped.

    Arguments:
        sections: of level 2 and 3, in reading order.
        title: in the title bar.
        heading: at the top, the line that matters most.
    """

    room = templates("templates")
    numbered = list(_numbered(sections))
    found = room.get_template(_TEMPLATE)
    return found.render(title=plain(title), heading=plain(heading), sections=numbered)


def _numbered(sections: Iterable[Section]) -> Iterator[Mapping[str, Any]]:
    """Return what the template shows, with an anchor for every section."""
    for number, section in enumerate(sections, 1):
        blocks = [_shown(block, f"s{number}-{k}") for k, block in enumerate(section.blocks, 1)]
        yield {
            "id": f"s{number}",
            "title": plain(section.title),
            "level": section.level,
            "blocks": blocks,
        }


def _shown(block: Block, anchor: str) -> Mapping[str, Any]:
    if isinstance(block, str):
        return {"kind": "text", "text": plain(block)}
    if isinstance(block, Items):
        entries = [(plain(label), plain(text)) for label, text in block.entries]
        return {"kind": "items", "entries": entries}
    if isinstance(block, Drawing):
        return {
            "kind": "drawing",
            "title": plain(block.title),
            "caption": plain(block.caption),
            "svg": embedded(block.svg, anchor, plain(block.title)) if block.svg else "",
        }
    return _table(block)


def _table(block: Table) -> Mapping[str, Any]:
    tones = block.tones or [""] * len(block.rows)
    rows = [
        (tone, [plain(cell) for cell in row]) for tone, row in zip(tones, block.rows, strict=True)
    ]
    return {
        "kind": "table",
        "caption": plain(block.caption),
        "heads": [plain(column.title) for column in block.columns],
        "sides": ["left" if column.left else "right" for column in block.columns],
        "rows": rows,
    }
