"""A drawing inside of an HTML document: names of its own, nothing that runs or is fetched."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from xml.etree import ElementTree

from markupsafe import Markup

from femubench.plot import Chart, svg

_SVG, _XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
_PICTURE = "data:image/png;base64,"  # how a matrix image lies in a drawing
# What can run, what can hold anything, and what no reader sees.
_REFUSED = frozenset({"script", "foreignObject", "metadata"})
_ID_LISTS = ("aria-labelledby", "aria-describedby")
_NARROW = 3.7  # in, of a telephone
_REFERENCE = re.compile(r"url\(\s*['\"]?([^'\")]*)['\"]?\s*\)")


def drawing(chart: Chart, caption: str) -> Markup | None:
    """Return a chart for the middle of a page, in the colours of its style sheet.

    It is drawn twice, ``broad`` and ``narrow``; the style sheet shows what the screen has room for.

    Arguments:
        caption: what one sees in it, for who cannot see it.
    """
    if not any(series.x for series in chart.series):
        return None
    name, (broad, height) = re.sub(r"\W+", "-", chart.title), chart.size
    named = partial(svg, chart.draw, title=chart.title, caption=caption, themed=True)
    drawn = (
        f'<div class="{look}">{named(name=f"{name}-{look}", size=(width, height))}</div>'
        for look, width in (("broad", broad), ("narrow", _NARROW))
    )
    return Markup("".join(drawn))


def embed_svg(svg: str, prefix: str, label: str) -> Markup:
    """Return a drawing for the middle of a document.

    Arguments:
        svg: a document of its own; what `drawing` made stays as it is.
        prefix: put before every id, as a page with several drawings must not have one twice.
        label: what a screen reader says where the drawing names nothing itself.

    Raises:
        ValueError: when it is no SVG.
    """
    if isinstance(svg, Markup):
        return svg
    root = ElementTree.fromstring(svg)
    if root.tag != f"{{{_SVG}}}svg":
        raise ValueError(f"{label}: not a drawing but {root.tag!r}")
    _clean(root, prefix)
    root.set("role", "img")
    if not root.get("aria-labelledby"):
        root.set("aria-label", label)
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _XLINK)
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _clean(element: ElementTree.Element, prefix: str) -> None:
    for child in list(element):
        if child.tag.rpartition("}")[2] in _REFUSED:
            element.remove(child)
        else:
            _clean(child, prefix)
    kept = _prefixed(element.attrib, prefix)
    element.attrib.clear()
    element.attrib.update(kept)
    if element.text and element.tag.rpartition("}")[2] == "style":
        element.text = _REFERENCE.sub("none", element.text).replace("@import", "")


def _prefixed(attributes: Mapping[str, str], prefix: str) -> dict[str, str]:
    """Return what runs and fetches nothing, with ids, and references to ids, of this drawing."""

    def renamed(match: re.Match[str]) -> str:
        target = match[1]
        return f"url(#{prefix}-{target[1:]})" if target.startswith("#") else "none"

    found = {}
    for name, value in attributes.items():
        local = name.rpartition("}")[2]
        if local.startswith("on") or (local == "href" and not value.startswith(("#", _PICTURE))):
            continue
        if name == "id":
            found[name] = f"{prefix}-{value}"
        elif name in _ID_LISTS:
            found[name] = " ".join(f"{prefix}-{word}" for word in value.split())
        elif local == "href" and value.startswith("#"):
            found[name] = f"#{prefix}-{value[1:]}"
        else:
            found[name] = _REFERENCE.sub(renamed, value)
    return found
