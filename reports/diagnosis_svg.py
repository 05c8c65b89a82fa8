"""The few pieces that drawings of a diagnosis are made of; every text and value is escaped."""

from __future__ import annotations

import math
from collections.abc import Iterable

from markupsafe import Markup, escape

from femubench.reports.cells import plain

Value = str | float | int | None


def tag(name: str, *children: Markup | str, **attributes: Value) -> Markup:
    """Return an element; ``_`` stands for a dash in a name, ``class_`` for ``class``, None is out.

    Arguments:
        name: of the element, never from data.
        children: markup as it is, text escaped.
    """
    found = [
        Markup(' {}="{}"').format(key.rstrip("_").replace("_", "-"), _text(value))
        for key, value in attributes.items()
        if value is not None
    ]
    inner = Markup("").join(
        child if isinstance(child, Markup) else escape(plain(child)) for child in children
    )
    return Markup("<{0}{1}>{2}</{0}>").format(Markup(name), Markup("").join(found), inner)


def drawing(
    parts: Iterable[Markup], *, width: float, height: float, name: str, says: str, anchor: str
) -> Markup:
    """Return a drawing that scales with the page.

    Arguments:
        parts: in the order in which they are painted.
        width, height: of its own coordinates.
        name: one or two words on what it is.
        says: what one sees in it, for who cannot see it.
        anchor: an id that no other drawing of the page has.
    """
    title = tag("title", name, id=f"{anchor}-title")
    description = tag("desc", says, id=f"{anchor}-desc")
    return tag(
        "svg",
        title,
        description,
        *parts,
        viewBox=f"0 0 {_text(width)} {_text(height)}",
        role="img",
        aria_labelledby=f"{anchor}-title {anchor}-desc",
    )


def label(x: float, y: float, text: str, kind: str = "", anchor: str | None = None) -> Markup:
    """Return a text at a point; `anchor` is ``middle`` or ``end``."""
    return tag("text", text, x=x, y=y, class_=kind or None, text_anchor=anchor)


def line(start: tuple[float, float], end: tuple[float, float], kind: str, **more: Value) -> Markup:
    """Return a straight line."""
    return tag("line", x1=start[0], y1=start[1], x2=end[0], y2=end[1], class_=kind, **more)


def _text(value: Value) -> str:
    if isinstance(value, float):
        return f"{value:.2f}".rstrip("0").rstrip(".") if math.isfinite(value) else "0"
    return plain(value)
