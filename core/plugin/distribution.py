"""What the package of a strategy says of itself: home page, summary, authors, DOI."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from importlib import metadata
from typing import TYPE_CHECKING, cast

from femubench.core.errors import harmless

if TYPE_CHECKING:
    from email.message import Message

LONGEST_LINE = 500  # characters
HOMEPAGE = r"^(https?://[^\s\"'<>\\]+)?\Z"
DOI = r"^(10\.\d{4,9}/[^\s\"'<>\\]+)?\Z"
# Labels of addresses, the best first, as packaging.python.org lists them.
_LABELS = ("homepage", "repository", "source", "sourcecode", "github", "documentation", "docs")


def about(name: str, doi: object = "") -> dict[str, str]:
    """Return what an installed distribution says of itself; nothing where there is none."""
    return select_known({**_packaged(name), "doi": str(doi)})


@lru_cache(maxsize=100)
def _packaged(name: str) -> dict[str, str]:
    try:
        # A mapping to type checkers; in all versions of Python a message with `get`.
        fields = cast("Message", metadata.metadata(name))
    except (metadata.PackageNotFoundError, ValueError):
        return {}
    links: dict[str, str] = {}
    for line in fields.get_all("Project-URL") or ():
        label, _, address = str(line).partition(",")
        links[re.sub(r"[\W_]", "", label).lower()] = address.strip()
    addresses = [*map(links.get, _LABELS), fields.get("Home-page"), *links.values()]
    authors = (fields.get("Author"), fields.get("Author-email"))
    return {
        "homepage": next((str(url) for url in addresses if _fits(HOMEPAGE, url)), ""),
        "summary": str(fields.get("Summary") or ""),
        "author": next((str(text) for text in authors if text), ""),
    }


def select_known(about: Mapping[str, object]) -> dict[str, str]:
    """Return the part of a description that can be shown; an address is one of the web or none."""
    forms = {"homepage": HOMEPAGE, "doi": DOI, "summary": "", "author": ""}
    lines = {name: harmless(str(about.get(name) or ""))[:LONGEST_LINE] for name in forms}
    return {name: text for name, text in lines.items() if text and _fits(forms[name], text)}


def _fits(form: str, text: object) -> bool:
    return bool(text) and re.search(form, str(text)) is not None
