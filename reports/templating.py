"""How templates become pages: what comes from data is one line and escaped, our files stay."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

from femubench.reports.cells import chance, format_fixed, plain, sentence, shorten_text

if TYPE_CHECKING:
    from jinja2 import Environment


@cache
def templates() -> Environment:
    """Return the templates of pages."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    room = Environment(
        loader=PackageLoader("femubench.reports", "page/assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: value if hasattr(value, "__html__") else plain(value),
    )
    room.filters.update(fixed=format_fixed, plain=plain, shortened=shorten_text, chance=chance)
    room.filters["sentence"] = sentence
    return room


def asset(name: str) -> str:
    """Return the text of a file next to the templates of pages."""
    path = files("femubench.reports").joinpath("page", "assets", name)
    return path.read_text(encoding="utf-8")
